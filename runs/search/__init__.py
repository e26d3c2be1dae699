"""Search for settings that meet a target error ([accuracy] target) at the lowest cost."""
