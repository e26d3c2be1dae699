"""A scene's tread law and contact solver on a patch, from which the time loop obtains forces."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.choices import DENSE_POINTS, by_product
from tireroad.contact.grid_patch import DeformedTread
from tireroad.contact.patch import Patch
from tireroad.contact.solver.conditions import ContactSolver
from tireroad.contact.solver.projected_cg import Compliance, SpreadCompliance
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.tread.between_nodes import on_nodes, rastered
from tireroad.contact.tread.kernel import KernelTread
from tireroad.contact.tread.law import TreadLaw
from tireroad.contact.tread.laws.elastic import FREQUENCY
from tireroad.contact.tread.memory import (
    MOST_BEHIND,
    TreadMemory,
    WholeGrid,
    rows_behind,
    softened,
)
from tireroad.contact.tread.shear import KernelShear, MatrixShear, Shear
from tireroad.fem.errors import InputError, UnsuitedSettings

Array = NDArray[np.float64]

MOST_DENSE = 6000  # 0.3 GB a matrix
# Height over half the width of a patch above which it extends up the flanks of a torus.
STEEPEST = 0.25


class ContactSpec(Protocol):
    """How tread and road meet: the table [contact] of a scene, or `TreadContact`."""

    @property
    def law(self) -> TreadLaw:
        """The tread law."""

    @property
    def in_series(self) -> bool:
        """Whether the tread lies on the tire's own rubber; else it is that rubber (contact.tread.between_nodes)."""

    @property
    def solver(self) -> str:
        """Its name, or "auto"."""

    @property
    def friction(self) -> float | None:
        """Coefficient of friction; None: bristles never slip."""

    @property
    def brush(self) -> str:
        """The bristles' kind, "rolling" or "spring"."""

    @property
    def brush_stiffness(self) -> float | None:
        """Tangential stiffness of the bristle of a point, N/m; None: rigid."""

    @property
    def brush_stiffness_per_area(self) -> float | None:
        """The same by area, N/m3."""

    @property
    def has_friction(self) -> bool:
        """Whether the road holds the tread by friction or bristles."""

    @property
    def has_shear(self) -> bool:
        """Whether the tread deforms under horizontal forces."""


@dataclass(frozen=True, kw_only=True)
class TreadContact:
    """A `ContactSpec` of a tread that touches the road itself, with `friction` or without (0); `in_series` with the tire's own
    rubber, or that rubber itself."""

    law: TreadLaw
    solver: str = "auto"
    friction: float = 0.0
    in_series: bool = True
    brush: ClassVar[str] = "rolling"
    brush_stiffness: ClassVar[float | None] = None
    brush_stiffness_per_area: ClassVar[float | None] = None

    @property
    def has_friction(self) -> bool:
        """Whether the road holds the tread by friction."""
        return self.friction > 0.0 and self.law.shears

    @property
    def has_shear(self) -> bool:
        """Whether the tread deforms under horizontal forces."""
        return self.has_friction


def solver_name(spec: ContactSpec, patch: Patch) -> str:
    """The solver's name; "auto" is resolved by the number of points that touch at rest."""
    if spec.solver != "auto":
        return spec.solver
    count = len(patch.points), len(patch.index), int(np.count_nonzero(patch.gap <= 0.0))
    many = patch.places is not None and by_product(spec.has_friction, *count)
    return "projected-cg" if many else "active-set"


def past_tread(spec: ContactSpec, patch: Patch, speed: float, in_plane: bool) -> WholeGrid:
    """The tread that creeps between the points of a grid and behind them at `speed` m/s, normal to the road or `in_plane` too; InputError at
    nodes."""
    if patch.places is None:
        raise InputError(
            "contact.tread: a viscoelastic tread needs a grid of points: contact.points = { dx, dy }"
        )
    assert spec.law.creep is not None, "a tread that creeps"
    farthest = (1 + MOST_BEHIND) * _farthest(patch)
    influence = spec.law.influence(farthest)
    shear = spec.law.shear(farthest) if in_plane else None
    behind = rows_behind(spec.law.creep, patch, speed, influence)
    return WholeGrid(patch.places, influence, shear, behind)


def tread_memory(spec: ContactSpec, patch: Patch, speed: float, step: float) -> TreadMemory | None:
    """Memory of a viscoelastic tread rolling at `speed` m/s in steps of `step` s; else None."""
    if spec.law.creep is None:
        return None
    tread = past_tread(spec, patch, speed, spec.has_shear)
    assert patch.places is not None
    return TreadMemory(spec.law.creep, tread, patch.places.spacing[0], speed, step)


def tread_shear(spec: ContactSpec, patch: Patch, at_once: float = 1.0) -> Shear | None:
    """The tread's shear compliance between the points, times `at_once`; None if it is rigid."""
    if not spec.has_shear:
        return None
    plain = spec.law.shear(_farthest(patch))

    def influence(x: Array, y: Array, a: Array, b: Array) -> Array:
        return at_once * plain(x, y, a, b)

    if patch.places is not None:
        return KernelShear(patch.places, influence)
    return MatrixShear(patch.points[:, :2], patch.half_sizes, influence)


