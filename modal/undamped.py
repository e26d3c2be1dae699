"""The first eigenproblem: K Phi = M Phi Lambda, Phi^T M Phi = I, with none of the lowest missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fem.errors import ConvergenceError
from modal.spectrum import Bottom, Slice, Spectrum
from modal.symmetry import Sites, sectors

RESIDUAL_TOLERANCE = 1e-8  # relative, per eigenpair
ORTHONORMALITY_TOLERANCE = 1e-10
_REPAIR = (
    1e-12  # vectors of neighbouring slices are orthogonal to about 1e-11: then worth a product
)
_CHUNK = 64  # columns a matrix product: no second copy of all vectors


@dataclass(frozen=True)
class Modes:
    """The lowest m modes. `squares` omega^2 (m,) 1/s2 ascending; `vectors` this process's rows (n, m)
    of the mass-normalised shapes, kg^-1/2; `residual` (m,) ||K phi - lambda M phi|| / ||lambda M phi||;
    `inertia_count` eigenvalues below `counted_below` (1/s2) by Sylvester's law, equal to the number
    found there; `rigid` modes without stiffness, whose square is 0, among them; `sectors` sizes of the independent problems
    that mirror planes split it into, `slices` intervals solved.
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
) -> Modes:
    """The `count` lowest modes, or all below `up_to` (Hz), of a stiffness (n, n) in N/m and a diagonal
    mass (own rows) in kg; at least one of the two is given.

    The diagonal mass turns the pencil into the standard problem of A = M^-1/2 K M^-1/2. With the
    `sites` of its own unknowns, mirror planes that A has split it (modal.symmetry); each part
    is sliced by inertia (modal.spectrum) and solved by block Lanczos (modal.lanczos). Every process
    holds a copy of A. Raises ConvergenceError when a mode is missing, inaccurate or unstable.
    Collective.
    """
    comm = stiffness.comm.tompi4py()
    size = stiffness.getSize()[0]
    scaled = _scaled(stiffness, mass)
    whole = _everywhere(scaled)
    bases = [sparse.identity(size, format="csr")]
    if sites is not None:
        bases = sectors(whole, sites.everywhere(comm))
    modes = _solve(scaled, whole, bases, mass, min(count or size, size), (2 * np.pi * up_to) ** 2)
    if len(bases) > 1 and modes.residual.max(initial=0.0) > RESIDUAL_TOLERANCE:
        # Mirror symmetric to the tolerance, and yet too coarsely for the lowest modes: do not split.
        whole_basis = [sparse.identity(size, format="csr")]
        modes = _solve(scaled, whole, whole_basis, mass, len(modes.squares), np.inf)
    scaled.destroy()
    return _checked(modes)


def _solve(scaled, whole, bases, mass, count: int, limit: float) -> Modes:
    comm = scaled.comm.tompi4py()
    spectrum = Spectrum(comm, [(basis.T @ whole @ basis).tocsr() for basis in bases])
    bottom = spectrum.bottom()
    _check_stable(bottom)
    boundaries = spectrum.boundaries(bottom, count, limit)
    top, inertia = boundaries[-1][0], int(boundaries[-1][1].sum())
    if inertia == 0:
        raise ConvergenceError(
            f"modes: the tire has no mode below {np.sqrt(top) / (2 * np.pi):.4g} Hz. Raise modal.up_to."
        )
    found = spectrum.slices(boundaries)
    values = np.concatenate([one.values for one in found])
    order = np.argsort(values, kind="stable")[:count]
    vectors = _collect(scaled, bases, found, order)
    matrix = np.concatenate([np.full(len(one.values), one.matrix) for one in found])[order]
    defect = _orthonormalise(comm, vectors, matrix)
    squares = values[order]
    rigid = int((squares <= bottom.zero).sum())
    squares[:rigid] = 0.0
    scale = squares[
        min(rigid, len(squares) - 1)
    ]  # a rigid mode is measured by the first flexible one
    residual = _residuals(scaled, squares, vectors, max(scale, bottom.zero))
    vectors /= np.sqrt(mass)[:, None]
    parts = tuple(basis.shape[1] for basis in bases)
    return Modes(squares, vectors, residual, defect, inertia, top, rigid, parts, len(found))


def _checked(modes: Modes) -> Modes:
    worst = float(modes.residual.max())
    if not worst <= RESIDUAL_TOLERANCE:
        raise ConvergenceError(
            f"modes: worst relative residual {worst:.1e}, allowed {RESIDUAL_TOLERANCE:.0e}: the lowest "
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


def _scaled(stiffness: PETSc.Mat, mass: np.ndarray) -> PETSc.Mat:
    scaled = stiffness.copy()
    roots = scaled.createVecLeft()
    roots.array[:] = 1 / np.sqrt(mass)
    scaled.diagonalScale(roots, roots)
    scaled.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    roots.destroy()
    return scaled


def _everywhere(matrix: PETSc.Mat) -> sparse.csr_matrix:
    """The whole matrix on every process. Collective."""
    size = matrix.getSize()[0]
    every = PETSc.IS().createStride(size, first=0, step=1, comm=PETSc.COMM_SELF)
    (whole,) = matrix.createSubMatrices(every, every)
    rows, columns, values = whole.getValuesCSR()
    every.destroy()
    whole.destroy()
    return sparse.csr_matrix((values, columns, rows), (size, size))


def _collect(matrix: PETSc.Mat, bases, found: list[Slice], order: np.ndarray) -> np.ndarray:
    """This process's rows of the vectors in the given order, each slice sent by its owner. Collective."""
    comm = matrix.comm.tompi4py()
    ranges = matrix.getOwnershipRanges()
    column = np.full(sum(len(one.values) for one in found), -1)
    column[order] = np.arange(len(order))
    vectors = np.empty((ranges[comm.rank + 1] - ranges[comm.rank], len(order)), order="F")
    start = 0
    for one in found:
        place = column[start : start + len(one.values)]
        start += len(one.values)
        wanted = place >= 0
        if not wanted.any():
            continue
        parts = None
        if one.owner == comm.rank:
            full = bases[one.matrix] @ one.vectors[:, wanted]
            parts = [full[low:high] for low, high in zip(ranges, ranges[1:], strict=False)]
        vectors[:, place[wanted]] = comm.scatter(parts, root=one.owner)
    return vectors


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
    for start in range(0, len(values), _CHUNK):
        some = slice(start, start + _CHUNK)
        defect = multiply(scaled, vectors[:, some]) - vectors[:, some] * values[some]
        squares[some] = (defect**2).sum(axis=0)
    squares = scaled.comm.tompi4py().allreduce(squares)
    return np.sqrt(squares) / np.maximum(values, least)


def multiply(matrix: PETSc.Mat, vectors: np.ndarray) -> np.ndarray:
    """This process's rows of matrix @ vectors, vectors given by rows (n, m). Collective."""
    rows, columns = vectors.shape
    out = np.empty((rows, columns), order="F")
    for start in range(0, columns, _CHUNK):
        some = np.asfortranarray(vectors[:, start : start + _CHUNK])
        sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, some.shape[1]))
        dense = PETSc.Mat().createDense(sizes, array=some, comm=matrix.comm)
        product = matrix.matMult(dense)
        out[:, start : start + _CHUNK] = product.getDenseArray()
        product.destroy()
        dense.destroy()
    return out


def gram(comm: MPI.Comm, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left^T right over all processes, rows distributed alike. Collective."""
    return comm.allreduce(left.T @ right)
