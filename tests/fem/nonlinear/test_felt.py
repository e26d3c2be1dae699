"""What the road feels of a load that is left out: balance with the elements at large motions, on any number of processes."""

import numpy as np
import pytest
from mpi4py import MPI
from nonlinear_tire import pressed, smooth
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.matrices.compliance import multiply, solve_all
from tireroad.fem.nonlinear.felt import felt_by_road
from tireroad.fem.nonlinear.quasi_static import Elements
from tireroad.fem.nonlinear.road import contact_points

SOFTNESS = 2e-6  # m/N of the tread of each point


@pytest.mark.mpi
def test_the_elements_are_in_balance_with_the_forces_of_the_road():
    """At a motion of millimetres: what is left over falls as the square of the load, where the linear stiffness is far off."""
    force, state = pressed(MPI.COMM_WORLD)
    comm = force.body.comm
    motion, pattern = smooth(force, 3e-3)[:, :2].T
    points = contact_points(force.body.lattice, state, 1e9)
    columns, p = Elements(force, points).columns, len(points.gap)
    down = np.argsort(points.gap, kind="stable")[:4]
    lean = sparse.csr_matrix(
        (np.r_[np.ones(4), np.full(4, -0.3)], (np.r_[2 * p + down, down], np.tile(range(4), 2))),
        shape=(3 * p, 4),
    )
    normal, tread = (columns @ lean).tocsr(), SOFTNESS * np.eye(4)

    def answer(size: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces on the points, and what of the elements' forces is out of balance (n,)."""
        load = size * multiply(force.operators.stiffness, pattern[:, None])[:, 0]
        forces = felt_by_road(force, motion, load, normal, tread)
        stiffness = force.tangent(motion, motion)
        pushed = normal @ forces - load
        moved = solve_all(stiffness, sparse.csr_matrix(pushed[:, None]))[:, 0]
        stiffness.destroy()
        along = summed(comm, normal.T @ moved)
        assert np.allclose(SOFTNESS * forces, -along, rtol=0, atol=1e-8 * np.abs(along).max())
        return forces, force.change(motion + moved) - force.change(motion) - pushed

    def norm(values: np.ndarray) -> float:
        return float(np.sqrt(summed(comm, np.array([values @ values]))[0]))

    (one, large), (other, small) = answer(0.02), answer(0.01)
    assert np.abs(one).max() > 0.1
    assert np.allclose(one, 2 * other, rtol=1e-7)
    assert norm(large) / norm(small) == pytest.approx(4.0, rel=0.2)
