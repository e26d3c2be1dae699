"""The tire's finite-element body: mesh, wall, plies, materials and displacement."""
