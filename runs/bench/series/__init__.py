"""An independent method: Fourier series around the axle, finite elements in the section, no
dolfinx."""
