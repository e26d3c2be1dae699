"""Cords that a deck gives as *REBAR, or in shells: brought to lines of membranes.

*REBAR is the old form: cords of membranes, shells and solids by a data line for each set or element.
In a membrane they lie in it. In a shell they lie at a distance from its middle, along its normal. In an
axisymmetric solid of corners 1 to 4 they lie in the plane between two points of its sides, given in the
coordinates (g, h) of the element, which are (0, 0), (1, 0), (1, 1) and (0, 1) at its corners; the angle
counts from the direction of growing g, or h, as that of a membrane from its first node to its second.

Source: Abaqus Keywords Reference, *REBAR, and "Defining rebar as an element property". Which way round
an angle counts in solids stands there in a figure alone; were it the other way, all of a tire's cords
would be its mirror image.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.decks.abaqus_generation import data_lines
from tireroad.fem.decks.deck import (
    SCOPE,
    Card,
    CardBlock,
    CordLayer,
    Data,
    Deck,
    Members,
    Place,
    Sets,
    first_of,
    number,
    used_kind,
)

# Columns of the data lines behind element (or set), area and spacing.
_COLUMNS = {
    ("AXIMEMBRANE", "ANY"): ("angle", "radius"),
    ("AXISHELL", "ANY"): ("position", "angle", "radius"),
    ("MEMBRANE", "SKEW"): ("angle",),
    ("MEMBRANE", "ISOPARAMETRIC"): ("edge",),
    ("SHELL", "SKEW"): ("position", "angle"),
    ("SHELL", "ISOPARAMETRIC"): ("position", "edge"),
    ("CONTINUUM", "SKEW"): ("angle", "radius"),
    ("CONTINUUM", "ISOPARAMETRIC"): ("angle", "fraction", "edge", "direction", "radius"),
}
_SIDES = 4  # of a quadrilateral
_TOUCHING = 1e-6  # of the deck's size: nearer ends of two lines are one


def option(card: Card, name: str) -> str:
    """The value of an option that may be written in short (GEOM=); "" if it is not there."""
    options = [key for key in card.options if name.startswith(key) and len(key) >= 4]
    return card.options[options[0]] if options else ""


def layers(card: Card, lines: list[Data]) -> Iterator[CordLayer]:
    """The layers of a *REBAR; `elements` is the set or the number of an element, as written."""
    element = card.options.get("ELEMENT", "").upper()
    geometry = option(card, "GEOMETRY").upper() or "ISOPARAMETRIC"
    columns = _COLUMNS.get((element, "ANY")) or _COLUMNS.get((element, geometry))
    if "SINGLE" in card.options:
        raise card.place.error(
            "*REBAR, SINGLE is not read: give the wire an element of its own with a *SOLID SECTION"
        )
    if columns is None:
        known = ", ".join(dict.fromkeys(of for of, _ in _COLUMNS))
        raise card.place.error(
            f"*REBAR with ELEMENT={element or 'missing'}, GEOMETRY={geometry} is not read: {known} are, "
            "and ISOPARAMETRIC, SKEW"
        )
    if not card.options.get("MATERIAL"):
        raise card.place.error("*REBAR without MATERIAL=")
    rows = list(data_lines(lines))
    pairs = element == "CONTINUUM" and geometry == "SKEW"
    for n in range(0, len(rows), 2 if pairs else 1):
        place, parts = rows[n]
        if len(parts) < 2 or not parts[0]:
            raise place.error(
                "a *REBAR needs an element or set, area, spacing; is the deck cut short?"
            )
        numbers = [number(part, place) for part in parts[1 : 3 + len(columns)]]
        area, spacing, *rest = numbers + [0.0] * (2 + len(columns) - len(numbers))
        values = dict(zip(columns, rest, strict=True))
        layer = _layer(card, parts[0], area, spacing or 1.0, values, place)
        if pairs:
            second = rows[n + 1][1] if n + 1 < len(rows) else []
            layer = replace(layer, cut=_skew(second, place))
        elif element == "CONTINUUM":
            layer = replace(layer, edge=0, cut=_parallel(values["edge"], values["fraction"], place))
        yield layer


def _layer(
    card: Card, of: str, area: float, spacing: float, values: dict[str, float], place: Place
) -> CordLayer:
    name, edge = card.options.get("NAME", "REBAR").upper(), values.get("edge", 0.0)
    if area <= 0 or spacing <= 0:
        raise place.error(f"cords of layer {name}: area and spacing must be > 0")
    if "edge" in values and edge not in range(1, _SIDES + 1):
        raise place.error(f"cords of layer {name}: edge {edge:g} is not one of 1 to 4")
    angular = values.get("radius", 0.0) > 0  # as many cords at every radius
    return CordLayer(
        name=name,
        elements=of,
        area=area,
        spacing=float(np.degrees(spacing / values["radius"])) if angular else spacing,
        material=card.options["MATERIAL"].upper(),
        angle=values.get("angle", 0.0),
        geometry="ANGULAR" if angular else "EDGE" if edge and "angle" not in values else "CONSTANT",
        orientation=card.options.get("ORIENTATION", ""),
        position=values.get("position", 0.0),
        edge=int(edge),
        place=place,
    )


def _parallel(edge: float, fraction: float, place: Place) -> tuple:
    """The cut parallel to an edge, at a fraction of the way to the opposite one."""
    if not 0 <= fraction <= 1:
        raise place.error(f"{fraction:g} of the way across an element: 0 to 1 are possible")
    at = fraction if edge in (1, 4) else 1 - fraction
    return ((0.0, at), (1.0, at)) if edge in (1, 3) else ((at, 0.0), (at, 1.0))


def _skew(parts: list[str], place: Place) -> tuple:
    """The cut between points of two edges, at fractions of the way along them."""
    along = ([number(part, place) for part in parts] + [0.0] * _SIDES)[:_SIDES]
    factors = [(k, f) for k, f in enumerate(along) if f]
    if len(factors) != 2 or not all(0 < f <= 1 for _, f in factors):
        raise place.error(
            "skew cords in solids need a second line with two fractions from 0 to 1 of four edges"
        )
    ends = [((f, 0.0), (1.0, f), (1.0 - f, 1.0), (0.0, 1.0 - f))[k] for k, f in factors]
    first, last = np.array(ends)
    step = last - first
    backwards = step[np.argmax(abs(step))] < 0
    return tuple(ends[::-1]) if backwards else tuple(ends)


def on_lines(deck: Deck) -> Deck:
    """The deck with the cords of shells and solids on membranes of their own.

    Shells without cords (a road, a wheel) are left out.
    """
    build = _Lines(replace(deck, blocks=tuple(_ends_first(deck, block) for block in deck.blocks)))
    placed = tuple(build.placed(layer) for layer in deck.layers)
    return build.deck(placed)


def _ends_first(deck: Deck, block: CardBlock) -> CardBlock:
    """Lines of three nodes with the middle one last, wherever the type has it."""
    if block.kind.role == "solid" or (block.kind.dimension, block.kind.nodes) != (2, 3):
        return block
    at = deck.points[deck.rows(block.nodes, block.place)]
    apart = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1).sum(axis=2)
    middle = apart.argmin(axis=1)[:, None]
    order = np.argsort(np.where(np.arange(3) == middle, 3, np.arange(3)), axis=1)
    return replace(block, nodes=np.take_along_axis(block.nodes, order, axis=1))


@dataclass(frozen=True)
class _Line:
    """New membranes in place of elements: their points (k, n, 3), corners or ends first."""

    labels: np.ndarray
    points: np.ndarray
    place: Place


class _Lines:
    """Membranes made for the layers of a deck."""

    def __init__(self, deck: Deck) -> None:
        self._deck = deck
        self._members = dict(deck.element_sets.members)
        self._bare: list[np.ndarray] = []  # shells that carry cords in their middle
        self._made: dict[tuple, int] = {}
        self._lines: list[_Line] = []
        self._cuts: dict[tuple[str, int], tuple] = {}  # of the elements of lines made one by one
        for layer in deck.layers:
            if layer.line and layer.cut is not None:
                for label in self._labels(layer.elements, layer).tolist():
                    self._cuts[layer.line, label] = layer.cut

    def placed(self, layer: CordLayer) -> CordLayer:
        """The layer on membranes."""
        whole = layer.line or layer.elements
        labels = self._labels(whole, layer)
        if layer.cut is None and not layer.position:
            self._bare.append(labels)
            return layer
        key = (whole, None if layer.line else layer.cut, layer.position)
        if key not in self._made:
            self._made[key] = len(self._made) + 1
            self._lines += self._new(layer, labels, self._made[key])
        shift = self._shift(self._made[key])
        names = {}
        for name in {whole, layer.elements}:
            names[name] = f"{name} (CORDS {self._made[key]})"
            self._members[names[name]] = Members([self._labels(name, layer) + shift])
        line = names[layer.line] if layer.line else ""
        return replace(layer, elements=names[layer.elements], line=line, position=0.0, cut=None)

    def _labels(self, name: str, layer: CordLayer) -> np.ndarray:
        return self._deck.element_sets.labels(name, layer.place)

    def _shift(self, number: int) -> int:
        """The offset of the labels of new membranes from those of their elements."""
        every = [int(block.labels.max(initial=0)) for block in self._deck.blocks]
        return number * SCOPE * (1 + max(every, default=0) // SCOPE)

    def _new(self, layer: CordLayer, labels: np.ndarray, number: int) -> list[_Line]:
        """The membranes of a layer, from the elements of its line."""
        fresh = []
        for block in self._deck.blocks:
            mine = np.isin(block.labels, labels)
            if not mine.any():
                continue
            nodes = self._deck.rows(block.nodes[mine], block.place)
            points, shape = self._deck.points[nodes], block.kind
            if layer.cut is not None:
                if (shape.role, shape.dimension, shape.corners) != ("solid", 2, _SIDES):
                    raise layer.place.error(
                        f"cords {layer.name} in elements {block.type}: *REBAR is read in axisymmetric "
                        "quadrilaterals (CAX4, CAX8, CGAX4, CGAX8); put membranes with cords into the others"
                    )
                cuts = [
                    self._cuts.get((layer.line, label), layer.cut)
                    for label in block.labels[mine].tolist()
                ]
                points = _cut(points, np.array(cuts))
            elif shape.role == "shell":
                if shape.corners == 3:
                    raise layer.place.error(
                        f"cords {layer.name}: triangular shells {block.type} with cords are not read"
                    )
                points = _moved(points, nodes, shape.dimension, layer.position)
            fresh.append(_Line(block.labels[mine] + self._shift(number), points, layer.place))
        if not fresh:
            raise layer.place.error(
                f"no element of {layer.elements} can carry the cords {layer.name}"
            )
        return fresh

    def deck(self, layers: tuple[CordLayer, ...]) -> Deck:
        """The deck with all of them."""
        old, carry = self._deck, np.concatenate([np.empty(0, np.int64), *self._bare])
        blocks = []
        for block in old.blocks:
            if block.kind.role == "shell":
                block = block.rows(np.isin(block.labels, carry))
                block = replace(block, kind=replace(block.kind, role="membrane"))
            if len(block.labels):
                blocks.append(block)
        new, labels, points = self._nodes()
        blocks += new
        known = np.sort(np.concatenate([np.empty(0, np.int64), *(b.labels for b in blocks)]))
        return replace(
            old,
            labels=np.concatenate([old.labels, labels]),
            points=np.concatenate([old.points, points]),
            blocks=tuple(blocks),
            layers=layers,
            element_sets=Sets(old.element_sets.sort, self._members, known),
        )

    def _nodes(self) -> tuple[list[CardBlock], np.ndarray, np.ndarray]:
        """Blocks of the new membranes, and labels and points of their nodes; where they meet, one node."""
        blocks: list[CardBlock] = []
        labels, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
        size = np.ptp(self._deck.points, axis=0).max() if len(self._deck.points) else 1.0
        every = self._deck.labels
        first = SCOPE * (1 + int(every.max(initial=0)) // SCOPE)
        for line in self._lines:
            at, row = _joined(line.points.reshape(-1, 3), _TOUCHING * size)
            count = line.points.shape[1]
            nodes = first + 1 + row.reshape(-1, count)
            name = {2: "SFMGAX1", 3: "SFMGAX2"}.get(count, f"SFM3D{count}")
            blocks.append(CardBlock(name, used_kind(name), line.labels, nodes, line.place))
            labels.append(first + 1 + np.arange(len(at)))
            points.append(at)
            first += SCOPE
        return blocks, np.concatenate(labels), np.concatenate(points)


def _joined(points: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge points closer than a tolerance: distinct points (m, 3), and for each input point the index (k,) of
    its distinct point."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray").reshape(-1, 2)
    first, row = np.unique(first_of(pairs, len(points)), return_inverse=True)
    return points[first], row


def _cut(points: np.ndarray, cuts: np.ndarray) -> np.ndarray:
    """Ends (and middles, of quadratic elements) (k, 2 or 3, 3) of cuts (k, 2, 2) through elements (k, 4 or 8, 3)."""
    if points.shape[1] > _SIDES:
        cuts = np.concatenate([cuts, cuts.mean(axis=1, keepdims=True)], axis=1)
    return np.einsum("kan,knx->kax", _functions(cuts, points.shape[1]), points)


def _functions(at: np.ndarray, count: int) -> np.ndarray:
    """Functions (..., count) of elements of 4 or 8 nodes at coordinates (..., 2) from 0 to 1."""
    g, h = np.moveaxis(2 * at - 1, -1, 0)
    corners = [(1 + sg * g) * (1 + sh * h) / 4 for sg, sh in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    if count == _SIDES:
        return np.stack(corners, axis=-1)
    middles = [
        (1 - g**2) * (1 - h) / 2,
        (1 + g) * (1 - h**2) / 2,
        (1 - g**2) * (1 + h) / 2,
        (1 - g) * (1 - h**2) / 2,
    ]
    corners = [corners[k] - (middles[k] + middles[k - 1]) / 2 for k in range(_SIDES)]
    return np.stack([*corners, *middles], axis=-1)


def _moved(points: np.ndarray, nodes: np.ndarray, dimension: int, distance: float) -> np.ndarray:
    """Shells' points (k, n, 3) moved along the mean normal of the elements at each node."""
    if dimension == 2:
        step = points[:, 1] - points[:, 0]
        normal = np.column_stack([-step[:, 1], step[:, 0], np.zeros(len(step))])
    else:
        normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    known, row = np.unique(nodes, return_inverse=True)
    mean = np.zeros((len(known), 3))
    np.add.at(mean, row.ravel(), np.repeat(normal, nodes.shape[1], axis=0))
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    return points + distance * mean[row.reshape(nodes.shape)]
