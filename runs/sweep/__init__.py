"""`sweep`: a family of runs with shared stages, run locally or through a batch system."""
