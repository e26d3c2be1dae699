"""One module per kind of output at the driven points: its keys and its curves."""
