"""A tire built from layers under its outer face, as the radial tire or a section file describes it.

Layers follow one another from the outer face inwards, each with a thickness that varies along the
section. Cords lie on the inner side of a layer; parts of a layer may be of another compound.
Lengths are in m; positions along the section are lengths s on the outer face from the crown, the
same on both sides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PchipInterpolator

from tireroad.fem.errors import InputError
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import (
    PlyLine,
    RegionPatch,
    Ring,
    SectionMesh,
    element_corners,
    product_mesh,
    revolved,
)

RADII = 0.1, 2.5  # m, range of the outer radius of a tire
INFLATION = 2.2e5  # Pa, of a passenger tire whose pressure a file does not give
_SAMPLES = 4001
_ARC = 24  # points on each arc
LEAST = (6, 2)  # elements around and along: minimum for a tire
_ENDS, _ENDS_DEPTH = 0.06, 0.6  # of the half section: belt-end refinement, as for the torus


class Outline:
    """The outer face, r and y in m, from the crown (y = 0) to the bead, with its mirror image.

    `points` (k, 2) of (r, y), k >= 4, starting at y = 0: a cubic spline through them over chord
    length, with zero slope at the crown. `length` m from crown to bead.
    """

    def __init__(self, points: np.ndarray) -> None:
        points = np.asarray(points, float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 4:
            raise InputError("section: an outline needs four points (r, y) or more")
        if points[0, 1] != 0:
            raise InputError(
                f"section: the outline starts at y = {points[0, 1]:g}, not at the crown, y = 0"
            )
        chord = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        if (np.diff(chord) <= 0).any():
            raise InputError("section: two points of the outline are at one place")
        both = np.concatenate([points[:0:-1] * [1, -1], points])
        spline = CubicSpline(np.concatenate([-chord[:0:-1], chord]), both)
        t = np.linspace(0.0, chord[-1], _SAMPLES)
        dense = spline(t)
        steps = np.linalg.norm(np.diff(dense, axis=0), axis=1)
        by_length = CubicSpline(np.append(0.0, np.cumsum(steps)), t)
        self.length = float(steps.sum())
        self._place = lambda s: spline(by_length(s))
        self._slope = lambda s: spline(by_length(s), 1)

    def at(self, s: np.ndarray) -> np.ndarray:
        """(r, y) (k, 2) m at signed lengths (k,) m from the crown."""
        points = self._place(np.abs(s))
        points[:, 1] *= np.sign(s)
        return points

    def inwards(self, s: np.ndarray) -> np.ndarray:
        """Unit normals (k, 2) towards the air inside."""
        r, y = self._slope(np.abs(s)).T
        size = np.hypot(r, y)
        return np.stack([-y / size, np.sign(s) * r / size], axis=-1)


def arcs(through: npt.ArrayLike) -> np.ndarray:
    """Points on consecutive arcs: `through` is the start, then a middle and an end for each."""
    points = np.asarray(through, float)
    if points.ndim != 2 or len(points) < 3 or len(points) % 2 == 0:
        raise InputError("section: arcs are a start and two points (on the way, end) for each arc")
    pieces = [points[:1]]
    for start, middle, end in zip(points[:-2:2], points[1:-1:2], points[2::2], strict=True):
        pieces.append(_arc(start, middle, end)[1:])
    return np.concatenate(pieces)


def _arc(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    matrix = 2 * np.array([b - a, c - a])
    if abs(np.linalg.det(matrix)) < 1e-12 * np.linalg.norm(c - a) ** 2:
        return a + np.linspace(0, 1, _ARC)[:, None] * (c - a)
    centre = np.linalg.solve(matrix, [b @ b - a @ a, c @ c - a @ a])
    angle = np.unwrap([np.arctan2(*(p - centre)) for p in (a, b, c)])
    turn = np.linspace(angle[0], angle[2], _ARC)
    return centre + np.linalg.norm(a - centre) * np.stack([np.sin(turn), np.cos(turn)], axis=-1)


@dataclass(frozen=True)
class Layer:
    """A compound under the preceding layer; `thickness`: pairs (s, m), s ascending, interpolated
    smoothly."""

    name: str
    compound: str
    thickness: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Part:
    """A part of a layer, |s| from `along[0]` to `along[1]`, of another compound."""

    layer: str
    compound: str
    along: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class CordLine:
    """Cords on the inner side of layer `under`, |s| <= `to`; as in Cords, angle in rad."""

    name: str
    under: str
    to: float
    angle: float
    youngs_modulus: float
    area: float
    spacing: float
    density: float = 0.0
    compression: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Construction:
    """`tread` m: limit of |s| that the road can touch; `compounds` by name, as in `Material`.

    `held` m: the rim holds the outer face from |s| = held, in addition to the ends; None: only the
    ends.
    """

    outline: Outline
    layers: Sequence[Layer]
    parts: Sequence[Part] = ()
    cords: Sequence[CordLine] = ()
    compounds: Mapping[str, Mapping[str, float]]
    tread: float
    held: float | None = None

    def section(self, elements: int, order: int = 2) -> SectionMesh:
        """Section mesh, one element per layer, about `elements` bead to bead, edges at boundaries.

        Raises InputError for unknown names, layers without thickness or a wall that folds.
        """
        length, levels = self.outline.length, len(self.layers)
        self._check()
        surfaces = self._surfaces()

        def place(level: np.ndarray, s: np.ndarray) -> np.ndarray:
            depths = surfaces(np.abs(s))  # (k, levels + 1), outer face first
            under = levels * (1 - level)
            k = np.clip(np.floor(under).astype(int), 0, levels - 1)
            part, rows = under - k, np.arange(len(s))
            depth = depths[rows, k] * (1 - part) + depths[rows, k + 1] * part
            return self.outline.at(s) + depth[:, None] * self.outline.inwards(s)

        patches = [self._patch(part) for part in self.parts]
        for number, layer in enumerate(self.layers):
            patches.insert(
                number, RegionPatch(layer.compound, ((-length, length),), self._depth(number))
            )
        plies = [self._ply(line) for line in self.cords]
        ends = [end for part in self.parts for end in part.along] + [line.to for line in self.cords]
        ends += [self.tread, self._held]
        fixed = [end for end in ends if end < length * (1 - 1e-9)]
        both = [*fixed, *(-end for end in fixed)]
        wall = np.linspace(0.0, 1.0, levels + 1)
        arc = element_corners(
            elements, lambda s: 1 / self._size(s, elements), -length, length, both
        )
        mesh = product_mesh(
            order=order, wall=wall, arc=arc, place=place, patches=patches, plies=plies
        )
        return _named(mesh, arc, self.tread, self._held)

    @property
    def _held(self) -> float:
        return self.outline.length if self.held is None else self.held

    def ring(
        self, segments: int, elements: int, order: int = 2, footprint_size: float = 1.0
    ) -> Ring:
        """The section revolved; its coarser companion has half the elements in both directions."""

        def coarser() -> Ring | None:
            if segments // 2 < LEAST[0] or elements // 2 < 2 * LEAST[1]:
                return None
            return self.ring(segments // 2, elements // 2, order, footprint_size)

        return revolved(self.section(elements, order), segments, footprint_size, coarser)

    def _check(self) -> None:
        names = [layer.name for layer in self.layers]
        for kind, wanted in (
            ("part", [p.layer for p in self.parts]),
            ("cords", [c.under for c in self.cords]),
        ):
            for name in wanted:
                if name not in names:
                    raise InputError(
                        f"section: {kind} of layer {name!r}; there are {', '.join(names)}"
                    )
        for compound in [layer.compound for layer in self.layers] + [
            p.compound for p in self.parts
        ]:
            if compound not in self.compounds:
                known = ", ".join(self.compounds)
                raise InputError(f"section: no compound {compound!r}; there are {known}")

        if not self.tread < self._held:
            raise InputError(
                f"section: the tread reaches to {self.tread:g} m, the rim holds the face from {self._held:g} m on"
            )

    def _surfaces(self) -> Callable[[np.ndarray], np.ndarray]:
        """Function from lengths (k,) >= 0 to depths (k, layers + 1) m of the layers' faces."""
        lines = []
        for layer in self.layers:
            s, thickness = np.array(layer.thickness, float).T
            if (thickness <= 0).any():
                raise InputError(
                    f"section: layer {layer.name!r} needs a thickness above 0 everywhere"
                )
            if (np.diff(s) <= 0).any():
                raise InputError(
                    f"section: layer {layer.name!r}: places along the section must ascend"
                )
            lines.append((PchipInterpolator(s, thickness), s) if len(s) > 1 else (thickness[0], s))

        def depths(s: np.ndarray) -> np.ndarray:
            parts = [
                line(np.clip(s, at[0], at[-1])) if len(at) > 1 else np.full(len(s), line)
                for line, at in lines
            ]
            return np.cumsum([np.zeros(len(s)), *parts], axis=0).T

        return depths

    def _depth(self, number: int) -> tuple[float, float]:
        count = len(self.layers)
        return 1 - (number + 1) / count, 1 - number / count

    def _number(self, name: str) -> int:
        return [layer.name for layer in self.layers].index(name)

    def _patch(self, part: Part) -> RegionPatch:
        low, high = part.along
        high = min(high, self.outline.length)
        arcs = ((-high, high),) if low == 0 else ((-high, -low), (low, high))
        return RegionPatch(part.compound, arcs, self._depth(self._number(part.layer)))

    def _ply(self, line: CordLine) -> PlyLine:
        end = min(line.to, self.outline.length)
        return PlyLine(line.name, (-end, end), self._depth(self._number(line.under))[0])

    def _size(self, s: np.ndarray, count: int) -> np.ndarray:
        """Relative element size: graded to the beads, smaller at the ends of cords."""
        length = self._held
        thickness = self._surfaces()(np.array([length]))[0, -1]
        distance = np.maximum(length - np.abs(s), 0.0)
        size = mesh2d.graded_size(distance, 2 * length, count, mesh2d.LEAST * thickness / count)
        size = np.where(np.abs(s) < length, size, self.outline.length)  # held part: one element
        ends = np.array([line.to for line in self.cords if line.to < length])
        if not len(ends):
            return size
        distance = np.abs(np.abs(s)[:, None] - ends).min(axis=1)
        return size * (1 - _ENDS_DEPTH * np.exp(-((distance / (_ENDS * length)) ** 2)))


def _named(mesh: SectionMesh, arc: np.ndarray, tread: float, held: float) -> SectionMesh:
    """Merge regions of equal compound, drop empty ones, limit tread and rim to their parts."""
    from dataclasses import replace

    used = [mesh.regions[i] for i in np.unique(mesh.region)]
    names = tuple(dict.fromkeys(used))
    number = {name: i for i, name in enumerate(names)}
    region = np.array([number[mesh.regions[i]] for i in mesh.region])
    middle = np.abs(arc[1:] + arc[:-1]) / 2
    rim = np.concatenate([mesh.rim, mesh.outer[middle > held]])
    return replace(mesh, region=region, regions=names, tread=mesh.outer[middle < tread], rim=rim)
