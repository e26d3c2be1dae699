"""Coupling of the duct's air to the full matrices of one body, as a low-rank term.

A motion u of the tire drives the air by e u, e (1 + a, n) being rows over the unknowns; the air
adds e^T W(s) e to the full matrices (fem.cavity.duct.Duct.dynamic_stiffness). Responses of the tire
without air are corrected for it (Woodbury):

    X <- X - V W (1 + e V W)^-1 e X,   X = A^-1 B,  V = A^-1 e^T.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.cavity.duct import Duct, modes
from tireroad.fem.cavity.gas import inflated
from tireroad.fem.cavity.trace import CavityTrace
from tireroad.fem.collective import summed
from tireroad.fem.matrices.support import Unknowns
from tireroad.fem.tire.body import Body


@dataclass(frozen=True, kw_only=True)
class Column:
    """`duct` on every process; `pushed`: own rows (n, 1 + a) of e^T; `speed` in rad/s."""

    comm: MPI.Comm
    duct: Duct
    pushed: sparse.csr_matrix
    speed: float

    def coupling(self, vectors: np.ndarray) -> np.ndarray:
        """e (1 + a, m) of motions given by own rows (n, m). Collective."""
        return summed(self.comm, self.pushed.T @ vectors)

    def mended(self, answers: np.ndarray, s: complex = 0.0) -> np.ndarray:
        """Responses (r, k) with air, from those without (r + 1 + a, k + 1 + a), those of e last."""
        q = self.pushed.shape[1]
        weight = self.duct.dynamic_stiffness(s, self.speed)
        core = np.eye(q) + answers[-q:, -q:] @ weight
        pull = weight @ np.linalg.solve(core, answers[-q:, :-q])
        return answers[:-q, :-q] - answers[:-q, -q:] @ pull

    def with_air(self, solution: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Own rows (n, p) of static shapes with air, from A^-1 [B, e^T] (n, p + 1 + a). Collective.

        `transposed`: for A^T.
        """
        q = self.pushed.shape[1]
        x, v = solution[:, :-q], solution[:, -q:]
        weight = self.duct.dynamic_stiffness(0.0, self.speed)
        weight = weight.T if transposed else weight
        core = np.eye(q) + self.coupling(v) @ weight
        return x - v @ (weight @ np.linalg.solve(core, self.coupling(x)))

    def following(self, shapes: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The air's coordinates g (a, p) under constant shapes, own rows (n, p). Collective."""
        _, stiffness = self.duct.pencil(self.speed)
        stiffness = stiffness.T if transposed else stiffness
        driven = self.duct.circular[:, None] * self.coupling(shapes)[1:]
        return np.linalg.solve(stiffness, driven)


def make_column(
    body: Body,
    unknowns: Unknowns,
    inflation: float,
    temperature: float,
    speed: float,
    up_to: float | None,
    loss_factor: float | None = None,
) -> Column:
    """The air of a body at its static state, with modes up to `up_to` Hz or, None, `duct.WAVES`. Collective.

    `inflation` Pa above atmospheric pressure, `temperature` K; `loss_factor` as in
    fem.cavity.duct.modes.
    """
    trace = CavityTrace(body)
    gas = inflated(inflation, temperature)
    # One process solves: LAPACK on another might rotate a pair of equal frequencies.
    profile = trace.profile()
    duct = modes(profile, gas, up_to, loss_factor) if body.comm.rank == 0 else None
    duct = body.comm.bcast(duct)
    pushed = trace.columns(unknowns) @ (duct.density * duct.pressure.T)
    return Column(comm=body.comm, duct=duct, pushed=sparse.csr_matrix(pushed), speed=speed)
