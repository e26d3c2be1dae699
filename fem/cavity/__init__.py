"""The air inside the tire: gas, ring duct, and how the wall drives it."""
