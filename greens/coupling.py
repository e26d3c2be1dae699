"""Responses between probes from the wheel's full matrices and its modes, with attachment modes.

The static shapes under the probes' loads join the basis, with their inertia:

    R = K_Omega^-1 B,  joined to the modes as in modal.basis

(MacNeal 1971; Rubin, AIAA J. 13 (1975) 995). Exact at 0 Hz: the exact static response lies in the
basis or is added as a residual.

Many neighbouring points yield many shapes, most of which respond only statically. Those whose
static share is negligible at every point (`foremost`) and pseudo-modes far above the highest mode
(`dynamic`) are left out. The residual is then the exact flexibility less that of the states, so
what is left out keeps its static response and loses its inertia.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.cavity import Column
from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.compliance import (
    LoadedShapes,
    add_part,
    compliance,
    on_own_rows,
    receptance,
    rotating_damping,
    rotating_stiffness,
    statics,
)
from tireroad.fem.matrices.operators import Compound, Operators, RimMotion, Rotation
from tireroad.fem.model import SmallMotions
from tireroad.fem.tire.body import Body
from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.basis import (
    Array,
    Basis,
    Probes,
    modal_statics,
    regained,
)
from tireroad.greens.residuals import residual_of
from tireroad.greens.response import Response
from tireroad.modal.basis import Projection, extended, project, same_fields, with_air, with_corner
from tireroad.modal.damping import Damping, StrainEnergy, beyond, tail_growth
from tireroad.modal.rolling import decouple
from tireroad.modal.rotating import held_matrices
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.states import StateModes

# Of each point's own static flexibility: the most that the shapes left out may add up to. At
# 90 rad/s the receptance up to half the highest mode changes by 1.2e-3, with 1e-3 by 5e-3.
TOLERANCE = 1e-4
# Pseudo-modes and states this many times faster than the highest mode are static (`dynamic`): they
# would determine the automatic step. Receptances between 187 points up to half the highest mode
# change by 4e-4 at 50 rad/s and 4e-3 at 90; at 3 by 1e-3, at 2 by 4e-3 at 50 rad/s.
FASTEST = 4.0
FEW = 100  # pseudo-modes that are kept in any case, since they cost next to nothing


def fewest(probes: sparse.csr_matrix) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """(weights (p, t), loads (t, s)) with probes = weights loads and as few loads as possible.

    Unit loads on the unknowns that the probes (p, s) touch if these are fewer, as for points closer
    than nodes; otherwise the probes themselves.
    """
    touched = np.unique(probes.tocoo().col)
    if len(touched) >= probes.shape[0]:
        return sparse.identity(probes.shape[0], format="csr"), probes
    unit = sparse.identity(probes.shape[1], format="csr")[touched]
    return probes[:, touched].tocsr(), unit


def foremost(missing: np.ndarray, flexibility: np.ndarray) -> np.ndarray:
    """Combinations of the loads, columns (p, k), whose static shapes join the basis.

    `missing` (p, p) m/N is what the modes lack of the `flexibility` (p,) m/N of each point. The
    smallest eigenvectors of its symmetric part are left out as long as at no point they add up to
    more than `TOLERANCE` of its own flexibility; by Cauchy-Schwarz the same then holds between any
    two.
    """
    sizes, vectors = np.linalg.eigh((missing + missing.T) / 2)
    order = np.argsort(np.abs(sizes), kind="stable")
    gone = np.cumsum(np.abs(sizes[order]) * vectors[:, order] ** 2, axis=1)
    fits = (gone <= TOLERANCE * flexibility[:, None]).all(axis=0)
    return vectors[:, order[np.argmin(fits) if not fits.all() else len(order) :]]


def dynamic(projection: Projection, speed: float, known: int) -> np.ndarray:
    """Mask (m,) of coordinates that stay: the first `known`, `FEW` pseudo-modes, dynamic ones.

    Relative to its static response, a coordinate's response at w has the dynamic part
    (w^2 + 2 w Omega n) / (omega_k^2 - Omega^2 n^2),  n = |S_kk|^1/2: inertia and convection. It
    counts as static if at half the highest mode this is no more than for a standing wheel at
    `FASTEST` times the highest mode. One whose states would be faster than that is static as a
    coordinate, not as a state: what is left is a problem of second order with an energy of its own.
    """
    squares = projection.own_squares
    highest = np.sqrt(squares[projection.modes - 1])
    turning = np.zeros(len(squares))
    if projection.convective is not None:
        turning = abs(speed) * np.sqrt(np.maximum(-np.diag(projection.convective), 0.0))
    moving = highest**2 + 4 * highest * turning
    stays = squares - turning**2 <= FASTEST**2 * moving
    stays[: known + FEW] = True
    stays[known:] &= (np.sqrt(squares) + turning <= FASTEST * highest)[known:]
    return stays


def with_left_out(response: Response, whole: Array) -> Response:
    """The response with what its states lack of the `whole` static rows (Basis.felt)."""
    return replace(response, left_out=whole - response.static_moment())


def with_static_correction(
    basis: Basis,
    turning: Turning,
    outputs: Probes,
    loads: Probes,
    flexibility: Array,
    beside: Array,
) -> Response:
    """The response (r, k) whose static limit is that of the full matrices with the rim held.

    `flexibility` (r, k) m/N is their static response and `beside` what it carries (Basis.beside):
    the momentum (3, k), or with hub moments (12, k). For a wheel that moves, the states respond as
    they are, and are completed by what the states of the held rim lack.
    """
    hub = basis.of_hub(outputs)
    if hub.nnz:
        flexibility = flexibility - hub @ beside[3:6]
    if not basis.projection.moves:
        if hub.nnz:
            flexibility = flexibility + hub @ basis.loaded(loads)
        response = basis.couple(outputs, loads, flexibility)
        return with_left_out(response, basis.felt(beside[:3]))
    held = basis.held
    pencil = held_matrices(basis.projection, turning.speed, turning.damping, turning.inertia)
    known = modal_statics(pencil[1], held.seen(outputs), held.seen(loads), held.beside(hub))
    missing = flexibility - known.compliance
    if hub.nnz:
        missing += hub @ known.momentum[3:6]
    response = basis.couple(outputs, loads)
    return replace(
        response,
        residual=response.residual + missing,
        left_out=beside[:3] - known.momentum[:3],
    )


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """The full matrices of a rolling tire, or a standing one if `rotation` is None. `beyond`
    (gamma1 1/s, gamma2 s) damps motions outside the modes, and the full matrices: it is given if
    `damping` (modal.damping) is by strain energy, which has no full matrices. `growth`, likewise, of
    the stiffness of these motions over that of the operators. `corner` adds a
    wheel, held or not, to a projection; `rim`: motions of a held rim, for hub moments; `pressed`:
    the body at its static state, None where no road presses on it. Properties are collective at first use."""

    operators: Operators
    rotation: Rotation | None
    speed: float
    damping: Damping
    inertia: str
    air: Column | None = None
    beyond: tuple[float, float] | None = None
    growth: float | None = None
    corner: Callable[[Projection, Modes], Projection] | None = None
    rim: Callable[[], RimMotion | None] | None = None
    pressed: Callable[[], Body] | None = None

    @cached_property
    def rotating_stiffness(self) -> PETSc.Mat:
        """K_Omega of motions beyond the modes."""
        stiffness = rotating_stiffness(*self._given)
        if self.growth is not None:
            add_part(stiffness, self.growth - 1, self.operators.stiffness)
        return stiffness

    @cached_property
    def rotating_damping(self) -> PETSc.Mat:
        """D + 2 Omega G."""
        return rotating_damping(*self._given)

    @property
    def _given(self) -> tuple:
        return self.operators, self.rotation, self.speed, self._uniform, self.inertia

    @property
    def against_wheel(self) -> float:
        """Mass-proportional damping, 1/s, against the wheel; none by strain energy."""
        return 0.0 if self.beyond is not None else self._uniform[0]

    @property
    def _uniform(self) -> tuple[float, float]:
        """The damping of the full matrices."""
        if self.beyond is not None:
            return self.beyond
        assert not isinstance(self.damping, StrainEnergy), "`beyond` is given then"
        return self.damping

    @cached_property
    def compounds(self) -> list[Compound]:
        """The compounds of the tire."""
        return self.operators.compounds()

    @property
    def _apart(self) -> bool:
        """Whether the modes are damped or stiffened otherwise than the full matrices."""
        return self.beyond is not None or self.growth is not None

    def _stiffnesses(self, projection: Projection) -> tuple[Array, Array]:
        """K~ with the rim held, rolling damping in it: of the modes, and of the full matrices."""
        _, true = held_matrices(projection, self.speed, self.damping, self.inertia)
        full = projection.as_elements(self.growth or 1.0)
        _, uniform = held_matrices(full, self.speed, self._uniform, self.inertia)
        return true, uniform

    def respond(
        self,
        basis: Basis,
        modes: Modes | None,
        outputs: Probes,
        loads: Probes,
        option: str,
    ) -> Response:
        """Response with the residual `option`. Collective.

        `modes` on all unknowns, for attachment modes only, must be the solution that `basis` projects:
        another one has other signs and vectors of repeated frequencies. InputError otherwise."""
        kind = residual_of(option)
        if kind.static:
            whole = self._with_statics(basis, outputs, loads)
            moved = outputs.shape[0] - np.count_nonzero(basis.of_hub(outputs).getnnz(axis=1))
            return replace(whole, pulse=moved if kind.pulse else 0)
        assert modes is not None, "attachment modes need the modes on all unknowns"
        return self.respond_attached(basis, modes, outputs, loads)[0]

    def respond_attached(
        self,
        basis: Basis,
        modes: Modes,
        outputs: Probes,
        loads: Probes,
    ) -> tuple[Response, Basis]:
        """`respond` with attachment modes, and the basis of modes with them whose states it has.
        Collective."""
        probes = together(outputs, loads)
        whole, grown = self._attached(basis, modes, probes)
        return between(whole, outputs, loads), grown

    def _beside(self, hub: Probes) -> Array:
        """Own rows (3, n) of momentum; with A_0 to A_2 of greens.response (12, n) if `hub` is read."""
        carried = self.operators.carried
        if not hub.nnz:
            return carried
        rim = self.rim() if self.rim else None
        assert rim is not None, "moments are read of a rim whose motions are known"
        return np.vstack([carried, *rim.moments(self.speed, self.inertia)])

    def _with_statics(self, basis: Basis, outputs: Probes, loads: Probes) -> Response:
        """The states, and the exact static flexibility of what they lack. Collective."""
        arguments = self.operators, self.rotating_stiffness, outputs, loads
        answers = compliance(*arguments, self.air, beside=self._beside(basis.of_hub(outputs)))
        flexibility, beside = answers[: outputs.shape[0]], answers[outputs.shape[0] :]
        if self._apart:
            lacking = regained(basis.held, *self._stiffnesses(basis.projection), outputs, loads)
            flexibility, beside = flexibility + lacking.compliance, beside + lacking.momentum
        return self._completed(basis, outputs, loads, flexibility, beside)

    def respond_inside(
        self,
        basis: Basis,
        full: Basis,
        outputs: Probes,
        loads: Probes,
        read: sparse.csr_matrix,
        driven: sparse.csr_matrix,
        shapes: LoadedShapes | None = None,
    ) -> Response:
        """Response of probes of which some lie inside the tire, with the exact static flexibility of what the states lack.

        The shapes of `basis` have further rows for these, and those of `full` for what they are in the full matrices;
        `read` (r, n) and `driven` (n, k) are the same `outputs` and `loads` there, on own unknowns. Those inside are relative
        to a wheel that moves, and loads inside have no resultant on it. `shapes`: `loaded_shapes`, by default made and
        destroyed here. Collective.
        """
        rows = sparse.csr_matrix(self._beside(basis.of_hub(outputs)))
        taken = shapes or self.loaded_shapes()
        answers = taken.readings(sparse.vstack([read, rows], format="csr"), driven)
        if shapes is None:
            taken.destroy()
        flexibility, beside = np.split(answers, [outputs.shape[0]])
        if self._apart:
            stiffnesses = self._stiffnesses(basis.projection)
            lacking = regained(basis.held, *stiffnesses, outputs, loads, full.held)
            flexibility, beside = flexibility + lacking.compliance, beside + lacking.momentum
        return self._completed(basis, outputs, loads, flexibility, beside)

    def loaded_shapes(self) -> LoadedShapes:
        """The shapes of the full matrices under constant loads, to be destroyed by the caller. Collective."""
        return LoadedShapes(self.operators, self.rotating_stiffness, self.air)

    def beyond_modes(self, basis: Basis, modes: Modes, loads: Array, shapes: LoadedShapes) -> Array:
        """Motions (n, p) m that constant loads, own rows (n, p) N, cause beside those of the modes,

            K_Omega^-1 b - Phi K~^-1 Phi^T b,

        both of the full matrices, relative to the wheel. `modes` on all unknowns, whose projection `basis` is; `shapes`:
        `loaded_shapes`. Collective.
        """
        found = shapes.whole(loads)
        _, uniform = self._stiffnesses(basis.held.projection)
        m = modes.vectors.shape[1]
        pushed = np.zeros((len(uniform), loads.shape[1]))
        pushed[:m] = summed(self.operators.body.comm, modes.vectors.T @ loads)
        return found - modes.vectors @ np.linalg.solve(uniform, pushed)[:m]

    def _completed(
        self, basis: Basis, outputs: Probes, loads: Probes, flexibility: Array, beside: Array
    ) -> Response:
        """The states with the static correction for truncated modes."""
        made = with_static_correction(basis, self.turning, outputs, loads, flexibility, beside)
        return made if self.air is None else replace(made, left_out=None)

    def _attached(self, basis: Basis, modes: Modes, probes: Probes) -> tuple[Response, Basis]:
        """Response of the modes and the attachment modes of all probes, and their basis. Collective."""
        self._check_same(basis, modes)
        if self._drifts:
            drifting = self.standing_attachments(modes, probes)[0]
            return drifting.couple(probes, probes), drifting
        weights, loads = fewest(probes)
        loads = on_own_rows(self.operators, loads)
        rows = sparse.csr_matrix(self._beside(basis.of_hub(probes)))
        shapes = LoadedShapes(self.operators, self.rotating_stiffness, self.air)
        answers = shapes.readings(sparse.vstack([loads.T, rows], format="csr"), loads)
        flexibility = weights @ (weights @ answers[: loads.shape[1]].T).T
        beside = (weights @ answers[loads.shape[1] :].T).T
        # Few shapes join the basis: solving for them again is cheaper than storing all.
        columns = shapes.whole(loads @ (weights.T @ self._foremost(basis, probes, flexibility)))
        shapes.destroy()
        grown_modes = extended(modes, columns, self.operators)
        del columns  # used up: what follows needs the memory
        grown, _ = self._grown(grown_modes, basis.projection)
        if self._apart:
            lacking = regained(grown.held, *self._stiffnesses(grown.projection), probes, probes)
            flexibility, beside = flexibility + lacking.compliance, beside + lacking.momentum
        return self._completed(grown, probes, probes, flexibility, beside), grown

    def _foremost(self, basis: Basis, probes: Probes, flexibility: Array) -> Array:
        """Load combinations (p, k) whose shapes join the basis, among probes that move anything."""
        moving = np.flatnonzero(np.diag(flexibility))
        some, own = probes[moving], flexibility[np.ix_(moving, moving)]
        missing = self._completed(basis, some, some, own, np.zeros((3, len(moving)))).residual
        chosen = foremost(missing, np.abs(np.diag(own)))
        out = np.zeros((len(flexibility), chosen.shape[1]))
        out[moving] = chosen
        return out

    def _check_same(self, basis: Basis, modes: Modes) -> None:
        """InputError if these modes are not those of the basis. Collective."""
        if not same_fields(self.operators.trace(modes.vectors), basis.shape):
            raise InputError(
                "attachment modes: the modes on all unknowns are not those that the basis shows; take "
                "both from one solution (modal.standing.with_fields)"
            )

    @property
    def _drifts(self) -> bool:
        """Whether a rolling tire has no static response: with a free rim K_Omega is singular."""
        return self.rotation is not None and self.operators.unknowns.rim is not None

    def standing_attachments(self, modes: Modes, probes: Probes) -> tuple[Basis, Array]:
        """Modes with static shapes of K (inertia relief if free), and own fields. Collective."""
        operators = self.operators
        columns = statics(operators, operators.stiffness, on_own_rows(operators, probes))
        return self._grown(extended(modes, columns, operators))

    def _grown(self, grown: Modes, known: Projection | None = None) -> tuple[Basis, Array]:
        """The basis of modes with attachment modes, and its fields; `known`: on the first of them,
        whose modes are reused. Of the shapes that join, only dynamic ones stay. Collective."""
        operators, comm = self.operators, self.operators.body.comm
        compounds = self.compounds if self._apart else ()
        same = known and known.first(known.modes)
        projection = project(grown, self.rotation, operators.carried, comm, same, compounds)
        if known is not None:
            stays = dynamic(projection, self.speed, known.own)
            if not stays.all():
                projection, grown = projection.among(stays), grown.among(stays)
        projection = self.with_air(projection, grown)
        projection = self.corner(projection, grown) if self.corner else projection
        states, shape = self.decouple(projection, comm), operators.trace(grown.vectors)
        basis = Basis(shape=shape, projection=projection, states=states)
        return basis.at(self.turning), grown.vectors

    @property
    def turning(self) -> Turning:
        """The rotation of the wheel."""
        return Turning(speed=self.speed, damping=self.damping, inertia=self.inertia)

    def with_air(self, projection: Projection, modes: Modes) -> Projection:
        """The projection on the modes (all rows), joined by the air, if any. Collective."""
        return with_air(projection, modes, self.air)

    def decouple(self, projection: Projection, comm: MPI.Comm) -> StateModes:
        """The second eigenproblem, or the closed form of a standing tire. Collective."""
        return decouple(projection, self.turning, comm)

    def receptance(self, outputs: Probes, loads: Probes, frequency: np.ndarray) -> np.ndarray:
        """H (f, r, k) m/N of the full matrices, at the frequencies in Hz. Collective.

        With losses by strain energy, or moduli that depend on frequency, those of a standing tire with
        complex moduli at each frequency; there is no such problem for one that rolls, whose frequencies
        in the rubber are others.
        """
        arguments = outputs, loads
        if not self._apart:
            full = self.rotating_stiffness, self.rotating_damping
            return receptance(self.operators, *full, *arguments, frequency, air=self.air)
        assert not self.speed, "the scene's rules refuse it"
        parts = [
            receptance(self.operators, *self._complex(f), *arguments, np.array([f]), air=self.air)
            for f in frequency
        ]
        return np.concatenate(parts)

    def _complex(self, frequency: float) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Real part of the stiffness at a frequency (Hz), imaginary part over omega. Collective."""
        stiffness = self.operators.stiffness.copy()
        uniform = (0.0, 0.0) if self.beyond is not None else self._uniform
        lost = rotating_damping(self.operators, None, 0.0, uniform)
        for compound in self.compounds:
            modulus = compound.kind.modulus(frequency)
            add_part(stiffness, modulus.real - 1, compound.stiffness)
            if self.beyond is not None:
                add_part(lost, modulus.imag / (2 * np.pi * frequency), compound.stiffness)
        return stiffness, lost


