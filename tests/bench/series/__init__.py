"""An independent method: Fourier series around, finite elements in the section, no dolfinx."""
