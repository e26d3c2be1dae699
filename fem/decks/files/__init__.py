"""What a file says, read as data: Abaqus decks and Gmsh meshes."""
