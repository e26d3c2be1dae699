"""Plain NumPy versions of what is compiled: the oracles of its tests."""
