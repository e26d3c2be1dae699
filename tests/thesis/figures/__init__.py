"""One module per group of figures of the thesis."""
