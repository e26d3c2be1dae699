"""The first eigenproblem: K Phi = M Phi Lambda, Phi^T M Phi = I, with none of the lowest missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.circulant import Ring, Wave, repeated
from tireroad.modal.fields import CHUNK, collect, everywhere, gram, multiply, scaled_by
from tireroad.modal.lanczos import Interval
from tireroad.modal.spectrum import ZERO, Bottom, Slice, Spectrum
from tireroad.modal.symmetry import Sites, sectors

RESIDUAL_TOLERANCE = 1e-8  # relative, per eigenpair
MOST = 1e-6  # where rounding alone is more than the tolerance
ORTHONORMALITY_TOLERANCE = 1e-10
# Vectors of neighbouring slices are orthogonal to about 1e-11: then worth a product.
_REPAIR = 1e-12


@dataclass(frozen=True)
class Modes:
    """The lowest m modes. `squares` omega^2 (m,) 1/s2 ascending; `vectors` this process's rows (n, m)
    of the mass-normalised shapes, kg^-1/2; `residual` (m,) ||K phi - lambda M phi|| / ||lambda M phi||;
    `inertia_count` eigenvalues below `counted_below` (1/s2) by Sylvester's law, equal to the number
    found there; `rigid` modes without stiffness, whose square is 0, among them; `sectors` sizes of the
    independent problems that mirror planes or wave numbers split it into, `slices` intervals solved;
    `segments` equal ones around the axle, 1 where there are none that hold the matrix.
    """

    squares: np.ndarray
    vectors: np.ndarray
    residual: np.ndarray
    orthonormality: float
    inertia_count: int
    counted_below: float
    rigid: int
    sectors: tuple[int, ...]
    slices: int
    segments: int = 1

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (m,), Hz; 0 for rigid modes."""
        return np.sqrt(np.maximum(self.squares, 0.0)) / (2 * np.pi)


def solve(
    stiffness: PETSc.Mat,
    mass: np.ndarray,
    count: int | None = None,
    *,
    up_to: float = np.inf,
    sites: Sites | None = None,
    waves: bool = True,
) -> Modes:
    """The `count` lowest modes, or all below `up_to` (Hz), of a stiffness (n, n) in N/m and a diagonal
    mass (own rows) in kg; at least one of the two is given.

    The diagonal mass turns the pencil into the standard problem of A = M^-1/2 K M^-1/2. With the
    `sites` of its own unknowns, equal segments split it by wave number into small dense problems
    (modal.circulant), or else mirror planes (modal.symmetry) into parts that are sliced by inertia
    (modal.spectrum) and solved by block Lanczos (modal.lanczos); `waves` False: these always. Every
    process holds a copy of A.
    Raises ConvergenceError when a mode is missing, inaccurate or unstable. Collective.
    """
    comm = stiffness.comm.tompi4py()
    size = stiffness.getSize()[0]
    scaled = scaled_by(stiffness, mass)
    whole = everywhere(scaled)
    wanted = min(count or size, size), (2 * np.pi * up_to) ** 2
    bases, modes = [sparse.identity(size, format="csr")], None
    if sites is not None:
        all_sites = sites.everywhere(comm)
        ring = repeated(whole, all_sites) if waves else None
        if ring is not None:
            modes = _by_waves(scaled, whole, ring, mass, *wanted)
        if modes is not None and modes.residual.max(initial=0.0) <= RESIDUAL_TOLERANCE:
            scaled.destroy()
            return _checked(modes, whole)
        bases = sectors(whole, all_sites)
    modes = _solve(scaled, whole, bases, mass, *wanted)
    if len(bases) > 1 and modes.residual.max(initial=0.0) > RESIDUAL_TOLERANCE:
        # Mirror symmetric to the tolerance, and yet too coarsely for the lowest modes: do not split.
        whole_basis = [sparse.identity(size, format="csr")]
        modes = _solve(scaled, whole, whole_basis, mass, len(modes.squares), np.inf)
    scaled.destroy()
    return _checked(modes, whole)


def _solve(scaled, whole, bases, mass, count: int, limit: float) -> Modes:
    """By slices of the independent problems that the isometries `bases` leave. Collective."""
    comm = scaled.comm.tompi4py()
    spectrum = Spectrum(comm, [(basis.T @ whole @ basis).tocsr() for basis in bases])
    bottom = spectrum.bottom()
    _check_stable(bottom)
    boundaries = spectrum.boundaries(bottom, count, limit)
    proof = _Proof(bottom, boundaries[-1][0], int(boundaries[-1][1].sum()))
    found = spectrum.slices(boundaries)
    return _together(scaled, bases, mass, count, found, proof)


@dataclass(frozen=True)
class _Proof:
    """What inertia says: next to zero, and how many eigenvalues lie below `top`."""

    bottom: Bottom
    top: float
    inertia: int


