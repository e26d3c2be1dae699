"""Roads: one file per kind, and the road as it passes under the tire."""
