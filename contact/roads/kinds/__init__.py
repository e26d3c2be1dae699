"""The kinds of roads, one file each: `road.kind` of a scene selects one (contact.roads.kind)."""
