"""The tables of a scene, key by key, with units, ranges and defaults."""
