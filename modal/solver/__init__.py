"""Eigensolvers: block Lanczos in inertia slices of symmetric parts, and SLEPc on the quadratic
problem.
"""
