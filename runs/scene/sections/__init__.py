"""The kinds of section that a scene's tire can have; a new kind is a file in `kinds`."""
