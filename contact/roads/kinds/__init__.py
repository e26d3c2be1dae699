"""The kinds of roads: `road.kind` of a scene selects one (contact.roads.road)."""
