"""Writing the larger products of the stages to their files and reading them back."""
