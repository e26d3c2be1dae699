"""The first eigenproblem: K Phi = M Phi Lambda, Phi^T M Phi = I, complete from the lowest mode up.

The diagonal mass makes it the standard problem of A = M^-1/2 K M^-1/2, which symmetries split:
equal segments by wave number (circulant), otherwise mirror planes or a half turn (symmetry). The
inertia of each part, from L D L^T by MUMPS, counts the eigenvalues below a value and so determines
the slices (spectrum). Block Lanczos extracts the eigenpairs of each slice (slices, lanczos).
Residuals and orthonormality are then measured on A itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.checkpoint import Journal
from tireroad.modal.solver.fields import (
    CHUNK,
    collect,
    multiply,
    normalise_modes,
    ordered,
    orthonormalise,
    row_sum,
    scaled_by,
)
from tireroad.modal.solver.searches import resolved
from tireroad.modal.solver.slicing import (
    LowestEigenvalues,
    Modes,
    ProcessGroup,
    Slice,
    SymmetricPart,
    SymmetricProblem,
)
from tireroad.modal.solver.symmetry import DofPositions, repeated, sectors, symmetries, whole

RESIDUAL_TOLERANCE = 1e-8  # relative, per eigenpair
MOST = 1e-6  # where rounding alone exceeds the tolerance
ORTHONORMALITY_TOLERANCE = 1e-10
_SAME = 1e-10  # relative distance of equal eigenvalues, where rounding is no larger


@dataclass(frozen=True)
class _Split:
    """Independent `parts` of the problem, their origin, and the `defect` of A's symmetry, 1/s2."""

    parts: list[SymmetricPart]
    defect: float = 0.0
    segments: int = 1
    symmetries: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Proof:
    """Proof by inertia: the eigenvalues next to zero, and how many lie below `top`."""

    bottom: LowestEigenvalues
    top: float
    inertia: int


def solve(
    stiffness: PETSc.Mat,
    mass: np.ndarray,
    count: int | None = None,
    *,
    up_to: float = np.inf,
    sites: DofPositions | None = None,
    waves: bool = True,
    teams: int | None = None,
    journal: Journal | None = None,
    solver: str = "auto",
) -> Modes:
    """The `count` lowest modes, or all below `up_to` (Hz); at least one of the two is given.

    The stiffness (n, n) is in N/m, the diagonal mass (own rows) in kg. Symmetries are sought at the
    `sites` of own unknowns, equal segments unless `waves` is False. A split whose modes are not
    modes of A is discarded for the next. The processes work in `teams`, each of which distributes A
    over its members; by default each process is its own (modal.solver.slicing). `solver`: "auto",
    "lanczos" or "slepc" finds the eigenpairs of a slice. Counts and slices that the `journal` holds are
    not computed again. Raises ConvergenceError if a mode is missing, inaccurate or unstable. Collective.
    """
    comm = stiffness.comm.tompi4py()
    size = stiffness.getSize()[0]
    scaled = scaled_by(stiffness, mass)
    all_sites = None if sites is None else sites.everywhere(comm)
    rank = np.arange(size) if all_sites is None else all_sites.rank()
    own = slice(*scaled.getOwnershipRange())
    team = ProcessGroup.of(comm, teams or comm.size)
    problem = _Problem(
        scaled, team, row_sum(scaled), mass, rank[own], journal or Journal(), resolved(solver)
    )
    count, limit = min(count or size, size), (2 * np.pi * up_to) ** 2
    for split in _splits(scaled, all_sites, waves, team):
        modes = problem.solve(split, count, limit)
        if problem.accurate(modes, split.defect):
            break
    scaled.destroy()
    team.disband()
    return problem.checked(modes, split.defect)


def _splits(
    matrix: PETSc.Mat, sites: DofPositions | None, waves: bool, team: ProcessGroup
) -> Iterator[_Split]:
    """Ways to split the problem, the finest first, the undivided problem last. Collective."""
    if sites is not None:
        ring = repeated(matrix, sites) if waves else None
        if ring is not None:
            yield _Split([ring.wave(n, team) for n in ring.waves], ring.defect, ring.segments)
        found = symmetries(matrix, sites)
        if found:
            parts: list[SymmetricPart] = [*sectors(matrix, [one.image for one in found], team)]
            names = tuple(one.isometry.name for one in found)
            yield _Split(parts, sum(one.defect for one in found), symmetries=names)
    yield _Split([whole(matrix, team)])


