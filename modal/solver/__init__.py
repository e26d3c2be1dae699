"""Eigensolvers: SLEPc on each symmetric part and inertia slice, and the quadratic problem of the turning tire."""
