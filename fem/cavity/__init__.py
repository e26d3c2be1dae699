"""The air inside the tire: gas, annular duct, and coupling to the wall."""
