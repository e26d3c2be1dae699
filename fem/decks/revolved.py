"""Three-dimensional decks of bodies of revolution are reduced to their section.

The program's rolling states require a body whose undeformed shape is the same at every angle; any
other body is refused, with the reason.

Cord angles become angles from the section's meridian. In a membrane the angle is measured from the
local first direction 1 about the normal n: the cord lies along cos a e_1 + sin a (n x e_1). Two
systems are the same at every angle around: the default one if x is the axle, where e_1 is the
projection of global x (the meridian m towards larger x), and a cylindrical one about the axle with
its first axis as normal, where e_1 is e_theta. With n x m = s e_theta, s = 1 or -1, the angle from m
towards e_theta is s a in the first; in the second, as n x e_theta = -s m, it is
atan2(cos a, -s sin a).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tireroad.fem.decks.deck import (
    SCOPE,
    CardBlock,
    CordLayer,
    Deck,
    ElementShape,
    Members,
    Sets,
    used_kind,
)
from tireroad.fem.errors import InputError

_SAME = 1e-6  # of the body's size (positions) or of a radian (angles): tolerance for equality
_NODES = 2_000_000


@dataclass(frozen=True)
class Rings:
    """The nodes of a body about an axis.

    For each row of the deck's points the numbers of its ring (its position in the section) and of
    its angle; `places` (r, along) of the rings; `angles` ascending in rad.
    """

    axis: int
    ring: np.ndarray
    angle: np.ndarray
    places: np.ndarray
    angles: np.ndarray


def find_rings(deck: Deck, corners: np.ndarray) -> Rings:
    """The axis about which corner nodes form rings of equal angles. InputError if none."""
    best: tuple[int, int, int] = (len(corners) + 1, 0, 0)  # more positions than possible
    for axis in (1, 2, 0):
        rings = _rings(deck.points, axis, corners)
        pairs = np.unique(rings.ring[corners] * len(rings.angles) + rings.angle[corners])
        places, angles = (len(np.unique(part[corners])) for part in (rings.ring, rings.angle))
        if len(pairs) == len(corners) == places * angles and angles >= 3:
            return rings
        if places < best[0]:
            best = (places, angles, axis)
    raise InputError(
        f"{deck.file}: not a body of revolution about x, y or z through the origin: its {len(corners)} corner "
        f"nodes lie at {best[0]} places of the section and {best[1]} angles about {'xyz'[best[2]]}. Rolling is "
        "formulated about a body that is undeformed the same at every angle: bring its section"
    )


def _rings(points: np.ndarray, axis: int, corners: np.ndarray) -> Rings:
    """Rings and angles of all nodes about a coordinate axis."""
    first, second = points[:, (axis + 1) % 3], points[:, (axis + 2) % 3]
    r, along = np.hypot(first, second), points[:, axis]
    small = _SAME * max(np.ptp(points[corners], axis=0).max(), 1e-300)
    pair = _clusters(r, small) * (len(points) + 1) + _clusters(along, small)
    _, start, ring = np.unique(pair, return_index=True, return_inverse=True)
    theta = np.arctan2(second, first) % (2 * np.pi)
    theta[theta > 2 * np.pi - _SAME] = 0.0
    number = _clusters(theta, _SAME)
    used = np.unique(number[corners])
    _, begin = np.unique(number, return_index=True)
    angle = np.searchsorted(used, number)
    angle[~np.isin(number, used)] = -1
    return Rings(axis, ring.ravel(), angle, np.column_stack([r, along])[start], theta[begin][used])


def _clusters(values: np.ndarray, small: float) -> np.ndarray:
    """Group numbers of values, ascending; groups have no gap above `small`."""
    order = np.argsort(values)
    group = np.cumsum(np.diff(values[order], prepend=values[order[0]]) > small)
    out = np.empty(len(values), np.int64)
    out[order] = group
    return out


def meridian_layers(deck: Deck, senses: dict[int, int], rings: Rings) -> tuple[CordLayer, ...]:
    """The layers with angles from the meridian, for lines that run to larger axial coordinates.

    `senses` is s for each membrane. Raises InputError for systems that vary around the axle.
    """
    return tuple(_layer(deck, layer, senses, rings) for layer in deck.layers)


def _layer(deck: Deck, layer: CordLayer, senses: dict[int, int], rings: Rings) -> CordLayer:
    labels = deck.element_sets.labels(layer.elements, layer.place).tolist()
    sides = {senses[label] for label in labels if label in senses}
    if not sides:
        return layer
    if layer.geometry == "EDGE":
        around = _runs_around(deck, layer, rings)
        return replace(layer, geometry="CONSTANT", angle=90.0 if around else 0.0)
    circumferential = _from_circumference(deck, layer, rings.axis)
    angle = np.radians(layer.angle)
    slanted = abs(np.sin(2 * angle)) > 1e-9
    if len(sides) > 1 and slanted:
        raise layer.place.error(
            f"the normals of the membranes of {layer.elements} do not all point to one side, so the angle of "
            f"{layer.name} is not clear"
        )
    sense = sides.pop()
    if circumferential:
        angle = np.arctan2(
            circumferential * np.cos(angle), -sense * np.sin(angle) * circumferential
        )
    else:
        angle = sense * angle
    return replace(layer, angle=float(np.degrees(angle)))


def _runs_around(deck: Deck, layer: CordLayer, rings: Rings) -> bool:
    """Whether the edge to which a layer's cords are parallel runs around the axle, not along the meridian."""
    labels = deck.element_sets.labels(layer.elements, layer.place)
    senses: set[bool] = set()
    for block in deck.blocks:
        mine = np.isin(block.labels, labels)
        if block.kind.role == "membrane" and mine.any():
            rows = deck.rows(block.nodes[mine][:, :4], block.place)
            first, last = rings.ring[rows[:, layer.edge - 1]], rings.ring[rows[:, layer.edge % 4]]
            senses |= set((first == last).tolist())
    if len(senses) != 1:
        raise layer.place.error(
            f"cords {layer.name}: edge {layer.edge} of their elements runs around the axle in some and along "
            "the meridian in others"
        )
    return senses.pop()


