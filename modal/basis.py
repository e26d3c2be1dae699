"""Standing modes with the matrices projected on them; joined by other shapes and by air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy import linalg, sparse

from tireroad.fem.cavity import Column, Duct
from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import Compound, Operators, RimMotion, Rotation
from tireroad.fem.tire.material import CONSTANT, own_moduli
from tireroad.fem.wheel import Axle
from tireroad.modal.corner import Corner, meeting
from tireroad.modal.solver.fields import between, gram, projected, strain_energies
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.waves import ModeNames

Array = np.ndarray

# Fraction of the largest squared length below which a direction is rounding.
_ROUNDING = 1e-12
# Share of a unit column, or its squared length afterwards, from which taking it off leaves rounding
# of more than a hundred times the last digit.
_CLEAN = 1e-4
_ROWS = 4096  # of all fields at a time, when they are changed in place
_SAME = 1e-9  # of the largest trace: two solutions of the same modes differ at least in signs


@dataclass(frozen=True)
class Air:
    """The air of the `duct`, and its `coupling` e (1 + a, m) 1/s with m coordinates of the tire.

    With coordinates eta of the tire and g of the air's own modes, both of unit mass, the pencil is
    that of `fem.cavity.Duct.joined`. The shapes on the outer face have no component along g.
    """

    duct: Duct
    coupling: np.ndarray

    @property
    def count(self) -> int:
        """Number of coordinates of the air, a."""
        return len(self.duct.circular)

    def with_tire(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """D~ (1/s) and K~ (1/s2) of tire and air, (m + a, m + a), from those of the tire (m, m)."""
        return self.duct.with_tire(drag, stiffness, speed, self.coupling)

    def share(self, right: np.ndarray) -> np.ndarray:
        """The air's share (q,) of the states' kinetic energy, from their vectors (m + a ..., q)."""
        squares, own = np.abs(right) ** 2, self.coupling.shape[1]
        return squares[own : own + self.count].sum(axis=0) / squares.sum(axis=0)


def extended(modes: Modes, columns: Array, operators: Operators) -> Modes:
    """Modes of K and M (not K_Omega) followed by pseudo-modes, earlier ones among them, ascending.
    Collective.

    `columns`, own rows (n, p) of R, are overwritten: with a thousand loads on a fine mesh a copy
    takes a gigabyte.

        R <- R - Phi (Phi^T M R),  Psi = R V with Psi^T M Psi = I, Psi^T K Psi diagonal

    The pseudo-modes Psi are M-orthonormal to the modes and to each other, so all later steps treat
    them as modes; G, S and B couple them to the modes. Eigenvectors are K-orthogonal to all that
    they are M-orthogonal to, but static shapes are not: shapes that joined earlier and those that
    join now form one space, on all of which K is made diagonal.
    """
    comm, root = operators.body.comm, np.sqrt(operators.mass)[:, None]
    extra = columns
    extra *= root
    whole = summed(comm, np.einsum("ij,ij->j", extra, extra))
    extra /= np.sqrt(np.where(whole > 0, whole, 1.0))  # a load on the clamped rim moves nothing
    largest = 1.0
    while largest > _CLEAN:  # a further pass removes the rounding of one that took off much
        shares = gram(comm, modes.vectors, root * extra)
        take_off(extra, modes.vectors, shares, root)
        largest = np.abs(shares).max(initial=0.0)
    lengths, directions = np.linalg.eigh(gram(comm, extra, extra))
    kept = lengths > _ROUNDING
    extra = combined(extra, directions[:, kept] / np.sqrt(lengths[kept]), extra)
    if lengths[kept].min(initial=1.0) < _CLEAN:
        take_off(extra, modes.vectors, gram(comm, modes.vectors, root * extra), root)
    extra = combined(extra, np.linalg.inv(np.linalg.cholesky(gram(comm, extra, extra))).T, extra)
    extra /= root
    vectors = np.hstack([modes.vectors, extra])
    del extra
    shapes = vectors[:, modes.count :]
    squares, turn = np.linalg.eigh(between(comm, shapes, operators.stiffness, shapes))
    combined(shapes, turn, shapes)
    squares = np.concatenate([modes.squares[: modes.count], squares])
    return replace(modes, squares=squares, vectors=vectors)


def take_off(fields: Array, basis: Array, shares: Array, weight: Array | None = None) -> None:
    """fields (n, p) -= weight (n, 1) basis (n, m) shares (m, p), in place; no weight: 1."""
    for start in range(0, len(fields), _ROWS):
        rows = slice(start, start + _ROWS)
        part = basis[rows] @ shares
        fields[rows] -= part if weight is None else weight[rows] * part


def combined(fields: Array, change: Array, out: Array) -> Array:
    """fields (n, p) change (p, k), in the first columns of `out`, which may be `fields`."""
    out = out[:, : change.shape[1]]
    for start in range(0, len(fields), _ROWS):
        rows = slice(start, start + _ROWS)
        out[rows] = fields[rows] @ change
    return out


def with_corner(
    projection: Projection,
    modes: Modes,
    axle: Axle | None,
    rim: RimMotion | None,
    places: np.ndarray,
    comm: MPI.Comm,
) -> Projection:
    """The projection on the modes (all rows), with the wheel added; unchanged without a `rim`.

    The wheel is held where `axle` is None. `places` (s, 3) m of the outer face in the static state.
    Collective.
    """
    if rim is None:
        return projection
    return replace(
        projection, corner=meeting(axle or Axle.held(), rim, modes.vectors, places, comm)
    )


def with_air(projection: Projection, modes: Modes, air: Column | None) -> Projection:
    """The projection on the modes (all rows), with the air added where there is any. Collective."""
    return replace(projection, air=Air(air.duct, air.coupling(modes.vectors)) if air else None)


@dataclass(frozen=True, kw_only=True)
class Projection:
    """Phi^T X Phi of the rotating-frame matrices, factors of Omega taken out.

    `squares` (m,) omega^2; `gyroscopic`, `body` (m, m) 1/rad, skew; `convective`, `body_convective`
    (m, m) 1/rad2, symmetric; all four are None for a standing wheel. `momentum` (3, m) kg^1/2: int
    rho phi_k, the momentum per rate of each mode. `losses` (m, m) 1/s: the damping by the compounds'
    loss factors (modal.damping), None where no compound has one. `squares` are those of the finite elements,
    whose moduli are those of fem.tire.material.DYNAMIC_FREQUENCY; `rise` (m, m) 1/s2 is what moduli at
    their own frequencies add, and `band_rise` (m,) what those in the middle of the band add to each, at half
    the highest mode's frequency; `parts` (c, m, m) 1/s2: the stiffness of each kind of compounds whose modulus depends
    on frequency, in the order of the wall's kinds. All three are None where none does. The last `shapes` of the m coordinates
    are static shapes that joined the modes (modal.basis). Further coordinates: a of the `air` after
    the m, then c of a `corner`; a held wheel has c = 0, but its hub still carries moments.
    """

    squares: np.ndarray
    momentum: np.ndarray
    gyroscopic: np.ndarray | None = None
    convective: np.ndarray | None = None
    body: np.ndarray | None = None
    body_convective: np.ndarray | None = None
    losses: np.ndarray | None = None
    rise: np.ndarray | None = None
    band_rise: np.ndarray | None = None
    parts: np.ndarray | None = None
    shapes: int = 0
    air: Air | None = None
    corner: Corner | None = None

    @property
    def own_squares(self) -> np.ndarray:
        """omega^2 (m,) 1/s2 with the moduli at each one's own frequency."""
        return self.squares if self.rise is None else self.squares + np.diag(self.rise)

    @property
    def stiffness(self) -> np.ndarray:
        """The stiffness (m, m) 1/s2 of the standing tire, with those moduli and what couples modes by them."""
        held = np.diag(self.squares)
        return held if self.rise is None else held + self.rise

    @property
    def loss_factor(self) -> np.ndarray | None:
        """Loss factor (m,) of each mode by strain energy; 0 of rigid ones. None where no compound has one."""
        if self.losses is None:
            return None
        rate, circular = np.diag(self.losses), np.sqrt(np.maximum(self.own_squares, 0.0))
        return np.divide(rate, circular, out=np.zeros(len(rate)), where=circular > 0)

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies of the modes, Hz; 0 for rigid ones."""
        return np.sqrt(np.maximum(self.own_squares[: self.modes], 0.0)) / (2 * np.pi)

    @property
    def effective_mass(self) -> np.ndarray:
        """Effective mass of each mode at the hub: x, y, z in kg, then about x, y, z in kg m2, (6, m').

        (int rho phi_k)^2 for modes of unit mass (Clough and Penzien): what a shaken rim feels of a mode; over
        all modes it adds up to the tire's mass and inertia, but for what the rim holds. Of the m' modes, not of
        the shapes that joined them; the moments are NaN where the rim's motions are not known.
        """
        momentum = np.full((6, self.modes), np.nan)
        momentum[:3] = self.momentum[:, : self.modes]
        if self.corner is not None:
            momentum[3:] = self.corner.mass[: self.modes, 3:].T
        return momentum**2

    def as_elements(self, growth: float = 1.0) -> Projection:
        """The projection with the stiffness of the finite elements, times a `growth`."""
        return replace(self, squares=growth * self.squares, rise=None, band_rise=None)

    @property
    def carried(self) -> np.ndarray:
        """Momentum (3, m + a + c) kg^1/2 per rate of coordinates, of all mass on the hub."""
        if not self.moves:
            return self.inside
        return self.wheel.carried(self.inside, self.air_mass) @ self._change

    @property
    def inside(self) -> np.ndarray:
        """Momentum (3, m + a) kg^1/2 per rate of tire and air relative to the rim."""
        return (
            self.momentum
            if self.air is None
            else np.hstack([self.momentum, self.air.duct.momentum])
        )

    def pencil(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """D~ (1/s), K~ (1/s2) of all coordinates, unit mass, from tire and air (m + a, m + a)."""
        if not self.moves:
            return drag, stiffness
        turn, whole = self._change, self.wheel.with_tire(drag, stiffness, speed)
        return turn.T @ whole[0] @ turn, turn.T @ whole[1] @ turn

    def hub_damping(self) -> tuple[np.ndarray, np.ndarray]:
        """Damping of a wheel that moves: tire and air relative to it (m + a, all), and its dampers (all, all) 1/s.

        Both act on all coordinates, of unit mass.
        """
        turn, n = self._change, self.inside.shape[1]
        part = self.wheel.taking_part
        dampers = self.wheel.axle.between_wheel_and_body(self.wheel.axle.damping)[
            np.ix_(part, part)
        ]
        return turn[:n], turn[n:].T @ dampers @ turn[n:]

    def seen(self, shapes: np.ndarray, probes: sparse.csr_matrix) -> np.ndarray:
        """Readings of `probes` per coordinate (k, m + a + c), from `shapes` (k, m) of the modes.

        The coordinates of the air are not visible to probes.
        """
        seen = shapes if self.air is None else np.pad(shapes, ((0, 0), (0, self.air.count)))
        return self.wheel.seen(seen, probes) @ self._change if self.moves else seen

    def moments(self, speed: float, inertia: str = "full") -> np.ndarray:
        """The rows (3, 3, m + a + c) of `Corner.moments` in all coordinates."""
        rows = self.wheel.moments(self.inside.shape[1], speed, inertia)
        return rows @ self._change if self.moves else rows

    @property
    def moves(self) -> bool:
        """Whether there is a corner that lets the wheel move."""
        return self.corner is not None and self.corner.count > 0

    @property
    def wheel(self) -> Corner:
        """The corner, which must exist."""
        assert self.corner is not None, "nothing is known of this tire's rim"
        return self.corner

    @property
    def free_motions(self) -> np.ndarray:
        """Orthonormal motions (m + a + c, r) of a corner without stiffness and damping."""
        if not self.moves:
            return np.zeros((self.inside.shape[1], 0))
        return self.wheel.free_motions(*self._moved)

    @property
    def air_mass(self) -> float:
        """Mass that the rim carries along besides the tire, kg."""
        return 0.0 if self.air is None else self.air.duct.density * self.air.duct.volume

    @property
    def rim_momentum(self) -> np.ndarray:
        """P (7, m + a) kg^1/2 of a corner."""
        return self.wheel.momentum(None if self.air is None else self.air.duct.momentum)

    @property
    def _moved(self) -> tuple[np.ndarray, float]:
        return self.rim_momentum, self.air_mass

    @property
    def _change(self) -> np.ndarray:
        return self.wheel.change(*self._moved)

    @property
    def own(self) -> int:
        """Number of coordinates of the tire itself, m."""
        return len(self.squares)

    @property
    def modes(self) -> int:
        """How many of the coordinates are modes; they come first."""
        return self.own - self.shapes

    def rotating(self, inertia: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Factors (m, m) of 2 Omega, Omega^2, Omega d_k. InputError for standing modes."""
        full = inertia == "full"
        gyroscopic = self.gyroscopic if full else self.body
        convective = self.convective if full else self.body_convective
        if gyroscopic is None or convective is None or self.body is None:
            what = "standing wheel" if self.gyroscopic is None else "wheel of another inertia"
            raise InputError(f"modes: these are of a {what} and have no rotating states")
        return gyroscopic, convective, self.body

    def first(self, count: int) -> Projection:
        """The projection on the first `count` coordinates only."""
        cut: dict[str, Any] = {
            "squares": self.squares[:count],
            "momentum": self.momentum[:, :count],
            "shapes": max(0, count - self.modes),
        }
        if self.parts is not None:
            cut["parts"] = np.ascontiguousarray(self.parts[:, :count, :count])
        for item in fields(self):
            values = getattr(self, item.name)
            if item.name not in cut and isinstance(values, np.ndarray):
                cut[item.name] = np.ascontiguousarray(values[(slice(count),) * values.ndim])
        if self.air is not None:
            cut["air"] = replace(self.air, coupling=self.air.coupling[:, :count])
        if self.corner is not None:
            cut["corner"] = self.corner.first(count)
        return replace(self, **cut)

    def on(self, turn: np.ndarray, modes: int) -> Projection:
        """The projection on orthonormal combinations `turn` (m, m') of the coordinates, whose first are `modes` of them.

        The stiffness of the finite elements must be diagonal on them, as it is on all that follows (extended).
        """
        whole: dict[str, Any] = {}
        for item in fields(self):
            values = getattr(self, item.name)
            if isinstance(values, np.ndarray) and values.shape == 2 * self.squares.shape:
                whole[item.name] = turn.T @ values @ turn
        for name in ("squares", "band_rise"):
            if (diagonal := getattr(self, name)) is not None:
                whole[name] = np.einsum("ij,i,ij->j", turn, diagonal, turn)
        if self.parts is not None:
            whole["parts"] = turn.T @ self.parts @ turn
        if self.air is not None:
            whole["air"] = replace(self.air, coupling=self.air.coupling @ turn)
        if self.corner is not None:
            whole["corner"] = self.corner.on(turn)
        shapes = turn.shape[1] - modes
        return replace(self, momentum=self.momentum @ turn, shapes=shapes, **whole)

    def containing(self, part: Projection, turn: np.ndarray) -> np.ndarray:
        """Its coordinates (m + a + c, m' + a + c) per coordinate of a `part` whose own are the combinations `turn` (m, m') of them."""
        beside = np.eye(self.carried.shape[1] - self.own)
        whole = linalg.block_diag(turn, beside)
        return np.linalg.solve(self._change, whole @ part._change) if self.moves else whole

    def among(self, wanted: np.ndarray) -> Projection:
        """The projection on the coordinates where `wanted` (m,) is true, without air and corner."""
        small: dict[str, Any] = {
            name: None if value is None else value[np.ix_(*[wanted] * value.ndim)]
            for name, value in vars(self).items()
            if name not in ("momentum", "parts", "shapes", "air", "corner")
        }
        if self.parts is not None:
            small["parts"] = self.parts[:, wanted][:, :, wanted]
        shapes = int(np.count_nonzero(wanted[self.modes :]))
        return Projection(momentum=self.momentum[:, wanted], shapes=shapes, **small)


@dataclass(frozen=True, kw_only=True)
class ModalBasis:
    """The standing modes in the form that all later steps use: M-orthonormal fields.

    `frequency` (m,) Hz; `shape` kg^-1/2 of the outer face (3 s, m + k), with six more rows for a
    free rim, where k is the number of static shapes that joined the m modes (modal.rotation_shapes);
    `projection`: the small matrices on these same fields. `modes`: the fields on all unknowns, if
    this process solved for them instead of reading a file; `names`: those of the modes, if
    they were given any; `column`: the air that joined the modes, if this process made it. The signs of eigenvectors, and
    the vectors of repeated frequencies, belong to one solution: never combine parts of two bases.
    """

    frequency: np.ndarray
    shape: np.ndarray
    projection: Projection
    modes: Modes | None = None
    names: ModeNames | None = None
    column: Column | None = None

    def first(self, count: int) -> ModalBasis:
        """The first `count` modes, or all if there are fewer, without any shapes."""
        count = min(count, len(self.frequency))
        return ModalBasis(
            frequency=self.frequency[:count],
            shape=self.shape[:, :count],
            projection=self.projection.first(count),
            modes=self.modes and self.modes.first(count),
            names=self.names and self.names.at(slice(count)),
            column=self.column,
        )


def same_fields(found: np.ndarray, known: np.ndarray) -> bool:
    """Whether shapes on the outer face (s, m) are of one solution: two differ in signs."""
    return found.shape == known.shape and np.allclose(found, known, 0, _SAME * np.abs(known).max())


def project(
    modes: Modes,
    rotation: Rotation | None,
    carried: np.ndarray,
    comm: MPI.Comm,
    known: Projection | None = None,
    compounds: Sequence[Compound] = (),
    doppler: bool = True,
) -> Projection:
    """Project the rotation matrices (fem.matrices.operators.Rotation, or None) and the momentum.

    `doppler`: also the convective matrix that only this inertia needs.

    `carried` (3, n) kg, own rows, and the `compounds` are those of fem.matrices.operators. `known`,
    the projection on the first of the modes, is reused: a basis that grows costs only the products
    with what joins it. Collective.
    """
    standing = Projection(
        squares=modes.squares,
        momentum=comm.allreduce(carried @ modes.vectors),
        shapes=len(modes.squares) - modes.count,
    )
    if compounds:
        standing = _of_compounds(standing, modes, compounds, comm, known)
    if rotation is None:
        return standing

    def reduced(name: str, sign: int) -> np.ndarray:
        old = None if known is None else getattr(known, name)
        return projected(comm, modes.vectors, getattr(rotation, name), sign, old)

    return replace(
        standing,
        gyroscopic=reduced("gyroscopic", -1),
        convective=reduced("convective", 1),
        body=reduced("body", -1),
        body_convective=reduced("body_convective", 1) if doppler else None,
    )


def _of_compounds(
    projection: Projection,
    modes: Modes,
    compounds: Sequence[Compound],
    comm: MPI.Comm,
    known: Projection | None,
) -> Projection:
    """The projection with losses, and with the rise where a modulus depends on frequency. Collective.

    With the compounds' part K_c of the stiffness between modes, moduli g_c and loss factors eta_c at their own
    frequencies omega_k,

        rise = sum_c (S_c K_c S_c - K_c),    S_c = diag sqrt g_c(omega_k),
        losses = sum_c H_c K_c H_c,          H_c = diag sqrt(eta_c g_c(omega_k) / omega_k).

    Both are positive semidefinite with K_c; on the diagonal they are those of fem.tire.material.own_moduli, and
    between modes of two frequencies the moduli lie between theirs. Static shapes respond in the band: their
    moduli are those in its middle.
    """
    squares, m = modes.squares, modes.count
    done = 0 if known is None else known.own
    stored = strain_energies(modes.vectors[:, done:], compounds, comm)
    kinds = [compound.kind for compound in compounds]
    before = projection.squares[:0] if known is None else known.own_squares[:m]
    own = np.concatenate([before, squares[done:m]])
    own[len(before) :] += own_moduli(squares[done:m], stored[:, : max(m - done, 0)], kinds)[0]
    middle = np.sqrt(own.max(initial=0.0)) / (4 * np.pi)
    in_band = own_moduli(squares[done:], stored, kinds, middle)[0]
    if known is not None and known.band_rise is not None:
        in_band = np.concatenate([known.band_rise, in_band])
    elif known is not None:
        in_band = np.concatenate([np.zeros(done), in_band])
    circular = np.sqrt(np.maximum(np.concatenate([own, (squares + in_band)[m:]]), 0.0))
    frequency = np.append(circular[:m] / (2 * np.pi), np.full(len(squares) - m, middle))
    rise, losses = (np.zeros((len(squares),) * 2) for _ in range(2))
    nothing, elastic, parts = np.zeros((done, done)), squares > 0, list[Array]()
    for compound in compounds:
        part = projected(comm, modes.vectors, compound.stiffness, 1, nothing)
        part *= np.outer(elastic, elastic)
        if compound.kind.spectrum != CONSTANT:
            parts.append(part)
        modulus = compound.kind.spectrum.modulus(frequency)
        loss = compound.kind.loss_factor * compound.kind.spectrum.loss_factor(frequency)
        lost = np.divide(loss * modulus, circular, out=np.zeros(len(modulus)), where=circular > 0)
        rise += part * (np.sqrt(np.outer(modulus, modulus)) - 1)
        losses += part * np.sqrt(np.outer(lost, lost))
    if known is not None:
        for number, part in enumerate(parts):
            part[:done, :done] = 0.0 if known.parts is None else known.parts[number]
        rise[:done, :done] = 0.0 if known.rise is None else known.rise
        losses[:done, :done] = 0.0 if known.losses is None else known.losses
    loses = any(kind.loss_factor for kind in kinds)
    projection = replace(projection, losses=losses if loses else None)
    if not parts:
        return projection
    return replace(projection, rise=rise, band_rise=in_band, parts=np.array(parts))
