"""One file for each kind of section: its keys, its elements, its compounds and cords."""
