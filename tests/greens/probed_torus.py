"""An inflated torus with modes and vertical probes at its footprint."""

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.matrices import probe
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.modal.solver import undamped
from tireroad.tests.validation.cases import thesis_torus

SOFT = {"model": "neo-hookean", "youngs_modulus": 48e6, "poisson_ratio": 0.45, "density": 1200.0}


def probed_torus(count: int, around: int, across: int):
    """Operators of 7,200 unknowns, so many modes, and probes (around * across, 3 s) over 0.35 x 0.64 rad. Collective."""
    section = thesis_torus(segments=24, elements_arc=9, footprint_size=0.4)
    body = Body(MPI.COMM_WORLD, section, compound(**SOFT))
    LoadStepper(Equilibrium(body), lambda progress: None).inflate(2e5)
    operators = Operators(body, 2e5)
    modes = undamped.solve(operators.stiffness, operators.mass, count)
    spots = [
        probe.directed(probe.spot(body.lattice, angle, arc), (0, 0, 1.0))
        for angle in np.linspace(-0.175, 0.175, around)
        for arc in np.linspace(-0.32, 0.32, across)
    ]
    return operators, modes, sparse.csr_matrix(np.stack(spots))
