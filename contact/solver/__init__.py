"""Solvers of one time step: complementarity, friction, large patches."""
