"""The inflated tire pressed on the road: equilibrium, loading, the state that comes of it."""
