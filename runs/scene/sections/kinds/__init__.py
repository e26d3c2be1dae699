"""One module per kind of section: its keys, elements, compounds and cords."""
