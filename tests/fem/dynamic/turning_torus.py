"""A soft inflated torus of few elements that turns, and a pulse on it."""

import numpy as np
from scipy import sparse

from tireroad.fem.matrices import probe
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.tests.validation.cases import thesis_torus

DAMPING = (400.0, 0.0)


def inflated(comm):
    """An inflated torus of few elements, its operators, rotation matrices, a load and its reading."""
    section = thesis_torus(segments=12, elements_arc=4)
    material = compound("neo-hookean", 1200.0, youngs_modulus=4.8e7, poisson_ratio=0.45)
    body = Body(comm, section, material)
    LoadStepper(Equilibrium(body), lambda progress: None).inflate(2e5)
    operators = Operators(body, 2e5)
    weights = probe.spot(body.lattice, 0.0, 0.0)
    load = sparse.csr_matrix(probe.directed(weights, (0.0, 0.0, 1.0)))
    return operators, operators.rotation(), load


def pulse(time):
    """A smooth push of 10 ms."""
    return np.where(time < 0.01, np.sin(np.pi * time / 0.01) ** 4, 0.0)
