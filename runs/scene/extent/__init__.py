"""How large a scene is: its section and elements, unknowns, memory, disk and time, before anything is computed."""