def resolved_tread(spec: ContactSpec, patch: Patch, surface: DeformedTread | None) -> Array | None:
    """Compliance that the elements resolve of a tread that is the tire's own: N (p, p) or, with shear, (3p, 3p) m/N between the nodes,
    of a tread that creeps at the modulus that it has at 1 kHz.

    `surface`: the deformed tread of a grid of points. None of a tread in series, and at nodes, where the elements have all of it.
    """
    if spec.in_series or patch.places is None:
        return None
    assert surface is not None, "the nodes of a grid of points"
    farthest = _farthest(patch)
    shear = spec.law.shear(farthest) if spec.has_shear else None
    known = on_nodes(rastered(surface, patch), spec.law.influence(farthest), shear)
    return known if spec.law.creep is None else softened(spec.law.creep, FREQUENCY) * known


def _spread(patch: Patch, tire: Array) -> Array:
    """W tire W^T (c, c) m/N."""
    return tire if patch.weights is None else patch.weights @ (patch.weights @ tire.T).T


def step_solver(
    spec: ContactSpec, patch: Patch, tire: Array, at_once: float = 1.0
) -> ContactSolver:
    """The solver for A = W tire W^T + C~, `tire` (p, p) m/N between nodes; C~ times `at_once`.

    InputError if a matrix of that many points is not affordable, or A is not positive definite.
    """
    name, count = solver_name(spec, patch), len(patch.points)
    if patch.places is not None and count > DENSE_POINTS:
        product = _product(spec, patch, tire, at_once)
        return make_solver(name, product)
    if count > MOST_DENSE:
        raise UnsuitedSettings(
            f'contact: solver "{name}" on these points keeps a matrix, which is for at most '
            f"{MOST_DENSE} of them, here are {count}: take fewer points, or a grid of points with "
            'solver = "auto"'
        )
    matrix = _spread(patch, tire) + at_once * tread_matrix(spec, patch)
    return make_solver(name, matrix)


def tread_matrix(
    spec: ContactSpec, patch: Patch, index: slice | NDArray[np.intp] = slice(None)
) -> Array:
    """Compliance of the tread between the points, or those of the `index`, (c, c) m/N."""
    # Evaluates a few thousand offsets instead of c^2.
    if patch.places is not None and spec.law.compliant:
        some = np.arange(len(patch.points))[index]
        return KernelTread(patch.places, spec.law.influence(_farthest(patch))).block(some, some)
    places, sizes = patch.points[index, :2], patch.half_sizes[index]
    try:
        return spec.law.matrix(places, sizes, _farthest(patch))
    except InputError as error:
        raise _out_of_reach(patch) or error from None


def touching_compliance(
    spec: ContactSpec, patch: Patch, tire: Array, index: NDArray[np.intp]
) -> Array:
    """W tire W^T + C~ between the points `index`, (n, n) m/N; `tire` (p, p) between the nodes."""
    if patch.weights is None:
        return tire[np.ix_(index, index)] + tread_matrix(spec, patch, index)
    rows = patch.weights[index]
    return rows @ (rows @ tire.T).T + tread_matrix(spec, patch, index)


def _out_of_reach(patch: Patch) -> InputError | None:
    """The InputError for a road so high that the patch extends up the tire's flanks, or None.

    Tread laws hold on a plane. Points that rise by more than STEEPEST of their distance from the
    footprint lie above each other, seen from the road.
    """
    highest = float(patch.gap[~patch.edge].max(initial=0.0))
    x0, x1, y0, y1 = patch.extent
    if highest <= STEEPEST * 0.5 * min(x1 - x0, y1 - y0):
        return None
    return InputError(
        f"contact: points up to {highest:.3g} m above the static road plane take part, which is up the "
        "tire's flanks, where a tread law for a plane does not hold. The patch reaches that far because "
        "of the road's height over that plane ([road] height, amplitude, offset or the file; "
        "contact.reach is 1.5 times it plus 5 mm unless given): take a lower road, or give contact.reach "
        "the gap (m) up to which points can really touch"
    )


def _product(spec: ContactSpec, patch: Patch, tire: Array, at_once: float) -> Compliance:
    """A as a product. Without a tread it would be singular: a grid has more points than nodes."""
    if not spec.law.compliant:
        raise InputError(
            "contact.tread: the tread leaves a grid of points without compliance of its own: take "
            'another, e.g. "half-space", or points = "nodes"'
        )
    assert patch.places is not None, "only a grid of points makes a product"
    plain = spec.law.influence(_farthest(patch))

    def influence(x: Array, y: Array, a: Array, b: Array) -> Array:
        return at_once * plain(x, y, a, b)

    return SpreadCompliance(tire, patch.weights, KernelTread(patch.places, influence))


def _farthest(patch: Patch) -> float:
    """Largest distance (m) at which the influence is evaluated.

    The doubled grid of the convolution extends one step beyond twice the patch.
    """
    x0, x1, y0, y1 = patch.extent
    return 2.1 * float(np.hypot(x1 - x0, y1 - y0)) + 4 * float(patch.half_sizes.max())
