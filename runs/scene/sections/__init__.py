"""The sections a tire of a scene can have; a new one is a file in `kinds`."""