def _by_waves(scaled, whole, ring: Ring, mass, count: int, limit: float) -> Modes | None:
    """By the wave numbers of equal segments; None when inertia does not bear them out. Collective."""
    comm = scaled.comm.tompi4py()
    spectrum = Spectrum(comm, [whole])
    values = spectrum.shared(len(ring.waves), ring.values)
    twice = [np.repeat(own, 1 if ring.single(n) else 2) for n, own in enumerate(values)]
    every = np.sort(np.concatenate(twice))
    zero = ZERO * spectrum.bound
    bottom = Bottom(zero, int((every < -zero).sum()), every[: 8 + int((every < -zero).sum())])
    _check_stable(bottom)
    inside = min(count, int(np.searchsorted(every, limit)))
    top = min(_just_above(every, inside, spectrum.bound), limit) if inside else limit
    proof = _Proof(bottom, top, int(spectrum.below(top).sum()))
    if proof.inertia != np.searchsorted(every, top):
        return None
    found = []
    for n, own in enumerate(twice):
        wanted = int(np.searchsorted(own, top))
        owner = n % comm.size
        vectors = None
        if wanted and owner == comm.rank:
            vectors = ring.vectors(n, wanted if ring.single(n) else wanted // 2)
        found.append(Slice(n, Interval(-zero, top, wanted), owner, own[:wanted], vectors))
    found = [one for one in found if one.interval.count]
    bases = [Wave(ring, n) for n in ring.waves]
    return _together(scaled, bases, mass, count, found, proof, ring.segments)


def _just_above(every: np.ndarray, count: int, bound: float) -> float:
    """A value in the gap after the lowest `count`, pairs not parted."""
    beyond = every[count:][every[count:] > every[count - 1] * (1 + 1e-6)]
    return (every[count - 1] + beyond[0]) / 2 if len(beyond) else bound


def _together(
    scaled, bases, mass, count: int, found: list[Slice], proof: _Proof, segments: int = 1
) -> Modes:
    """The lowest `count` modes of all slices, orthonormal, with their residuals. Collective."""
    comm, bottom = scaled.comm.tompi4py(), proof.bottom
    if proof.inertia == 0:
        raise ConvergenceError(
            f"modes: the tire has no mode below {np.sqrt(proof.top) / (2 * np.pi):.4g} Hz. Raise "
            "modal.up_to."
        )
    values = np.concatenate([one.values for one in found])
    order = np.argsort(values, kind="stable")[:count]
    vectors = collect(scaled, bases, found, order)
    matrix = np.concatenate([np.full(len(one.values), one.matrix) for one in found])[order]
    defect = _orthonormalise(comm, vectors, matrix)
    squares = values[order]
    rigid = int((squares <= bottom.zero).sum())
    squares[:rigid] = 0.0
    # A rigid mode is measured by the first flexible one.
    scale = squares[min(rigid, len(squares) - 1)]
    residual = _residuals(scaled, squares, vectors, max(scale, bottom.zero))
    vectors /= np.sqrt(mass)[:, None]
    parts = tuple(basis.shape[1] for basis in bases)
    return Modes(
        squares,
        vectors,
        residual,
        defect,
        proof.inertia,
        proof.top,
        rigid,
        parts,
        len(found),
        segments,
    )


def _checked(modes: Modes, matrix: sparse.csr_matrix) -> Modes:
    worst = float(modes.residual.max())
    # Rounding of A phi (measured: 0.05 to 1 times this): near incompressibility it alone is 1e-8 of the lowest eigenvalue.
    soft = modes.squares[min(modes.rigid, len(modes.squares) - 1)]
    stiff = abs(matrix).sum(axis=1).max()
    allowed = max(RESIDUAL_TOLERANCE, min(np.finfo(float).eps * stiff / soft, MOST) if soft else 0)
    if not worst <= allowed:
        raise ConvergenceError(
            f"modes: worst relative residual {worst:.1e}, allowed {allowed:.0e}: the lowest "
            "mode is too soft against the stiffest element for the number of digits. Use elements of "
            "more equal size."
        )
    if not modes.orthonormality <= ORTHONORMALITY_TOLERANCE:
        raise ConvergenceError(
            f"modes: orthonormality is lost ({modes.orthonormality:.1e}, allowed "
            f"{ORTHONORMALITY_TOLERANCE:.0e}). Use elements of more equal size."
        )
    return modes


def _check_stable(bottom: Bottom) -> None:
    if bottom.negative:
        growth = np.sqrt(-min(bottom.near[0], -bottom.zero))
        raise ConvergenceError(
            f"modes: the tangent stiffness has {bottom.negative} negative eigenvalue(s) (growth rate "
            f"about {growth:.3g} 1/s): the state is unstable once the road is replaced by its "
            "forces: the tire buckles, or topples if its rim is free. Lower the load, raise the "
            "inflation or stiffen the wall; let a free rim stand on no road."
        )


def _orthonormalise(comm: MPI.Comm, vectors: np.ndarray, matrix: np.ndarray) -> float:
    """Worst entry of V^T V - 1 after a correction where slices meet, in place. Collective.

    One Newton-Schulz step V (3 - V^T V) / 2 squares the defect and turns no vector further than it.
    Vectors of different sectors are orthogonal by their making.
    """
    worst = 0.0
    for one in np.unique(matrix):
        columns = np.flatnonzero(matrix == one)
        part = vectors[:, columns]
        defect = gram(comm, part, part) - np.eye(len(columns))
        if np.abs(defect).max() > _REPAIR:
            # What is rounding already stays: mixed in, it would carry stiff modes into soft ones.
            part -= part @ (np.where(np.abs(defect) > _REPAIR / 10, defect, 0.0) / 2)
            vectors[:, columns] = part
            defect = gram(comm, part, part) - np.eye(len(columns))
        worst = max(worst, float(np.abs(defect).max()))
    return worst


def _residuals(
    scaled: PETSc.Mat, values: np.ndarray, vectors: np.ndarray, least: float
) -> np.ndarray:
    squares = np.empty(len(values))
    for start in range(0, len(values), CHUNK):
        some = slice(start, start + CHUNK)
        defect = multiply(scaled, vectors[:, some]) - vectors[:, some] * values[some]
        squares[some] = (defect**2).sum(axis=0)
    squares = scaled.comm.tompi4py().allreduce(squares)
    return np.sqrt(squares) / np.maximum(values, least)
