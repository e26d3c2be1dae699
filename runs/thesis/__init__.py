"""The thesis's figures and tables, computed anew and compared with it (command `reproduce`)."""
