"""Small tires for the tests of the finite elements."""

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import compounds
from tireroad.tests.validation.cases import thesis_torus

RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)


@pytest.fixture
def make_body() -> Callable[..., Body]:
    """A torus on this process alone, or on those of `comm`."""

    def make(order=2, segments=12, arc=6, layers=1, comm=MPI.COMM_SELF, free=False, **more):
        material, regions = more.pop("material", RUBBER), more.pop("regions", ())
        cords, plies = more.pop("cords", ()), more.pop("plies", ())
        section = thesis_torus(
            segments=segments, elements_arc=arc, elements_thickness=layers, order=order, **more
        )
        ring = section.ring([region.patch(i) for i, region in enumerate(regions)], plies)
        body = Body(comm, ring, compounds(material, tuple(regions)), cords=cords)
        if free:
            body.rim = np.array([], dtype=np.int32)
        return body

    return make


@pytest.fixture
def csr() -> Callable[..., sparse.csr_matrix]:
    """A serial PETSc matrix in SciPy."""

    def convert(matrix) -> sparse.csr_matrix:
        return sparse.csr_matrix(matrix.getValuesCSR()[::-1], shape=matrix.getSize())

    return convert
