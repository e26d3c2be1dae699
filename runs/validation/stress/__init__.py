"""The parts of `validate stability`, a package of the program each."""
