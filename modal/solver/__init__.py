"""Eigensolvers: block Lanczos in inertia slices, and SLEPc for the quadratic problem."""
