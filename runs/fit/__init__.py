"""A built-in tire fitted to the figures of a real one."""
