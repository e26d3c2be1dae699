"""How the larger products of the stages are written to their files and read back."""
