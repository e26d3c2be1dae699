"""Texture of roads: random fields with a given spectrum, profile analysis, and levels."""
