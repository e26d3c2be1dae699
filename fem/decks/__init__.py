"""Meshes from files: Abaqus decks and Gmsh meshes, read as data and made into sections. Without
dolfinx.
"""
