"""`sweep`: a family of runs that shares what it can, locally or through a batch system."""