def _from_circumference(deck: Deck, layer: CordLayer, axis: int) -> int:
    """0: angle from the meridian; 1 or -1: cylindrical system, axis along or against the axle."""
    if not layer.orientation:
        if axis == 0:
            return 0
        raise layer.place.error(
            f"cords {layer.name}: without ORIENTATION= their angle counts from the projection of x, which is "
            f"not the same around the axle {'xyz'[axis]}: give a cylindrical *ORIENTATION"
        )
    system = deck.orientations.get(layer.orientation)
    if system is None:
        raise layer.place.error(f"there is no *ORIENTATION, NAME={layer.orientation}")
    line = np.array(system.points[3:]) - np.array(system.points[:3])
    off = np.delete(np.array(system.points[:3]), axis)
    length = np.abs(line).max()
    about = length > 0 and np.abs(np.delete(line, axis)).max() < 1e-6 * length
    if not (system.system in ("CYLINDRICAL", "C") and about and not off.any()) or system.axis != 1:
        raise system.place.error(
            f"the system of cords {layer.name} must be cylindrical about the axle {'xyz'[axis]} with axis 1 as "
            "normal, so that their angle counts from the circumference"
        )
    if system.turn:
        raise system.place.error("a system with a further turn about its normal is not read")
    return 1 if line[axis] > 0 else -1


@dataclass
class _Section:
    """The section so far: the section element of each solid and membrane (`owner`), the corners of
    its cells (ring numbers), and the corners of all faces of every solid.
    """

    rings: Rings
    owner: dict[int, int] = field(default_factory=dict)
    corners: dict[int, list[int]] = field(default_factory=dict)
    faces: dict[int, list[frozenset]] = field(default_factory=dict)


