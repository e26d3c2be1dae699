"""Static states reduced by symmetry: one section, or half of the ring."""
