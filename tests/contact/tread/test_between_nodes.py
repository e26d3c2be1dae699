"""What a wall gives way to between the nodes of its mesh: what a half-space seen through a mesh lacks of itself."""

import numpy as np
import pytest
from scipy import sparse

from tireroad.contact.patch import Patch
from tireroad.contact.tread.between_nodes import (
    OuterRubber,
    before_equilibrium,
    on_nodes,
    over_rectangles,
)
from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.laws.elastic import HalfSpace

PITCH, SIZE = 0.008, 12  # m, points along and across


def wall(x, y, a, b):
    return half_space_influence(x, y, a, b, 48e6, 0.45)


def patch(between: int) -> tuple[Patch, np.ndarray]:
    """A grid of points on nodes `between` pitches apart, linear between them, and the nodes' areas."""
    line = np.arange(SIZE) / between
    nodes = int(np.ceil(line[-1])) + 1
    hat = np.maximum(0.0, 1 - np.abs(line[:, None] - np.arange(nodes)))
    x, y = (PITCH * v.ravel() for v in np.meshgrid(np.arange(SIZE), np.arange(SIZE), indexing="ij"))
    count = SIZE**2
    made = Patch(
        index=np.arange(nodes**2),
        points=np.stack([x, y, np.zeros(count)], axis=-1),
        half_sizes=np.full((count, 2), PITCH / 2),
        force=np.zeros(count),
        gap=np.zeros(count),
        edge=np.zeros(count, bool),
        line=np.tile(np.arange(SIZE), SIZE),
        weights=sparse.csr_matrix(np.kron(hat, hat)),
        places=GridPlaces((SIZE, SIZE), (PITCH, PITCH), np.arange(count)),
    )
    return made, np.full(nodes**2, (between * PITCH) ** 2)


def matrix(made: Patch, influence) -> np.ndarray:
    every = np.arange(len(made.points))
    return KernelTread(made.places, influence).block(every, every)


@pytest.mark.parametrize("between", [1, 2, 3])
def test_a_mesh_that_is_a_half_space_is_one_again(between):
    """Elements that answer as the half-space to what their nodes can say of a load, and the rest beside them."""
    made, area = patch(between)
    known = on_nodes(made, area, wall)
    weights = made.weights.toarray()
    spread = made.area[:, None] * (weights / area) @ weights.T  # T
    whole = matrix(made, wall)
    assert weights @ known @ weights.T == pytest.approx(spread.T @ whole @ spread, rel=1e-9)
    lacks = np.diag(whole - weights @ known @ weights.T)[5 * SIZE + 5] / whole[0, 0]
    # A point as fine as its node is told by it all but for nothing; two and three times as coarse ones miss most of it.
    low, high = {1: (-1e-9, 1e-9), 2: (0.4, 0.9), 3: (0.5, 0.95)}[between]
    assert low <= lacks <= high


def test_a_tread_on_a_wall_is_softer_by_that():
    made, _ = patch(2)
    law = HalfSpace(youngs_modulus=1e7, poisson_ratio=0.49)
    both = matrix(made, OuterRubber(law=law, wall=wall).influence(1.0))
    assert both == pytest.approx(matrix(made, law.influence(1.0)) + matrix(made, wall))


def test_the_mean_over_a_square_beside_its_middle():
    """Johnson, Contact Mechanics (1985), 3.3: 1.122 and 0.946 of p L (1 - nu^2) / E."""
    at = np.zeros(1), np.zeros(1), np.full(1, 1.0), np.full(1, 1.0)
    assert over_rectangles(wall)(*at) / wall(*at) == pytest.approx(0.946 / 1.122, rel=0.03)


def test_the_unloaded_shape_stays():
    """The gap without any force is that of the mesh alone."""
    made, area = patch(2)
    known = on_nodes(made, area, wall)
    force = np.zeros(len(area))
    force[10:13] = 100.0
    own = 1e-6 * np.eye(len(area))  # m/N, of the nodes
    flat = made.gap - made.weights @ (own @ force)
    other = before_equilibrium(made, known, force)
    assert other.gap - other.weights @ ((own - known) @ force) == pytest.approx(flat, abs=1e-15)
