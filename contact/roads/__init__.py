"""Roads, a kind a file, and how one passes under the tire."""
