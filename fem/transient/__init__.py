"""Time integration of the full finite-element model: the reference for modal runs."""
