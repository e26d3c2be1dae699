"""Roads that are no level plane: camber and drums."""
