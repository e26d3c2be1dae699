"""Three-dimensional bodies of revolution and their sections."""
