"""Static states by what the tire's symmetry leaves of it: one section, half a ring."""