@dataclass(frozen=True)
class _Problem:
    """A distributed, the `team` of this process and the `norm` of A.

    Of own rows: `mass` kg and `rank` by position. `journal`: the results found so far.
    """

    scaled: PETSc.Mat
    team: ProcessGroup
    norm: float
    mass: np.ndarray
    rank: np.ndarray
    journal: Journal
    solver: str

    @property
    def comm(self) -> MPI.Comm:
        return self.scaled.comm.tompi4py()

    def solve(self, split: _Split, count: int, limit: float) -> Modes:
        """Solve all slices of the parts. Collective."""
        spectrum = SymmetricProblem(
            self.comm, split.parts, self.team, self.norm, self.journal, self.solver
        )
        bottom = spectrum.bottom()
        bottom.check_stable()
        boundaries = spectrum.boundaries(bottom, count, limit)
        proof = _Proof(bottom, boundaries[-1][0], int(boundaries[-1][1].sum()))
        if proof.inertia == 0:
            raise ConvergenceError(
                f"modes: the tire has no mode below {np.sqrt(proof.top) / (2 * np.pi):.4g} Hz. Raise "
                "modal.up_to."
            )
        return self._together(split, spectrum.slices(boundaries), min(count, proof.inertia), proof)

    def _together(self, split: _Split, found: list[Slice], count: int, proof: _Proof) -> Modes:
        """The lowest `count` modes of all slices, which are used up, orthonormal and by rule, with residuals.
        Collective.
        """
        parts, bottom = split.parts, proof.bottom
        values = np.concatenate([one.values for one in found])
        values[values <= bottom.zero] = 0.0
        order, group = ordered(values, _families(parts, found), self._same(values))
        # Rotate a group as a whole, even if the last mode divides it.
        end = int(np.searchsorted(group, group[count - 1], side="right"))
        order, group = order[:end], group[:end]
        vectors = collect(self.scaled, parts, found, order, self.team)
        part = np.concatenate([np.full(len(one.values), one.part) for one in found])[order]
        slices = len(found)
        found.clear()  # as many numbers as the modes again
        defect = orthonormalise(self.comm, vectors, part)
        vectors /= np.sqrt(self.mass)[:, None]
        normalise_modes(self.comm, vectors, self.rank, group)
        squares, vectors = values[order][:count], vectors[:, :count]
        return Modes(
            squares=squares,
            vectors=vectors,
            residual=self._residuals(squares, vectors, values[values > 0].min(initial=proof.top)),
            orthonormality=defect,
            inertia_count=proof.inertia,
            counted_below=proof.top,
            rigid=int((squares == 0).sum()),
            sectors=tuple(part.matrix.shape[1] * part.copies for part in parts),
            slices=slices,
            segments=split.segments,
            symmetries=split.symmetries,
        )

    def _same(self, values: np.ndarray) -> float:
        return max(_SAME, self._rounding(values))

    def _rounding(self, values: np.ndarray, defect: float = 0.0) -> float:
        """Rounding of A phi relative to the lowest eigenvalue (measured: 0.05 to 1 times eps |A|).

        The `defect` of a symmetry counts where it is larger. At most `MOST`.
        """
        flexible = values[values > 0]
        stiff = np.finfo(float).eps * self.norm
        return min(max(stiff, defect) / flexible.min(), MOST) if len(flexible) else 0.0

    def _allowed(self, modes: Modes, defect: float) -> float:
        """Largest residual: near incompressibility rounding alone is 1e-8 of the softest mode."""
        return max(RESIDUAL_TOLERANCE, self._rounding(modes.squares, defect))

    def accurate(self, modes: Modes, defect: float) -> bool:
        """Whether all are modes of the whole matrix."""
        return bool(modes.residual.max(initial=0.0) <= self._allowed(modes, defect))

    def checked(self, modes: Modes, defect: float) -> Modes:
        """The modes, if they are accurate and orthonormal; ConvergenceError otherwise."""
        if not self.accurate(modes, defect):
            raise ConvergenceError(
                f"modes: worst relative residual {modes.residual.max():.1e}, allowed "
                f"{self._allowed(modes, defect):.0e}: the lowest mode is too soft compared with the stiffest "
                "element for double precision. Use elements of more equal size."
            )
        if not modes.orthonormality <= ORTHONORMALITY_TOLERANCE:
            raise ConvergenceError(
                f"modes: orthonormality is lost ({modes.orthonormality:.1e}, allowed "
                f"{ORTHONORMALITY_TOLERANCE:.0e}). Use elements of more equal size."
            )
        return modes

    def _residuals(self, squares: np.ndarray, vectors: np.ndarray, least: float) -> np.ndarray:
        """Relative residuals (m,); of rigid modes, to the eigenvalue `least`. Collective."""
        defects = np.empty(len(squares))
        root = np.sqrt(self.mass)[:, None]
        for start in range(0, len(squares), CHUNK):
            some = slice(start, start + CHUNK)
            shapes = root * vectors[:, some]
            defects[some] = ((multiply(self.scaled, shapes) - shapes * squares[some]) ** 2).sum(
                axis=0
            )
        return np.sqrt(summed(self.comm, defects)) / np.maximum(squares, least)


def _families(parts: list[SymmetricPart], found: list[Slice]) -> np.ndarray:
    """(k,) a number for each eigenpair: of its part and, within it, of the copy."""
    most = max(part.copies for part in parts)
    numbers = [
        most * one.part + np.arange(len(one.values)) % parts[one.part].copies for one in found
    ]
    return np.concatenate(numbers)
