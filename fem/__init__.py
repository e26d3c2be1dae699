"""The tire as a body: mesh, materials, equilibrium, and the matrices at a static state."""