def together(outputs: Probes, loads: Probes) -> Probes:
    """Outputs and loads as one set of probes, which a response is symmetric in."""
    return loads if outputs is loads else sparse.vstack([outputs, loads], format="csr")


def between(whole: Response, outputs: Probes, loads: Probes) -> Response:
    """The response between `outputs` and `loads` of that of both together."""
    r = outputs.shape[0]
    return whole if outputs is loads else whole.between(slice(r), slice(r, None))


def wheel_of(
    motions: SmallMotions,
    turning: Turning,
    air: Column | None = None,
    projection: Projection | None = None,
    axle: Axle | None = None,
) -> Wheel:
    """The full matrices of a tire at its static state as the wheel rotates, with the `air` in it.

    `projection` on the modes: for damping by strain energy, which has no full matrices, and for moduli
    that depend on frequency.
    `axle`: the suspension of a wheel that moves; the full matrices are always those of a held rim.
    InputError if the static state was found for another speed or inertia, or the projection is
    missing. Collective.
    """
    shape, tail, growth = motions.static.rolling, None, None
    if shape.speed and (shape.speed, shape.inertia) != (turning.speed, turning.inertia):
        raise InputError(
            f"the static state rolls at {shape.speed:g} rad/s with {shape.inertia} inertia, its small motions at "
            f"{turning.speed:g} rad/s with {turning.inertia}: take the same for both, or a static state at rest"
        )
    if isinstance(turning.damping, StrainEnergy):
        if projection is None:
            raise InputError("damping by strain energy needs the modes: give their projection")
        tail = beyond(turning.damping, projection)
    if projection is not None and projection.rise is not None:
        # Inertia relief of a free rim is that of the operators.
        growth = tail_growth(projection) if motions.operators.unknowns.rim is None else 1.0
    rotation = motions.rotation if turning.speed else None

    def rim() -> RimMotion | None:
        return motions.rim_motion(turning.speed != 0)

    def corner(projection: Projection, modes: Modes) -> Projection:
        comm, places = motions.body.comm, motions.static.positions
        return with_corner(projection, modes, axle, rim(), places, comm)

    return Wheel(
        operators=motions.operators,
        rotation=rotation,
        speed=turning.speed,
        damping=turning.damping,
        inertia=turning.inertia,
        air=air,
        beyond=tail,
        growth=growth,
        corner=corner,
        rim=rim,
        pressed=(lambda: motions.body) if motions.static.force.any() else None,
    )
