"""The kinds of roads, one a file: `road.kind` of a scene picks one (contact.roads.kind)."""
