"""Load steps from the unloaded tire to the requested static state."""
