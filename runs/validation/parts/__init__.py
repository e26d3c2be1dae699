"""Parts of validations."""
