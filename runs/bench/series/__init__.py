"""Fourier series around the axle, finite elements in the section: another method, without dolfinx."""
