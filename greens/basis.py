"""The states that responses are built from, and residual flexibility with inertia as such states.

Residual flexibility with inertia and damping: states that represent the truncated modes.

The columns x = K_Omega^-1 b and the rows y = K_Omega^-T b of the probes, less their component in
the kept modes, are the residual attachment modes. On them the full matrices become

    q'' M_r + q' E_r + q G_0 = G_0 f,   u_r = G_0 q,
    G_0 = y^T K_Omega x - modal,  E_r = y^T (D + 2 Omega G) x - modal,  M_r = y^T M x - modal,

whose receptance has the exact value and slope of the truncated part at 0 Hz, and its leading
inertia. Standing, M_r and G_0 are positive and the states cannot grow; rolling, a state that grows
is made static. (MacNeal, Comput. Struct. 1 (1971) 581; Rubin, AIAA J. 13 (1975) 995; decoupled
here.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.response import Response, couple, reading
from tireroad.modal.basis import Projection
from tireroad.modal.corner import MOMENTS, SEEN
from tireroad.modal.rolling import RollingModes
from tireroad.modal.rotating import checks, rotating
from tireroad.modal.states import StateModes, growing

# Share of the largest static flexibility below which a direction is rounding of the solver.
_ROUNDING = 1e-9
# Directions a thousand times faster than the slowest stay massless: no step resolves them.
_MASSLESS = 1e-6


@dataclass(frozen=True)
class Moments:
    """y^T (K_Omega, D + 2 Omega G, M) x between p probes, (p, p): m/N, m s/N, m s2/N.

    `momentum` (3, p) kg m/N: int rho x; or (12, p), followed by A_0 x, A_1 x and A_2 x of
    greens.response.
    """

    compliance: np.ndarray
    damping: np.ndarray
    inertia: np.ndarray
    momentum: np.ndarray

    def plus(self, other: Moments) -> Moments:
        """Sum, term by term."""
        return Moments(*(a + b for a, b in zip(_parts(self), _parts(other), strict=True)))

    def minus(self, other: Moments) -> Moments:
        """Difference, term by term."""
        return Moments(*(a - b for a, b in zip(_parts(self), _parts(other), strict=True)))


def _parts(moments: Moments) -> tuple[np.ndarray, ...]:
    return moments.compliance, moments.damping, moments.inertia, moments.momentum


def modal_moments(
    drag: np.ndarray,
    stiffness: np.ndarray,
    outputs: np.ndarray,
    loads: np.ndarray,
    carried: np.ndarray,
) -> Moments:
    """Moments between outputs (r, m) and loads (k, m) of a pencil D~, K~ of unit mass."""
    x, y = np.linalg.solve(stiffness, loads.T), np.linalg.solve(stiffness.T, outputs.T).T
    return Moments(outputs @ x, y @ drag @ x, y @ x, carried @ x)


def second_order(
    response: Response,
    modes: StateModes,
    shape: np.ndarray,
    carried: np.ndarray,
    moments: Moments,
    loss: tuple[float, float] | None = None,
    hub: sparse.csr_matrix | None = None,
    felt: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> Response:
    """The response of p probes (outputs = forces) with residual states and an exact static limit.

    `shape` (p, m): the modal shapes at the probes; `carried` (3, m): the momentum of the modes.
    `loss`: the uniform damping rate (1/s) in the moments, and the loss factor eta that replaces it,
    each state being damped at eta times its own circular frequency. `hub` (p, 3): the weights by
    which probes read hub moments, which `response` lacks; `carried` and the momentum of the moments
    then have the rows of greens.response. The immediate moments of the loads are not included. `felt`:
    what the axle feels of a first moment (Basis.felt).
    """
    missing = _missing(response, modes, shape, carried, moments)
    flexibility = missing.compliance
    hub = sparse.csr_matrix((len(flexibility), 3)) if hub is None else hub
    whole = reading(response, modes, hub, carried[3:])
    answers = moments.compliance - hub @ moments.momentum[3:6] if hub.nnz else moments.compliance
    sizes, directions = np.linalg.eigh((flexibility + flexibility.T) / 2)
    kept = sizes > _ROUNDING * np.abs(np.diag(moments.compliance)).max()
    if not kept.any():
        return replace(whole, residual=answers - whole.static())
    basis = directions[:, kept] / np.sqrt(sizes[kept])
    inertia = basis.T @ missing.inertia @ basis
    sizes, directions = np.linalg.eigh((inertia + inertia.T) / 2)
    kept = sizes > _MASSLESS * sizes.max()
    basis = basis @ directions[:, kept] / np.sqrt(sizes[kept])
    inverse = np.linalg.inv(basis.T @ missing.inertia @ basis)
    drag, stiffness = (
        inverse @ (basis.T @ matrix @ basis) for matrix in (missing.damping, flexibility)
    )
    if loss is not None:
        drag = drag + _by_loss_factor(stiffness, *loss)
    states = rotating(drag, stiffness)
    checks(states, drag, stiffness)
    output = flexibility @ basis
    forces = inverse @ (basis.T @ flexibility)
    beside = missing.momentum @ basis
    extra = couple(states, output, forces.T, felt(beside[:3]))
    extra = reading(extra, states, hub, beside[3:])
    whole = whole.and_states_of(extra.keeping_where(lambda s: ~growing(s)))
    return replace(whole, residual=answers - whole.static())


def _by_loss_factor(stiffness: np.ndarray, rate: float, factor: float) -> np.ndarray:
    """eta sqrt(K) - rate: damping by a loss factor in place of a uniform rate, for unit mass."""
    squares, turn = np.linalg.eigh((stiffness + stiffness.T) / 2)
    own = factor * np.sqrt(np.maximum(squares, 0.0))
    return (turn * own) @ turn.T - rate * np.eye(len(squares))


def _missing(
    response: Response, modes: StateModes, shape: np.ndarray, carried: np.ndarray, moments: Moments
) -> Moments:
    """The moments less the modes' part of them."""
    x = _statics(modes, modes.left @ shape.T, modes.block_left @ shape.T)
    y = _adjoints(modes, shape @ modes.right, shape @ modes.block_right)
    return Moments(
        moments.compliance - response.static(),
        moments.damping - response.spectral_moment(),
        moments.inertia - y @ x,
        moments.momentum - carried @ x,
    )


