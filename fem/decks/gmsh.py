"""Reader of Gmsh meshes, .msh 2.2 and 4.1, text and binary.

Physical groups of the highest dimension become element sets, those one dimension lower surfaces. A
section lies in the plane z = 0, with x the distance from the axle and y along it. Counts are
checked against the file's size before memory is allocated.
"""

from __future__ import annotations

import re
import shlex
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tireroad.fem.decks.deck import (
    ALL_FACES,
    LABEL,
    CardBlock,
    Deck,
    Members,
    Place,
    Sets,
    used_kind,
)
from tireroad.fem.errors import InputError

# Type number: dimension, nodes, Abaqus name, indices of its nodes in Abaqus's order.
_HEXAHEDRON = (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)


_WEDGE = (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11)


TYPES = {
    1: (1, 2, "SFMGAX1", (0, 1)),
    8: (1, 3, "SFMGAX2", (0, 1, 2)),
    2: (2, 3, "CGAX3", (0, 1, 2)),
    3: (2, 4, "CGAX4", (0, 1, 2, 3)),
    9: (2, 6, "CGAX6", tuple(range(6))),
    10: (2, 9, "CGAX8", tuple(range(8))),
    16: (2, 8, "CGAX8", tuple(range(8))),
    5: (3, 8, "C3D8", tuple(range(8))),
    6: (3, 6, "C3D6", tuple(range(6))),
    17: (3, 20, "C3D20", _HEXAHEDRON),
    12: (3, 27, "C3D20", _HEXAHEDRON),
    18: (3, 15, "C3D15", _WEDGE),
    13: (3, 18, "C3D15", _WEDGE),
    15: (0, 1, "", (0,)),
}


FACES = {2: ("M3D3", 3), 3: ("M3D4", 4), 9: ("M3D6", 6), 10: ("M3D9", 9), 16: ("M3D8", 8)}


LARGEST = 1 << 29  # bytes
_BEGIN = re.compile(rb"^\$([A-Za-z]+)[ \t\r]*\n", re.MULTILINE)
Elements = list[tuple[int, tuple[int, ...], int, np.ndarray]]  # type, physical groups, label, nodes
Groups = dict[tuple[int, int], tuple[int, ...]]  # (dimension, entity) -> its physical groups


@dataclass(frozen=True)
class Part:
    """The content between $Name and $EndName, and where it begins."""

    text: bytes
    place: Place

    def line(self, offset: int) -> Place:
        return Place(self.place.file, self.place.line + offset)


def parts(data: bytes, name: str) -> dict[str, Part]:
    """The parts of a file by name, the first of each. InputError for a part without end."""
    parts: dict[str, Part] = {}
    at, line = 0, 1
    while match := _BEGIN.search(data, at):
        line += data.count(b"\n", at, match.end())
        title = match[1].decode()
        end = data.find(b"$End" + match[1], match.end())
        if end < 0:
            raise Place(name, line).error(f"${title} has no $End{title}: is the file cut short?")
        parts.setdefault(title, Part(data[match.end() : end], Place(name, line)))
        line += data.count(b"\n", match.end(), end)
        at = end + 1
    return parts


class _Numbers:
    """Sequential reader of a part's numbers. Raises InputError if there are too few."""

    binary: bool

    def __init__(self, part: Part) -> None:
        self.part = part

    def error(self, message: str) -> InputError:
        return self.part.place.error(message)

    def fits(self, count: int, size: int) -> int:
        """The count, if the part can hold that many items of `size` bytes (or characters)."""
        if not count >= 0 or count * (size if self.binary else 2) > len(self.part.text) + 64:
            raise self.error(f"{count} entries are announced and not there: is the file cut short?")
        return int(count)


