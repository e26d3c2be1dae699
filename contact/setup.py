"""Contact of a tire with its road: the strip of road under them, and its motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from tireroad.contact.grid_patch import DeformedTread, equilibrate, make_grid_patch, spread_pull
from tireroad.contact.loop import Drive, no_motion
from tireroad.contact.model import ContactSpec, past_tread, resolved_tread, step_solver
from tireroad.contact.patch import LEAST_REACH, Patch, make_patch
from tireroad.contact.roads.cell_mean import CellMean
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.roads.under_tire import NOTHING, PreparedRoad, RoadUnderTire
from tireroad.contact.tread.between_nodes import before_equilibrium, in_elements
from tireroad.contact.tread.brush import shape_slip
from tireroad.contact.tread.laws.elastic import FREQUENCY
from tireroad.contact.tread.memory import softened, steadily
from tireroad.contact.tread.pattern import Pattern
from tireroad.fem.static.road import RoadShape
from tireroad.greens.response import Response

_RUNG = 1.5  # of five seeds of a rough road the highest spots were within a factor of 2.1
_APART = 1e-3  # of a point's half size: distance of the heights whose difference is a slope


class OuterFace(Protocol):
    """The outer face of a static state (fem.static.state.StaticState)."""

    @property
    def positions(self) -> np.ndarray: ...
    @property
    def half_sizes(self) -> np.ndarray: ...
    @property
    def force(self) -> np.ndarray: ...
    @property
    def gap(self) -> np.ndarray: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def road_height(self) -> float | None: ...
    @property
    def normal_force(self) -> np.ndarray: ...
    @property
    def seen(self) -> np.ndarray: ...
    @property
    def road(self) -> RoadShape: ...
    @property
    def pull(self) -> np.ndarray | None: ...


@dataclass(frozen=True, kw_only=True)
class Rolled:
    """How the tire rolls: `speed` m/s over the road, `duration` s of the run, and the road's
    vertical `motion` m over time s, of at most `lift` m, by default none.
    """

    speed: float
    duration: float
    motion: Callable[[float], float] = no_motion
    lift: float = 0.0

    @property
    def travel(self) -> float:
        """Length of road that passes, m."""
        return self.speed * self.duration


@dataclass(frozen=True)
class SteadyRolling:
    """A tire that rolls steadily on a smooth road: where a loop begins.

    `state` of the contact problem (ContactProblem.state); `change` (k,) N of the forces on the nodes from the static state;
    `normal` (c,) and `horizontal` (c, 2) N of the points, as a loop has them; `way` m rolled until it was steady.
    """

    state: dict[str, np.ndarray]
    change: np.ndarray
    normal: np.ndarray
    horizontal: np.ndarray
    way: float


@dataclass(frozen=True, kw_only=True)
class ContactSetup:
    """The contact of a run: the `patch` of points whose static gap is within `reach` (m), the strip
    of `road` under it, the `slip` (s_x, s_y) of the wheel as in contact.tread.brush, `shape_slip`
    (s, 2) of the static shape at the outer face's nodes, for bristles, and `pull` (s, 2) N,
    horizontal forces of a static state with friction. `free`: the slip of free rolling is still to be found; `free_slip`:
    that slip, which is part of `slip`;
    `steady`: the state of steady rolling in which a loop begins (contact.rolling.rolling_steadily); `at_rest`: it begins so since
    none was found. `surface`: the deformed
    tread under a grid of points; `resolved` (p, p) or (3p, 3p) m/N: what the nodes have of the tread, which the contact counts
    less of them (contact.model.resolved_tread), once settled.
    """

    patch: Patch
    reach: float
    road: PreparedRoad
    rolled: Rolled
    surface: DeformedTread | None = None
    resolved: np.ndarray | None = None
    pattern: Pattern | None = None
    slip: tuple[float, float] = (0.0, 0.0)
    shape_slip: np.ndarray | None = None
    pull: np.ndarray | None = None
    free: bool = False
    free_slip: float | None = None
    steady: SteadyRolling | None = None
    at_rest: bool = False

    @property
    def drive(self) -> Drive:
        """The road as the time loop uses it, smoothed over each point's rectangle where it is
        finer; a pattern's depth lowers it, but for what the static state contains.

        The slope is the road's: a pattern moves with the tread, whose blocks lie on the road.
        """
        height: Callable[[np.ndarray, np.ndarray], np.ndarray] = self._height
        slope: Callable[[np.ndarray, np.ndarray], np.ndarray] = self._slope
        if self.fine:
            smoothed = CellMean(self.road, self.patch.points[:, 1], self.patch.half_sizes)
            height, slope = smoothed.height, smoothed.slope
        moved = self.rolled.motion, self.rolled.speed
        relief = None if self.pattern is None else self._relief
        return Drive(height, *moved, slope if self.leans else None, relief)

    def _relief(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Depths (n, c) m of the pattern beyond those at t = 0."""
        assert self.pattern is not None, "the tread is a slick"
        return self.pattern.depth(along, across) - self.begun

    def _height(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Heights (n, c) m within the prepared strip, at whose borders points that move beyond it stay."""
        (x0, x1), (y0, y1) = self._bounds
        return self.road.height(np.clip(along, x0, x1), np.clip(across, y0, y1))

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights (n, m) m at every x (n,) with every y (m,) m of the road as it lies at t = 0, but for its motion."""
        return self._height(*np.meshgrid(x, y, indexing="ij"))

    @property
    def _bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        x0, x1, y0, y1 = self.patch.extent
        return (x0, min(x1 + self.rolled.travel, self.road.end)), (y0, y1)

    def _slope(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Slopes (n, c, 2) of a road that is smooth over a point's rectangle, by differences."""
        bounds = self._bounds
        along, across = (
            np.clip(here, *ends) for here, ends in zip((along, across), bounds, strict=True)
        )
        out, apart = np.zeros((*along.shape, 2)), _APART * self.patch.half_sizes
        for axis, here in enumerate((along, across)):
            ends = [
                np.clip(here + step, *bounds[axis]) for step in (-apart[:, axis], apart[:, axis])
            ]
            places = [(end, across) if axis == 0 else (along, end) for end in ends]
            before, after = (self.road.height(x, y) for x, y in places)
            out[..., axis] = (after - before) / np.maximum(ends[1] - ends[0], 1e-12)
        return out

    @property
    def fine(self) -> bool:
        """Whether the road has waves shorter than two points, which the points cannot resolve."""
        return self.road.spacing < 2 * float(self.patch.half_sizes.max())

    @property
    def shortest(self) -> float:
        """Half the shortest wave (m) of the road met by the points; at least their spacing."""
        pitch = 2 * float(self.patch.half_sizes[~self.patch.edge, 0].min(initial=np.inf))
        return max(self.road.spacing, pitch) if np.isfinite(pitch) else self.road.spacing

    @property
    def begun(self) -> np.ndarray:
        """Depth (c,) m of the pattern under the points at t = 0."""
        assert self.pattern is not None, "the tread is a slick"
        return self.pattern.depth(self.patch.points[:, 0], self.patch.points[:, 1])

    @property
    def relief(self) -> float:
        """Bound of the height difference (m) of the road under the run; 0 if the wheel stands, since
        the road grows with the way travelled."""
        if not self.rolled.travel:
            return 0.0
        x0, x1, y0, y1 = self.patch.extent
        strip = x0, x1 + self.rolled.travel, y0, y1
        return self.road.highest(*strip) - self.road.lowest(*strip)

    @property
    def leans(self) -> bool:
        """Whether the road under the run has slopes."""
        return self.relief >= NOTHING

    @property
    def slips(self) -> np.ndarray:
        """Slip (2,) of the wheel, or (c, 2) at the points."""
        if self.shape_slip is None:
            return np.array(self.slip)
        nodes, weights = self.shape_slip[self.patch.index], self.patch.weights
        return self.slip + (nodes if weights is None else weights @ nodes)

    def with_slip(self, more: float) -> ContactSetup:
        """The same with the slip of free rolling, `more` along the road."""
        return replace(self, slip=(self.slip[0] + more, self.slip[1]), free=False, free_slip=more)

    def smooth(self, duration: float) -> ContactSetup:
        """The same on a flat road at rest, for `duration` s, without a pattern."""
        still = replace(self.rolled, duration=duration, motion=no_motion, lift=0.0)
        road = _under(RoadUnderTire(Flat()), self.patch, still)
        return replace(self, road=road, rolled=still, pattern=None)

    def equilibrated(self, response: Response, nodal_force: np.ndarray, spec: ContactSpec) -> tuple:
        """(setup, rise in m): settle the points on the tread, which the elements lack, and where losses move the tire.

        `nodal_force` (s,) N of the finite elements on the outer face. Nodes without a tread that nothing
        moves are settled already.
        """
        patch, force, offset = self.patch, nodal_force[self.patch.index], response.offset
        pull = None if self.pull is None else self.pull[patch.index]
        if patch.weights is None and not spec.law.compliant and offset is None:
            return replace(self, patch=replace(patch, pull=pull)), 0.0
        if self.pattern is not None:
            patch = replace(patch, gap=patch.gap + self.begun)
        p, at_rest, past = len(patch.index), 1.0, None
        whole = response.static() + response.residual
        flexibility, resolved = whole[:p, :p], resolved_tread(spec, patch, self.surface)
        if resolved is not None:
            resolved = in_elements(resolved, whole[: len(resolved), : len(resolved)])
        normal = None if resolved is None else resolved[:p, :p]
        if spec.law.creep is not None:
            # The nodes' part has in the static state no other moduli than its elements.
            if normal is not None:
                normal = normal / softened(spec.law.creep, FREQUENCY)
            past, at_rest = self._past(spec, normal)
        if normal is not None:
            normal = at_rest * normal
            flexibility, patch = flexibility - normal, before_equilibrium(patch, normal, force)
        solver = step_solver(spec, patch, flexibility, at_rest)
        moved = None if offset is None else offset[:p]
        settled, rise = equilibrate(patch, solver, flexibility, force, moved, past)
        if pull is not None:
            settled = replace(settled, pull=spread_pull(settled, pull, force))
        return replace(self, patch=settled, resolved=resolved), rise

    def _past(
        self, spec: ContactSpec, resolved: np.ndarray | None
    ) -> tuple[Callable[[np.ndarray], np.ndarray], float]:
        """Displacements (c,) m by forces (c,) N at rest of a tread that creeps, as far as the nodes do not have it, beyond those at
        once times a factor, and the factor. `resolved` (p, p) m/N: what they have of it, at its instantaneous modulus."""
        creep, speed, patch = spec.law.creep, self.rolled.speed, self.patch
        assert creep is not None
        tread = past_tread(spec, patch, speed, in_plane=False)
        # In the middle between a pressure that has just come and one that has long been there.
        middle = 1.0 + float(creep[0].sum()) * (1.0 if speed == 0 else 0.5)

        def past(force: np.ndarray) -> np.ndarray:
            field = steadily(creep, tread.places, speed, force)
            field[tread.place] -= middle * force
            crept, moved = field[tread.place], tread(field[None])[0]
            if resolved is not None and patch.weights is not None:
                moved -= patch.at_points(resolved @ (patch.weights.T @ crept))
            return moved

        return past, middle


def freely_rolling(
    setup: ContactSetup, face: OuterFace, ring: np.ndarray, radius: float
) -> ContactSetup:
    """The setup of a wheel that turns as it would by itself, of effective rolling radius `radius` m: its slip is to be
    found (contact.rolling.rolling_steadily), and bristles feel the local speeds of the static shape, whose nodes form a
    ring at the angles `ring` (rad)."""
    shape = shape_slip(face.positions, ring, face.shape, radius)
    return replace(setup, free=True, shape_slip=shape)


def contact_setup(
    face: OuterFace,
    lattice: Any,
    road: RoadUnderTire,
    rolled: Rolled,
    *,
    spacing: tuple[float, float] | None = None,
    reach: float | None = None,
    pattern: Pattern | None = None,
    surface: DeformedTread | None = None,
) -> ContactSetup:
    """Patch and road of a run: points at the nodes, or on a grid of the `spacing` (m).

    `lattice`: of the finite elements' nodes, and `pattern`: of the tread; both for a grid only.
    `reach` (m) is by default that of the road.
    """
    if reach is None:
        reach = _reach(face, road, rolled)
    patch = nodes_within(face, reach)
    if spacing is not None:
        from tireroad.fem.static.footprint import TreadSurface

        assert face.road_height is not None, "contact needs a tire that stands on a road"
        surface = surface or TreadSurface(lattice, face.seen)
        patch = make_grid_patch(surface, face.road_height, patch, spacing, reach)
    patch = on_shape(patch, face.road)
    if pattern is not None:
        pattern.land(patch.points[~patch.edge, 1])
    under = _under(road, patch, rolled)
    return ContactSetup(
        patch=patch,
        reach=reach,
        road=under,
        rolled=rolled,
        pattern=pattern,
        pull=face.pull,
        surface=surface,
    )


def nodes_within(face: OuterFace, reach: float) -> Patch:
    """The nodes with a static gap within reach (m), and one more row around them."""
    selection = face.half_sizes, face.normal_force, face.gap, face.shape, reach
    return make_patch(face.seen, *selection)


def on_shape(patch: Patch, road: RoadShape) -> Patch:
    """The patch on a shaped road, with gaps, forces and motions along its normal."""
    if road.flat:
        return patch
    x, y, height = patch.points.T
    return replace(
        patch,
        points=np.stack([x, y, height + road.height(x, y)], axis=-1),
        gap=patch.gap / road.stretch(x, y),
        frames=road.frames(x, y),
    )


def _under(road: RoadUnderTire, patch: Patch, rolled: Rolled) -> PreparedRoad:
    """The strip of road that the patch passes over in this run."""
    _, x1, y0, y1 = patch.extent
    return road.prepare(x1, x1 + rolled.travel, y0, y1)


def _reach(face: OuterFace, road: RoadUnderTire, rolled: Rolled) -> float:
    """Static gap up to which a point can touch: the road's highest spot, its motion, a margin.

    The highest spot depends on the strip and the strip on the patch, which two rounds resolve.
    Rounded up to a power of `_RUNG` margins, so that similar roads have the same patch and share
    its Green's functions.
    """
    reach = rolled.lift + LEAST_REACH
    for _ in range(2):
        patch = nodes_within(face, reach)
        strip = _under(road, patch, rolled)
        x0, x1, y0, y1 = patch.extent
        highest = max(strip.highest(x0, x1 + rolled.travel, y0, y1), 0.0)
        reach = 1.5 * (highest + rolled.lift) + LEAST_REACH
    return LEAST_REACH * _RUNG ** np.ceil(np.log(reach / LEAST_REACH) / np.log(_RUNG) - 1e-9)
