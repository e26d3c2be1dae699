"""A moving wheel, coupled to the modes of the tire with a fixed rim (Craig and Bampton 1968).

    u = Phi eta + R xi:  motion relative to the rim, and that of the rim with the tire,

    [1    P^T] eta''   [D   2 Om G] eta'   [K~  k ] eta
    [P    J  ] xi''  + [-2 Om G^T C] xi' + [k^T K_h] xi = forces,

    P = R^T M Phi,   G = Phi^T G R,   k = Phi^T (K + Om^2 S) R,
    J = R^T M R + wheel,   C = hub dampers + 2 Om R^T G R + Om wheel's gyroscopic matrix,
    K_h = hub springs + R^T (K + Om^2 S) R.

The material damping acts on eta alone, the motion of the tire relative to its wheel. With
L L^T = J - P P^T, the mass that the modes do not carry, the coordinates  xi = L^-T x,
eta = q - P^T xi  have unit mass, and all further steps treat them as modal coordinates. Air in the
cavity is carried along by its momentum.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from mpi4py import MPI
from scipy import linalg, sparse

from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import FELT, RimMotion, carried_pencil
from tireroad.fem.wheel import DIRECTIONS, Axle

BODY = 6  # index of the body's height, after the six motions of the rim
# Motions that probes can read or load after the outer face: the rim's six and the body's height.
SEEN = 7
MOMENTS = slice(3, 6)  # of the six
HUB_MOMENTS = 3  # N m: after the motions, the last readings of every wheel
READINGS = SEEN + HUB_MOMENTS  # that probes can have after those of the outer face
_PER_MODE = ("mass", "stiffness", "gyroscopic", "convective")


@dataclass(frozen=True, kw_only=True)
class Corner:
    """The wheel and its coupling to m modes.

    `axle`: the wheel and its suspension; `mass` P^T, `stiffness`, `gyroscopic`, `convective` and,
    for the moments with the doppler inertia, `body`, `body_convective` (m, 6) of the modes, and
    `own_...` (6, 6) of the rim's motions alone, factors of Omega taken out;
    `places` (s, 3) m of the outer face in the static state. Gyroscopic and convective arrays are
    zero for a standing wheel.
    """

    axle: Axle
    places: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    gyroscopic: np.ndarray
    convective: np.ndarray
    body: np.ndarray
    body_convective: np.ndarray
    own_mass: np.ndarray
    own_stiffness: np.ndarray
    own_gyroscopic: np.ndarray
    own_convective: np.ndarray

    @property
    def taking_part(self) -> list[int]:
        """Indices of those of the seven motions of rim and body that are coordinates."""
        return self.axle.taking_part

    @property
    def count(self) -> int:
        """Number of coordinates added, c."""
        return len(self.taking_part)

    def first(self, count: int) -> Corner:
        """The corner with the first `count` modes only."""
        cut = {name: getattr(self, name)[:count] for name in _PER_MODE + FELT["doppler"]}
        return replace(self, **cut)

    def on(self, turn: np.ndarray) -> Corner:
        """The corner with combinations `turn` (m, m') of the modes in their place."""
        turned = {name: turn.T @ getattr(self, name) for name in _PER_MODE + FELT["doppler"]}
        return replace(self, **turned)

    def momentum(self, air: np.ndarray | None) -> np.ndarray:
        """P (7, m + a) kg^1/2 of the modes and of the air, whose own momentum is `air` (3, a)."""
        rows = self.mass.T
        if air is not None:
            rows = np.hstack([rows, np.vstack([air, np.zeros((3, air.shape[1]))])])
        return np.vstack([rows, np.zeros((1, rows.shape[1]))])

    def inertia(self, air_mass: float = 0.0) -> np.ndarray:
        """J (7, 7) of tire, wheel, `air_mass` (kg) and body."""
        out = self._own_pencil(0.0)[0]
        out[range(3), range(3)] += air_mass
        return out

    def _own_pencil(self, speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        whole = {name: getattr(self, f"own_{name}") for name in _PER_MODE}
        return carried_pencil(self.axle, whole, speed)

    def change(self, momentum: np.ndarray, air_mass: float = 0.0) -> np.ndarray:
        """T (n + c, n + c) with (eta, xi) = T (q, x); `momentum` is P as above."""
        part, n = self.taking_part, momentum.shape[1]
        p = momentum[part]
        left = self.inertia(air_mass)[np.ix_(part, part)] - p @ p.T
        upper = np.linalg.inv(np.linalg.cholesky(left)).T
        out = np.eye(n + self.count)
        out[:n, n:], out[n:, n:] = -p.T @ upper, upper
        return out

    def with_tire(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Damping and stiffness (n + c, n + c) in (eta, xi), from those of tire and air (n, n)."""
        part, n, m = self.taking_part, len(drag), len(self.mass)
        across = np.zeros((2, n, SEEN))
        across[0, :m, :BODY] = 2 * speed * self.gyroscopic
        across[1, :m, :BODY] = self.stiffness + speed**2 * self.convective
        own = np.stack(self._own_pencil(speed)[1:])
        (d, k), (own_d, own_k) = across[:, :, part], own[:, part][:, :, part]
        return (
            np.block([[drag, d], [-d.T, own_d]]),
            np.block([[stiffness, k], [k.T, own_k]]),
        )

    def check(self, speed: float) -> None:
        """InputError if the hub springs are too soft to hold the wheel against the static loads."""
        part = [k for k in self.axle.moving if k >= MOMENTS.start]
        rows = np.ix_(part, part)
        needed = -(self.own_stiffness + speed**2 * self.own_convective)[rows]
        values = linalg.eigvalsh(self.axle.stiffness[rows] - needed) if part else np.zeros(1)
        if values[0] < 0:
            worst = ", ".join(f"{DIRECTIONS[k]} {needed[i, i]:.4g}" for i, k in enumerate(part))
            raise InputError(
                "axle.stiffness: the corner is unstable: the static loads of the tire turn the wheel, and its "
                f"springs must be stiffer than (N m/rad): {worst}; or lock these directions"
            )

    def free_motions(self, momentum: np.ndarray, air_mass: float = 0.0) -> np.ndarray:
        """Orthonormal motions (n + c, r), in (q, x), that no spring or damper acts on."""
        part = self.taking_part
        drifts = self.axle.free_motions[part]
        p = momentum[part]
        lower = np.linalg.cholesky(self.inertia(air_mass)[np.ix_(part, part)] - p @ p.T)
        return linalg.qr(np.vstack([p.T @ drifts, lower.T @ drifts]), mode="economic")[0]

    def seen(self, tire: np.ndarray, probes: sparse.csr_matrix) -> np.ndarray:
        """Readings of probes (k, 3 s) or wider per coordinate (eta, xi), (k, n + c); `tire` (k, n) of eta."""
        return np.hstack([tire, self.rigid(probes)[:, self.taking_part]])

    def rigid(self, probes: sparse.csr_matrix) -> np.ndarray:
        """Readings of probes per motion of rim and body, (k, 7), m per m and per rad.

        The transpose gives the forces N and the moments N m about the axle's centre of unit loads
        at the probes.
        """
        s = len(self.places)
        weights = probes[:, : 3 * s].tocsr()
        seen = np.zeros((probes.shape[0], SEEN))
        for k in range(3):
            seen[:, k] = np.asarray(weights[:, k::3].sum(axis=1)).ravel()
        # Of component k: x_j in column j.
        moment = [weights[:, k::3] @ self.places for k in range(3)]
        for k in range(3):
            j, i = (k + 1) % 3, (k + 2) % 3
            seen[:, 3 + k] = moment[i][:, j] - moment[j][:, i]
        if probes.shape[1] > 3 * s:
            seen += probes[:, 3 * s : 3 * s + SEEN].toarray()
        return seen

    def moments(self, n: int, speed: float, inertia: str = "full") -> np.ndarray:
        """A (3, 3, n + c), N m: hub moments are those of loads less A_2 q'' + A_1 q' + A_0 q.

        q = (eta, xi) has n coordinates of tire and air and c of the wheel.
        """
        zero, m = np.zeros((n, n)), len(self.mass)
        gyroscopic, convective = (getattr(self, name) for name in FELT[inertia])
        held = replace(
            self,
            axle=replace(self.axle, stiffness=np.zeros(6), damping=np.zeros(6), locked=()),
            gyroscopic=gyroscopic,
            convective=convective,
        )
        drag, stiffness = held.with_tire(zero, zero, speed)
        mass = np.zeros((3, n + SEEN))
        mass[:, :m] = self.mass.T[MOMENTS]
        mass[:, n:] = self.inertia()[MOMENTS]
        rows = slice(n + MOMENTS.start, n + MOMENTS.stop)
        whole = np.zeros((3, 3, n + SEEN))
        for place, part in enumerate((stiffness[rows], drag[rows], mass)):
            whole[place, :, : part.shape[1]] = part
        return whole[:, :, [*range(n), *(n + k for k in self.taking_part)]]

    def carried(self, tire: np.ndarray, air_mass: float = 0.0) -> np.ndarray:
        """Momentum (3, n + c) of tire, air, wheel per rate of (eta, xi); `tire` (3, n) is eta's."""
        whole = self.inertia(air_mass)[:3]
        return np.hstack([tire, whole[:, self.taking_part]])


ARRAYS = tuple(item.name for item in fields(Corner) if item.name != "axle")


def meeting(
    axle: Axle, rim: RimMotion, vectors: np.ndarray, places: np.ndarray, comm: MPI.Comm
) -> Corner:
    """The corner on mass-normalised fields `vectors` (own rows (n, m)). Collective."""
    nothing = np.zeros((vectors.shape[1], 6))
    per_mode = {
        name: summed(comm, vectors.T @ rim.rows[name]) if name in rim.rows else nothing
        for name in _PER_MODE + FELT["doppler"]
    }
    own = {f"own_{name}": rim.whole.get(name, np.zeros((6, 6))) for name in _PER_MODE}
    return Corner(axle=axle, places=places, **per_mode, **own)


def widened(probes: sparse.csr_matrix, count: int) -> sparse.csr_matrix:
    """Probes (k, 3 s) of the outer face, plus the last `count` readings of wheel, body, hub.

    Returns (k + count, 3 s + 10).
    """
    every = sparse.identity(READINGS, format="csr")
    return sparse.block_diag([probes, every[READINGS - count :]], format="csr")
