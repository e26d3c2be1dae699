"""The tire as a body: section, mesh, wall, material, and its displacement."""
