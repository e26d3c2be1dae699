"""Meshes from files, Abaqus decks and Gmsh meshes, made into sections. Without dolfinx."""