def _statics(modes: StateModes, push: np.ndarray, block_push: np.ndarray) -> np.ndarray:
    """K~^-1 Phi^T (m, p): the modal coordinates under constant unit forces."""
    static = -((modes.right / modes.eigenvalue) @ push).real
    k = len(modes.block) - modes.rigid
    if k:
        static -= modes.block_right[:, :k] @ np.linalg.solve(modes.block[:k, :k], block_push[:k])
    return static


def _adjoints(modes: StateModes, reading: np.ndarray, block_reading: np.ndarray) -> np.ndarray:
    """Phi K~^-1 (p, m)."""
    static = -((reading / modes.eigenvalue) @ modes.left).real
    k = len(modes.block) - modes.rigid
    if k:
        static -= block_reading[:, :k] @ np.linalg.solve(modes.block[:k, :k], modes.block_left[:k])
    return static


Array = np.ndarray
Probes = sparse.csr_matrix  # (k, 3 s) over the outer face, or (k, 3 s + 6) with the rim
Pencil = tuple[np.ndarray, np.ndarray]  # D~ and K~ of a projected problem
ABOUT_AXLE = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])  # e_y x


@dataclass(frozen=True, kw_only=True)
class Basis:
    """The modal basis and its states, with the operations that probes need.

    `shape` kg^-1/2 of the outer face (3 s, m), with six more rows for a free rim; `projection`: the
    projected matrices; `states`: the decoupled states at `speed` rad/s with this `inertia`. Probes
    are weights (k, 3 s) of the outer face. Wider ones have six more columns for the motion of a
    free rim, or, with a corner, seven for wheel and body (modal.corner) and three more that read
    the hub moments.
    """

    shape: np.ndarray
    projection: Projection
    states: StateModes
    speed: float = 0.0
    inertia: str = "full"

    @staticmethod
    def of(rolling: RollingModes) -> Basis:
        """The basis of the states of a rolling tire."""
        basis = rolling.basis
        found = Basis(shape=basis.shape, projection=basis.projection, states=rolling.states)
        return found.at(rolling.turning)

    def at(self, turning: Turning) -> Basis:
        """The same with the speed and the inertia of the rotation that its states are of."""
        return replace(self, speed=turning.speed, inertia=turning.inertia)

    def couple(
        self,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        flexibility: np.ndarray | None = None,
    ) -> Response:
        """Response (r, k) between the probes `outputs` and `loads`.

        With the exact static response `flexibility` (r, k), its residual is what the states lack of
        it.
        """
        given = self.seen(outputs), self.seen(loads)
        response = couple(self.states, *given, self.carried)
        wanted = self.of_hub(outputs)
        if wanted.nnz:
            response = reading(response, self.states, wanted, self.beside(wanted)[3:])
            direct = wanted @ self.loaded(loads)
            response = replace(response, residual=response.residual + direct)
        if flexibility is None:
            return response
        return replace(response, residual=flexibility - response.static())

    def of_hub(self, outputs: sparse.csr_matrix) -> sparse.csr_matrix:
        """Weights (r, 3) by which the probes read the hub moments."""
        corner = self.projection.corner
        if corner is None:
            return sparse.csr_matrix((outputs.shape[0], 3))
        return outputs[:, 3 * len(corner.places) + SEEN :]

    def loaded(self, loads: sparse.csr_matrix) -> np.ndarray:
        """Moments (3, k), m, of unit loads about the axle's centre."""
        return self.projection.wheel.rigid(loads)[:, MOMENTS].T

    @property
    def carried(self) -> np.ndarray:
        """Rows of all coordinates of which the axle feels the rates (Response.momentum)."""
        whole, tire = self.projection.carried, self.projection.momentum
        # The air moves with its own inertia, of which nothing is left out.
        tire = np.pad(tire, ((0, 0), (0, whole.shape[1] - tire.shape[1])))
        return np.vstack([whole, self.felt(tire)[3:]])

    def felt(self, moment: np.ndarray) -> np.ndarray:
        """Rows of which the axle feels the rates, of first moments (3, n) int rho u of the tire.

        These themselves, since convective parts cancel around the ring; or, with the doppler
        inertia, whose rate is that of a frame that turns with the wheel, the three parts (9, n) of

            (d/dt - Omega e_y x)^2 int rho u.
        """
        if self.inertia == "full" or self.speed == 0 or self.projection.moves:
            return moment
        swept = self.speed * ABOUT_AXLE @ moment
        return np.vstack([moment, -2 * swept, self.speed * ABOUT_AXLE @ swept])

    def beside(self, wanted: sparse.csr_matrix) -> np.ndarray:
        """Rows that all coordinates carry besides: the momentum (3, m + a + c).

        Where hub moments are `wanted` (r, 3), the rows A_0, A_1, A_2 of greens.response follow,
        (12, m + a + c).
        """
        carried = self.projection.carried
        if not wanted.nnz:
            return carried
        return np.vstack([carried, *self.projection.moments(self.speed, self.inertia)])

    @property
    def coordinates(self) -> int:
        """Number of coordinates, m + a + c."""
        return self.projection.carried.shape[1]

    def seen(self, probes: sparse.csr_matrix) -> np.ndarray:
        """What the probes read of all coordinates, (k, m + a + c) (modal.basis.Projection.seen)."""
        return self.projection.seen(self._of_modes(probes), probes)

    def face(self, nodes: int) -> np.ndarray:
        """Motion of the `nodes` of the outer face with all coordinates, (3 s, m + a + c).

        That of a wheel that moves is part of it: Phi eta + R xi (modal.corner), not Phi q.
        """
        return self.seen(sparse.identity(3 * nodes, format="csr"))

    def _of_modes(self, probes: sparse.csr_matrix) -> np.ndarray:
        """What the probes read of the modes (k, m); columns of a corner's motions are skipped."""
        width = min(probes.shape[1], len(self.shape))
        return probes[:, :width] @ self.shape[:width]

    @property
    def held(self) -> Basis:
        """The coordinates with the rim held; the states are not those of a held rim."""
        corner = self.projection.corner and replace(self.projection.corner, axle=Axle.held())
        return replace(self, projection=replace(self.projection, corner=corner))


def regained(
    basis: Basis,
    true: Pencil,
    uniform: Pencil,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
) -> Moments:
    """Moments of the modes under true damping less those under the full matrices' damping.

    Added to the moments of the full matrices, they yield those of matrices that damp the modes
    truly and all other motions uniformly. `true`, `uniform`: D~ and K~ of both.
    """
    own = basis.projection.squares > 0
    flexible = np.pad(own, (0, len(true[0]) - len(own)), constant_values=True)  # the air's are
    seen = basis.seen(outputs)[:, flexible], basis.seen(loads)[:, flexible]
    carried = basis.beside(basis.of_hub(outputs))[:, flexible]

    def moments(pencil: Pencil) -> Moments:
        drag, stiffness = (matrix[np.ix_(flexible, flexible)] for matrix in pencil)
        return modal_moments(drag, stiffness, *seen, carried)

    return moments(true).minus(moments(uniform))