class TextNumbers(_Numbers):
    """Numbers written as text."""

    binary = False

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self._at = 0
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self._all = np.fromstring(part.text.replace(b"\n", b" "), sep=" ")
            except (DeprecationWarning, ValueError):
                raise self.error("something in this part is not a number") from None

    def reals(self, count: int) -> np.ndarray:
        if self._at + count > len(self._all):
            raise self.error("numbers are missing: is the file cut short?")
        self._at += count
        return self._all[self._at - count : self._at]

    def ints(self, count: int) -> np.ndarray:
        values = self.reals(count)
        with np.errstate(invalid="ignore"):
            if not ((values == np.floor(values)) & (np.abs(values) < 2**53)).all():
                raise self.error("a whole number was expected")
        return values.astype(np.int64)

    sizes = ints

    def labelled_points(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Labels (n,) and points (n, 3), stored node by node."""
        table = self.reals(4 * count).reshape(count, 4)
        if not (table[:, 0] == np.floor(table[:, 0])).all():
            raise self.error("a node's label is not a whole number")
        return table[:, 0].astype(np.int64), table[:, 1:].copy()


class BinaryNumbers(_Numbers):
    """Numbers in Gmsh's binary format: int32, uint64, float64."""

    binary = True

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self._at = 0

    def _take(self, kind: str, count: int) -> np.ndarray:
        size = int(count) * np.dtype(kind).itemsize
        # Format 2.2 writes the first count of a part as text.
        if self._at + size > len(self.part.text):
            raise self.error("data are missing: is the file cut short?")
        self._at += size
        return np.frombuffer(self.part.text, kind, int(count), self._at - size)

    def reals(self, count: int) -> np.ndarray:
        return self._take("<f8", count)

    def ints(self, count: int) -> np.ndarray:
        if self._at == 0 and self.part.text[:1].isdigit() and b"\n" in self.part.text[:20]:
            first, _, _ = self.part.text.partition(b"\n")
            if first.strip().isdigit():
                self._at = len(first) + 1
                return np.array([int(first)])
        return self._take("<i4", count).astype(np.int64)

    def sizes(self, count: int) -> np.ndarray:
        values = self._take("<u8", count)
        if (values > 2**53).any():
            raise self.error("a count or label is out of range")
        return values.astype(np.int64)

    def labelled_points(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Labels (n,) and points (n, 3), one record per node."""
        table = self._take("<u1", 28 * count).reshape(count, 28)
        labels = np.ascontiguousarray(table[:, :4]).view("<i4")[:, 0].astype(np.int64)
        return labels, np.ascontiguousarray(table[:, 4:]).view("<f8").copy()


Numbers = TextNumbers | BinaryNumbers


def read(path: Path) -> Deck:
    """The mesh in a file. Raises InputError with file and line for errors in it."""
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise InputError(f"{path}: larger than {LARGEST >> 20} MB")
        by_name = parts(path.read_bytes(), path.name)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    version, binary = _format(by_name, path)
    needed = ("Nodes", "Elements") + (("Entities",) if version == "4.1" else ())
    if "ParametricNodes" in by_name and "Nodes" not in by_name:
        by_name["Nodes"] = _plain_nodes(by_name["ParametricNodes"], binary)
    for name in needed:
        if name not in by_name:
            raise InputError(f"{path.name}: no ${name} in it: is the file cut short?")
    numbers = BinaryNumbers if binary else TextNumbers
    names = _names(by_name.get("PhysicalNames"))
    if version == "4.1":
        groups = _entities(numbers(by_name["Entities"]))
        if "PartitionedEntities" in by_name:
            groups |= _partitioned(numbers(by_name["PartitionedEntities"]))
        labels, points = _nodes_4(numbers(by_name["Nodes"]))
        elements = _elements_4(numbers(by_name["Elements"]), groups)
    else:
        labels, points = _nodes_2(numbers(by_name["Nodes"]))
        elements = _elements_2(numbers(by_name["Elements"]), binary)
    return _deck(path, labels, points, elements, names, by_name["Elements"])


def _format(parts: dict[str, Part], path: Path) -> tuple[str, bool]:
    part = parts.get("MeshFormat")
    if part is None:
        raise InputError(f"{path}: no $MeshFormat: this is not a Gmsh mesh")
    words = part.text.split(None, 3)[:3]
    if len(words) < 3 or words[0] not in (b"2.2", b"4.1") or words[1] not in (b"0", b"1"):
        raise part.place.error("the mesh must be of format 2.2 or 4.1 (gmsh -format msh41)")
    if words[1] == b"1" and b"\1\0\0\0" not in part.text:
        raise part.place.error("a binary mesh of another byte order is not read")
    return words[0].decode(), words[1] == b"1"


def _names(part: Part | None) -> dict[tuple[int, int], str]:
    """(dimension, number) -> name of the physical groups."""
    names: dict[tuple[int, int], str] = {}
    if part is None:
        return names
    for offset, line in enumerate(part.text.splitlines()):
        words = line.decode("utf-8", "replace").split(None, 2)
        if len(words) < 3:
            continue
        try:
            name = shlex.split(words[2])[0]
            names[int(words[0]), int(words[1])] = name
        except (ValueError, IndexError):
            raise part.line(offset).error('a physical name is: dimension number "name"') from None
    return names


def _entities(numbers: Numbers) -> Groups:
    """The physical groups of all entities."""
    return dict(_entity(numbers, dimension) for dimension in _each(numbers))


def _partitioned(numbers: Numbers) -> Groups:
    """The physical groups of the parts that a partitioned mesh (gmsh -part) has its entities in."""
    numbers.sizes(1)
    numbers.ints(2 * numbers.fits(numbers.sizes(1)[0], 4))  # ghosts: entity, partition
    return dict(_entity(numbers, dimension, parts=True) for dimension in _each(numbers))


def _each(numbers: Numbers) -> Iterator[int]:
    """The dimension of each entity that follows."""
    for dimension, count in enumerate(numbers.sizes(4)):
        yield from [dimension] * numbers.fits(count, 4)


def _entity(
    numbers: Numbers, dimension: int, parts: bool = False
) -> tuple[tuple[int, int], tuple[int, ...]]:
    """An entity with its groups; `parts`: behind its parent, and the partitions that it is in."""
    (tag,) = numbers.ints(1)
    if parts:
        numbers.ints(2)
        numbers.ints(numbers.fits(numbers.sizes(1)[0], 4))
    numbers.reals(3 if dimension == 0 else 6)
    physical = numbers.ints(numbers.fits(numbers.sizes(1)[0], 4))
    if dimension:
        numbers.ints(numbers.fits(numbers.sizes(1)[0], 4))
    return (dimension, int(tag)), tuple(dict.fromkeys(np.abs(physical).tolist()))


def _nodes_4(numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    blocks, total, *_ = numbers.sizes(4)
    numbers.fits(total, 8)
    labels, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for _ in range(numbers.fits(blocks, 4)):
        dimension, _, parametric = numbers.ints(3)
        count = numbers.fits(numbers.sizes(1)[0], 8)
        labels.append(numbers.sizes(count))
        if not 0 <= dimension <= 3:
            raise numbers.error(f"nodes of an entity of dimension {dimension}")
        width = 3 + (int(dimension) if parametric else 0)
        points.append(numbers.reals(width * count).reshape(count, width)[:, :3])
    return np.concatenate(labels), np.concatenate(points)


def _elements_4(numbers: Numbers, groups: Groups) -> Elements:
    blocks, total, *_ = numbers.sizes(4)
    numbers.fits(total, 8)
    elements: Elements = []
    for _ in range(numbers.fits(blocks, 4)):
        dimension, tag, sort = (int(value) for value in numbers.ints(3))
        count = numbers.fits(numbers.sizes(1)[0], 8)
        width = 1 + _nodes_of(sort, numbers)
        table = numbers.sizes(count * width).reshape(count, width)
        group = groups.get((dimension, tag), ())
        elements += [(sort, group, int(row[0]), row[1:]) for row in table]
    return elements


def _nodes_of(sort: int, numbers: Numbers) -> int:
    if sort not in TYPES:
        raise numbers.error(
            f"element type {sort} of Gmsh is not read: lines, triangles, quadrilaterals, hexahedra and "
            "wedges of first and second order are"
        )
    return TYPES[sort][1]


def _plain_nodes(part: Part, binary: bool) -> Part:
    """Nodes that Gmsh 2.2 wrote with Mesh.SaveParametric: of each line the label and the place."""
    if binary:
        raise part.place.error(
            "binary nodes with parameters (Mesh.SaveParametric = 1) are not read: save with 0, or as text"
        )
    lines = [line.split(None, 4)[:4] for line in part.text.splitlines() if line.strip()]
    return Part(b"\n".join(b" ".join(words) for words in lines), part.place)


def _nodes_2(numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    (count,) = numbers.ints(1)
    numbers.fits(count, 4)
    return numbers.labelled_points(int(count))


def _elements_2(numbers: Numbers, binary: bool) -> Elements:
    (count,) = numbers.ints(1)
    numbers.fits(count, 4)
    elements: Elements = []
    while len(elements) < count:
        if binary:
            sort, many, tags = (int(value) for value in numbers.ints(3))
        else:
            label, sort, tags = (int(value) for value in numbers.ints(3))
            many = 1
        if many < 1 or not 0 <= tags <= 100:
            raise numbers.error(f"elements with {tags} tags")
        width = _nodes_of(sort, numbers) + tags + (1 if binary else 0)
        table = numbers.ints(numbers.fits(many, 4 * width) * width).reshape(many, width)
        if not binary:
            table = np.insert(table, 0, label, axis=1)
        group = table[:, 1] if tags else np.zeros(many, np.int64)
        elements += [
            (sort, (int(g),) if g else (), int(row[0]), row[1 + tags :])
            for g, row in zip(group, table, strict=True)
        ]
    return _once(elements)


def _once(elements: Elements) -> Elements:
    """Elements that format 2.2 writes once for each of their groups, as one."""
    first: dict[tuple[int, bytes], int] = {}
    single: Elements = []
    for sort, groups, label, nodes in elements:
        at = first.setdefault((sort, nodes.tobytes()), len(single))
        if at == len(single):
            single.append((sort, groups, label, nodes))
        else:
            known = single[at]
            single[at] = (sort, tuple(dict.fromkeys((*known[1], *groups))), *known[2:])
    return single


def _deck(
    path: Path,
    labels: np.ndarray,
    points: np.ndarray,
    elements: Elements,
    names: dict[tuple[int, int], str],
    part: Part,
) -> Deck:
    if not (len(labels) and len(elements)):
        raise InputError(
            f"{path.name}: not a mesh: {len(labels)} nodes and {len(elements)} elements"
        )
    dimension = max(TYPES[sort][0] for sort, *_ in elements)
    order = np.argsort(labels, kind="stable")
    labels, points = labels[order], points[order]
    if labels[0] < 1 or (np.diff(labels) < 1).any():
        raise InputError(f"{path.name}: node labels must be different and above 0")
    if labels[-1] > LABEL or max(label for _, _, label, _ in elements) > LABEL:
        labels, elements = _renumbered(labels, elements, part)
    if not np.isfinite(points).all():
        raise InputError(f"{path.name}: a coordinate is not a number")
    if dimension == 2 and np.abs(points[:, 2]).max() > 1e-9 * max(np.ptp(points), 1e-300):
        raise InputError(f"{path.name}: a section must lie in z = 0, x from the axle, y along it")
    if names and not any(group for _, group, *_ in elements):
        raise part.place.error(
            "the file defines physical groups, but no element belongs to one: it was saved with Mesh.SaveAll = 1, "
            "which in format 2.2 loses them. Save with Mesh.SaveAll = 0, or in format 4.1 (gmsh -format msh41)"
        )
    blocks, sets, surfaces = _groups(elements, dimension, names, part)
    known = np.unique([e[2] for e in elements])
    deck = Deck(
        file=path.name,
        labels=labels,
        points=points,
        blocks=tuple(blocks),
        node_sets=Sets("node set", {}, labels),
        element_sets=Sets("element set", sets, known),
        surfaces=surfaces,
        used=(f"{len(labels)} nodes", *(f"{len(b.labels)} elements {b.type}" for b in blocks)),
        lines=tuple(surfaces),
    )
    return _counter_clockwise(deck) if dimension == 2 else deck


def _renumbered(labels: np.ndarray, elements: Elements, part: Part) -> tuple[np.ndarray, Elements]:
    """Nodes and elements numbered from 1, where labels are larger than this program's."""
    nodes = np.concatenate([element[3] for element in elements])
    at = np.minimum(np.searchsorted(labels, nodes), len(labels) - 1)
    if (labels[at] != nodes).any():
        raise part.place.error(f"node {nodes[labels[at] != nodes][0]} of an element is not there")
    split = np.split(at + 1, np.cumsum([len(element[3]) for element in elements])[:-1])
    renumbered = [
        (sort, groups, k, own)
        for k, ((sort, groups, *_), own) in enumerate(zip(elements, split, strict=True), 1)
    ]
    return np.arange(1, len(labels) + 1), renumbered


def _groups(
    elements: Elements, dimension: int, names: dict[tuple[int, int], str], part: Part
) -> tuple[list[CardBlock], dict[str, Members], dict[str, np.ndarray]]:
    """Blocks by type, element sets and surfaces by group."""
    by_type: dict[int, list] = {}
    for element in elements:
        by_type.setdefault(element[0], []).append(element)
    blocks: list[CardBlock] = []
    sets: dict[str, Members] = {}
    surfaces: dict[str, np.ndarray] = {}
    for sort, those in by_type.items():
        own, _, name, take = TYPES[sort]
        if own not in (dimension, dimension - 1) or own == 0:
            continue
        if own == 2 and dimension == 3:
            name, count = FACES[sort]
            take = tuple(range(count))
        labels = np.array([e[2] for e in those], np.int64)
        nodes = np.array([e[3] for e in those], np.int64)[:, list(take)]
        blocks.append(CardBlock(name, used_kind(name), labels, nodes, part.place))
        for number in sorted({tag for e in those for tag in e[1] or (0,)}):
            title = names.get((own, number), f"{'group' if number else 'no group'} {number}")
            mine = np.array([e[2] for e in those if number in (e[1] or (0,))], np.int64)
            if own == dimension:
                sets.setdefault(title.upper(), Members()).labels.append(mine)
            elif number:
                rows = np.column_stack([mine, np.full(len(mine), ALL_FACES)])
                surfaces[title] = np.concatenate(
                    [surfaces.get(title, np.empty((0, 2), np.int64)), rows]
                )
    return blocks, sets, surfaces


def _counter_clockwise(deck: Deck) -> Deck:
    """Reverse elements with clockwise nodes, since Gmsh follows the orientation of each surface."""
    for block in deck.blocks:
        count = block.kind.corners
        if block.kind.role != "solid":
            continue
        corners = deck.points[deck.rows(block.nodes[:, :count], block.place)][:, :, :2]
        x, y = corners[..., 0], corners[..., 1]
        area = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
        turn = [0, *range(count - 1, 0, -1)]
        if block.kind.nodes > count:
            turn += [2 * count - 1 - k for k in range(count)]
        block.nodes[area < 0] = block.nodes[area < 0][:, turn]
    return deck
