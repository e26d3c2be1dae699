"""Static states: the inflated tire pressed on the road, its equilibrium, load path and result."""
