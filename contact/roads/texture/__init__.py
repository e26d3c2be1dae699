"""Texture of roads: random fields with a given spectrum, what profiles say of it, and levels."""