def reduced(deck: Deck) -> tuple[Deck, np.ndarray | None]:
    """A two-dimensional deck as is; a body of revolution as section and ring angles (rad).

    Raises InputError for any other body."""
    if deck.dimension == 2:
        return deck, None
    if len(deck.points) > _NODES:
        raise InputError(f"{deck.file}: more than {_NODES} nodes: bring the section alone")
    solids = [b for b in deck.blocks if b.kind.role == "solid"]
    bad = next((b for b in solids if not b.kind.faces), None)
    if bad:
        raise bad.place.error(
            f"{bad.type}: tetrahedra cannot be a body of revolution; hexahedra and wedges can"
        )
    corners = [deck.rows(b.nodes[:, : b.kind.corners], b.place) for b in solids]
    for block, rows in zip(solids, corners, strict=True):
        _positive(deck, block, rows)
    rings = find_rings(deck, np.unique(np.concatenate([c.ravel() for c in corners])))
    section = _Section(rings)
    blocks = []
    for block, rows in zip(solids, corners, strict=True):
        blocks += _sections(deck, block, rows, section)
    _same_all_round(section, deck)
    membranes, senses = _membranes(deck, section)
    flat = replace(
        deck,
        labels=np.arange(1, len(rings.places) + 1),
        points=np.pad(rings.places, ((0, 0), (0, 1))),
        blocks=(*blocks, *membranes),
        node_sets=_node_sets(deck, rings),
        element_sets=_element_sets(deck, section.owner),
        surfaces={name: _surface(rows, section) for name, rows in deck.surfaces.items()},
        layers=meridian_layers(deck, senses, rings),
        used=(*deck.used, f"a body of revolution about {'xyz'[rings.axis]}: its section is used"),
    )
    return flat, rings.angles


def _positive(deck: Deck, block: CardBlock, rows: np.ndarray) -> None:
    """Check that the corner at the first node of every solid has a positive volume."""
    third, up = (3, 4) if block.kind.corners == 8 else (2, 3)
    at = deck.points[rows]
    edges = [at[:, k] - at[:, 0] for k in (1, third, up)]
    volume = np.einsum("ij,ij->i", np.cross(edges[0], edges[1]), edges[2])
    wrong = np.flatnonzero(volume <= 0)
    if len(wrong):
        raise block.place.error(
            f"element {block.labels[wrong[0]] % SCOPE} has a negative volume; {len(wrong)} of this block"
        )


def _sections(deck: Deck, block: CardBlock, rows: np.ndarray, section: _Section) -> list[CardBlock]:
    """Section cells of a block: the meridian face of each solid, listed once."""
    shape, rings = block.kind, section.rings
    every = rings.ring[deck.rows(block.nodes, block.place)]
    start = _meridian_faces(rings, shape.faces, rows, block)
    middle = _middles(shape)
    seen: dict[tuple, int] = {}
    cells: dict[int, list] = {}
    for label, ring, face in zip(block.labels.tolist(), every, start, strict=True):
        nodes = _cell(ring, shape.faces[face], middle, rings)
        key = tuple(sorted(nodes))
        if key not in seen:
            seen[key] = label
            cells.setdefault(len(nodes), []).append((label, nodes))
            section.corners[label] = nodes[: len(shape.faces[face])]
        section.owner[label] = seen[key]
        section.faces[label] = [frozenset(ring[list(f)].tolist()) for f in shape.faces]
    sections = []
    for size, those in cells.items():
        own, corners = np.array([c[0] for c in those]), np.array([c[1] for c in those]) + 1
        sections.append(
            CardBlock(f"CGAX{size}", used_kind(f"CGAX{size}"), own, corners, block.place)
        )
    return sections


def _cell(ring: np.ndarray, face: tuple, middle: dict, rings: Rings) -> list[int]:
    """Ring numbers of a section cell's nodes, corners first, counter-clockwise in (r, along)."""
    r, along = rings.places[ring[list(face)]].T
    if (r * np.roll(along, -1) - along * np.roll(r, -1)).sum() < 0:
        face = face[::-1]
    local = [*face]
    if middle:
        local += [middle[frozenset(pair)] for pair in zip(face, face[1:] + face[:1], strict=True)]
    return ring[local].tolist()


def _meridian_faces(
    rings: Rings, faces: Sequence[tuple[int, ...]], rows: np.ndarray, block: CardBlock
) -> np.ndarray:
    """For each solid the index of its first face with one angle and distinct rings."""
    row_of = np.full(len(rows), -1)
    for number in reversed(range(len(faces))):
        angle, ring = rings.angle[rows[:, faces[number]]], rings.ring[rows[:, faces[number]]]
        flat = (angle == angle[:, :1]).all(axis=1)
        apart = (np.diff(np.sort(ring, axis=1), axis=1) > 0).all(axis=1)
        row_of[flat & apart] = number
    spans = np.array([len(np.unique(angle)) for angle in rings.angle[rows]])
    wrong = np.flatnonzero((row_of < 0) | (spans != 2))
    if len(wrong):
        raise block.place.error(
            f"element {block.labels[wrong[0]] % SCOPE} does not reach from one meridian plane to the next: "
            "the body is not its section revolved"
        )
    return row_of


