"""Modes of the tire at its static state, standing and rolling."""
