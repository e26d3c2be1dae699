"""The extent of a scene, estimated in advance: section, elements, unknowns, memory, disk and
time."""
