"""Parts of `validate stability`, one per package of the program."""
