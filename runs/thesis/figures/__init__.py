"""One module a group of the thesis's figures."""