def _middles(shape: ElementShape) -> dict[frozenset, int]:
    """Local mid-edge node between two corners of quadratic solids, in Abaqus's order."""
    if shape.nodes in (6, 8):
        return {}
    count = shape.corners // 2
    around = [(k, (k + 1) % count) for k in range(count)]
    pairs = around + [(a + count, b + count) for a, b in around]
    return {frozenset(pair): shape.corners + k for k, pair in enumerate(pairs)}


def _same_all_round(section: _Section, deck: Deck) -> None:
    """Check that every cell of the section occurs once in each step around."""
    solids = [section.owner[label] for label in section.faces]
    _, counts = np.unique(np.array(solids), return_counts=True)
    around = len(section.rings.angles)
    if (counts != counts[0]).any() or counts[0] not in (around, around - 1):
        raise InputError(
            f"{deck.file}: not a body of revolution: cells of its section are there between {counts.min()} and "
            f"{counts.max()} times around, at {around} angles"
        )


def _membranes(deck: Deck, section: _Section) -> tuple[list[CardBlock], dict]:
    """Membranes as lines of the section, directed towards larger axial coordinates.

    Also, for each label, whether its normal x that direction points to growing angles (+1) or not
    (-1).
    """
    rings, blocks, senses = section.rings, [], {}
    for block in deck.blocks:
        if block.kind.role != "membrane" or block.kind.corners != 4:
            continue
        labels, nodes, seen = [], [], {}
        for label, rows in zip(
            block.labels.tolist(), deck.rows(block.nodes, block.place), strict=True
        ):
            ends = sorted(
                {int(n) for n in rings.ring[rows[:4]]},
                key=lambda n: (rings.places[n, 1], rings.places[n, 0]),
            )
            if len(ends) != 2:
                raise block.place.error(
                    f"membrane {label % SCOPE} does not reach from one meridian plane to the next"
                )
            key = tuple(ends)
            if key not in seen:
                seen[key] = label
                labels.append(label)
                nodes.append([n + 1 for n in ends])
            section.owner[label] = seen[key]
            senses[label] = _sense(deck.points[rows[:4]], rings, rows[:4], ends)
        if labels:
            blocks.append(
                CardBlock(
                    "SFMGAX1", used_kind("SFMGAX1"), np.array(labels), np.array(nodes), block.place
                )
            )
    return blocks, senses


def _sense(corners: np.ndarray, rings: Rings, rows: np.ndarray, ends: list[int]) -> int:
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    last = rings.ring[rows] == ends[1]
    along = corners[last].mean(axis=0) - corners[~last].mean(axis=0)
    turning = np.cross(np.eye(3)[rings.axis], corners.mean(axis=0))
    return 1 if np.cross(normal, along) @ turning > 0 else -1


def _node_sets(deck: Deck, rings: Rings) -> Sets:
    members = {}
    for name in deck.node_sets.names:
        labels = deck.node_sets.labels(name)
        labels = labels[np.isin(labels, deck.labels)]
        members[name] = Members([np.unique(rings.ring[deck.rows(labels)]) + 1])
    return Sets("node set", members, np.arange(1, len(rings.places) + 1))


def _element_sets(deck: Deck, owner: dict) -> Sets:
    members = {}
    for name in deck.element_sets.names:
        labels = deck.element_sets.labels(name).tolist()
        owners = sorted({owner[label] for label in labels if label in owner})
        members[name] = Members([np.array(owners, np.int64)])
    return Sets("element set", members, np.unique(np.array(list(owner.values()), np.int64)))


def _surface(rows: np.ndarray, section: _Section) -> np.ndarray:
    """(section label, face of its cell) of faces around the axis; membranes unchanged."""
    faces = set()
    for label, face in rows.tolist():
        cell = section.owner.get(label)
        if cell is None:
            continue
        if label not in section.faces or face < 0:
            faces.add((cell, face))
        elif face < len(section.faces[label]):
            ends, corners = section.faces[label][face], section.corners[cell]
            pairs = [{a, b} for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
            faces |= {(cell, k) for k, pair in enumerate(pairs) if pair == ends}
    return np.array(sorted(faces), np.int64).reshape(-1, 2)
