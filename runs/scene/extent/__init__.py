"""The extent of a scene, estimated in advance: elements, unknowns, memory, disk and time."""
