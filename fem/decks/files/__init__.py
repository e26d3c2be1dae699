"""File contents read as data: Abaqus decks and Gmsh meshes."""
