"""Roads other than a level plane: camber and drums."""
