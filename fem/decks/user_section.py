"""From a mesh file or a section file to a section with compounds and cords."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tireroad.fem.decks import abaqus, gmsh, revolved
from tireroad.fem.decks.compounds import (
    SYSTEMS,
    Rubber,
    Units,
    check_size,
    cord,
    density_of,
    rubber,
)
from tireroad.fem.decks.deck import (
    ALL_FACES,
    BOTH_SIDES,
    SCOPE,
    CardBlock,
    CordLayer,
    Deck,
    Place,
    missing,
)
from tireroad.fem.decks.embedding import LaidMembranes, Origins, Ply, lay_all, plies
from tireroad.fem.decks.quads import (
    DeckEdges,
    Quads,
    build,
    ends,
    faces,
    forward,
    is_half,
    mirrored,
    on_outline,
    one_body,
    strings,
    with_origin,
)
from tireroad.fem.errors import InputError
from tireroad.fem.sections import section_file
from tireroad.fem.sections.construction import Construction, CordLine
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.tire.material import power_law

_PLANE = re.compile(r"ELEMENT, TYPE=(CP[SE]\d+\w*)")
ELEMENTS = 26  # bead to bead, as in the built-in radial tire
MERGE = 1e-6  # m
MESHES = {".inp": abaqus.read, ".msh": gmsh.read}


def named_edges(deck: Deck, edges: DeckEdges, name: str, key: str) -> np.ndarray:
    """Edge numbers of a surface, node set or membrane set. InputError for other names.

    `key` is the scene's key, for the message. Where a part and the assembly both have that name, it
    is the assembly's."""
    surfaces = {surface.upper(): surface for surface in deck.surfaces}
    whole = f"{name} (ASSEMBLY)"
    if whole.upper() in surfaces or whole in deck.node_sets or whole in deck.element_sets:
        name = whole
    if name.upper() in surfaces:
        return _of_surface(deck, edges, deck.surfaces[surfaces[name.upper()]])
    if name in deck.node_sets:
        labels = deck.node_sets.labels(name)
        return edges.between(deck.rows(labels[np.isin(labels, deck.labels)]))
    if name in deck.element_sets:
        return membrane_edges(deck, edges, deck.element_sets.labels(name))
    raise InputError(f"tire.{key}: {missing('surface or node set', name, deck.face_names)}")


def _of_surface(deck: Deck, edges: DeckEdges, rows: np.ndarray) -> np.ndarray:
    order = np.argsort(edges.labels)
    at = np.searchsorted(edges.labels[order], rows[:, 0])
    at = order[np.minimum(at, len(order) - 1)]
    solid = edges.labels[at] == rows[:, 0]
    one = solid & (rows[:, 1] >= 0) & (rows[:, 1] < 4)
    edges_found = [edges.faces[at[one], rows[one, 1]]]
    every = solid & (rows[:, 1] == ALL_FACES)
    edges_found.append(edges.faces[at[every]].ravel())
    membranes = rows[~solid & np.isin(rows[:, 1], (ALL_FACES, BOTH_SIDES)), 0]
    edges_found.append(membrane_edges(deck, edges, membranes))
    numbers = np.concatenate(edges_found)
    return np.unique(numbers[numbers >= 0])


def membrane_edges(deck: Deck, edges: DeckEdges, labels: np.ndarray) -> np.ndarray:
    """Numbers of the edges on which membranes of the given labels lie."""
    found = [np.empty(0, np.int64)]
    for block in deck.blocks:
        if block.kind.role == "membrane":
            mine = np.isin(block.labels, labels)
            ends = deck.rows(
                block.nodes[mine][:, [0, -1 if block.kind.nodes == 2 else 1]], block.place
            )
            found.append(edges.numbers(ends))
    numbers = np.concatenate(found)
    return numbers[numbers >= 0]


@dataclass(frozen=True)
class Regions:
    """Names of the regions, their materials in the deck (None: none), the place that defines each,
    and the region number of every element label (`of`).
    """

    names: tuple[str, ...]
    materials: tuple[str | None, ...]
    places: tuple[Place, ...]
    of: dict[int, int]
    notes: tuple[str, ...] = ()


def no_solids(deck: Deck) -> InputError:
    """The error for a deck without solid elements that are read, with the types that it has."""
    plane = next((match[1] for text in deck.unused if (match := _PLANE.search(text))), None)
    if plane:
        axisymmetric = re.sub(r"CP[SE](\d)R?\w*", r"CGAX\1", plane)
        why = (
            f"it has plane elements, {plane} (Gmsh writes a section so): save it as .msh, or rename them {axisymmetric}, with x "
            "from the axle and y along it"
        )
    else:
        why = "CGAX, CAX (sections) and C3D types are read, and quadrilaterals, triangles, hexahedra and wedges of Gmsh"
    return InputError(f"{deck.file}: no solid element in it: {why}")


def regions(deck: Deck) -> Regions:
    """The solid sections of a deck or, if it has none, its element sets."""
    blocks = [b for b in deck.blocks if b.kind.role == "solid" and len(b.labels)]
    if not blocks:
        raise no_solids(deck)
    labels = np.sort(np.concatenate([block.labels for block in blocks]))
    if not deck.solids:
        return _by_set(deck, blocks, labels)
    names: list[str] = []
    of: dict[int, int] = {}
    materials, places = [], []
    for solid in deck.solids:
        mine = np.intersect1d(deck.element_sets.labels(solid.elements, solid.place), labels)
        if not len(mine):
            continue
        twice = next((label for label in mine.tolist() if label in of), None)
        if twice is not None:
            raise solid.place.error(
                f"element {twice % SCOPE} is in two solid sections, {names[of[twice]]} and {solid.elements}"
            )
        of.update(dict.fromkeys(mine.tolist(), len(names)))
        names.append(solid.elements)
        materials.append(solid.material)
        places.append(solid.place)
    left = np.setdiff1d(labels, np.fromiter(of, np.int64, len(of)))
    if len(left):
        raise InputError(
            f"{deck.file}: {len(left)} solid elements are in no *SOLID SECTION, element {left[0] % SCOPE} for one"
        )
    return Regions(tuple(names), tuple(materials), tuple(places), of)


def _by_set(deck: Deck, blocks: list[CardBlock], labels: np.ndarray) -> Regions:
    """One region per element set, smallest sets first, and one for the remaining elements."""
    sets = {
        name: np.intersect1d(deck.element_sets.labels(name), labels)
        for name in deck.element_sets.names
    }
    names: list[str] = []
    of: dict[int, int] = {}
    notes = [
        "no solid sections: the regions are the element sets, their materials those of the scene"
    ]
    for name, mine in sorted(sets.items(), key=lambda item: len(item[1])):
        new = [label for label in mine.tolist() if label not in of]
        if new:
            of.update(dict.fromkeys(new, len(names)))
            names.append(name)
        if len(new) < len(mine):
            others = ", ".join(sorted({names[of[label]] for label in mine.tolist()} - {name}))
            rest = f"{len(new)} elements are its region" if new else "it is no region"
            notes.append(
                f"{name}: {len(mine) - len(new)} of its {len(mine)} elements are in {others}, too: {rest}"
            )
    left = [label for label in labels.tolist() if label not in of]
    if left:
        of.update(dict.fromkeys(left, len(names)))
        names.append("WALL")
    place = blocks[0].place
    count = len(names)
    return Regions(tuple(names), (None,) * count, (place,) * count, of, tuple(notes))


def drawn(path: Path) -> tuple[SectionMesh, tuple[Rubber, ...], tuple[Ply, ...]]:
    """Mesh of order 2, compound of each region, cords. Raises InputError with the file's name."""
    construction = section_file.read(path)
    try:
        mesh = construction.section(ELEMENTS)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    rubbers = tuple(_rubber(construction, name) for name in mesh.regions)
    return mesh, rubbers, tuple(_ply(line, mesh) for line in construction.cords)


def _rubber(construction: Construction, name: str) -> Rubber:
    values = construction.compounds[name]
    coefficients = {key: values[key] for key in ("youngs_modulus", "poisson_ratio")}
    return Rubber(
        name=name,
        model="neo-hookean",
        coefficients=coefficients,
        density=values["density"],
        dynamic=values["dynamic"],
        loss_factor=values["loss_factor"],
        spectrum=power_law(values["exponent"]) if values["exponent"] else None,
    )


def _ply(line: CordLine, mesh: SectionMesh) -> Ply:
    given = {key: value for key, value in vars(line).items() if key not in ("under", "to")}
    return Ply(sides=mesh.plies[line.name], **given)


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """Settings of the scene for a file: face names, length unit ("m", "mm", "in"), half section.

    `merge` m: nodes nearer than this are one, 0: none are. `materials`: regions or materials that
    the scene defines itself; the deck's are ignored.
    """

    inner: str | None = None
    tread: str | None = None
    rim: tuple[str, ...] = ()
    length_unit: str = "m"
    mirror: bool = False
    merge: float = MERGE
    materials: frozenset[str] = frozenset()


@dataclass(frozen=True, kw_only=True)
class OwnSection:
    """A section from a file, in SI: mesh of order 2, compounds (None: not in the file), cords.

    `used`, `unused` and `notes` are lines for the user: what was read, what was not, and what was
    guessed or interpreted differently. `ring_angles` (rad): of a three-dimensional deck.
    """

    mesh: SectionMesh
    rubbers: tuple[Rubber | None, ...]
    plies: tuple[Ply, ...]
    used: tuple[str, ...]
    unused: tuple[str, ...]
    notes: tuple[str, ...]
    ring_angles: np.ndarray | None = field(default=None, repr=False)


def read(path: Path | str, wishes: Wishes | None = None) -> OwnSection:
    """Section of an Abaqus deck (.inp), Gmsh mesh (.msh) or section file (.toml). Not collective.

    Raises InputError, with file and line, for anything that prevents its use as a tire section.
    """
    path, wishes = Path(path), wishes or Wishes()
    if path.suffix.lower() == ".toml":
        mesh, rubbers, plies = drawn(path)
        read_all = (f"all of {path.name}",)
        return OwnSection(
            mesh=mesh, rubbers=rubbers, plies=plies, used=read_all, unused=(), notes=()
        )
    if path.suffix.lower() not in MESHES:
        raise InputError(
            f"{path}: a section is read from .inp (Abaqus), .msh (Gmsh) or .toml (section file)"
        )
    return section_of(MESHES[path.suffix.lower()](path), wishes)


def section_of(deck: Deck, wishes: Wishes) -> OwnSection:
    """Section of a deck or mesh that has been read. Raises InputError as `read` does."""
    try:
        return _section(*revolved.reduced(deck), wishes)
    except InputError as error:
        text = str(error)
        raise error if deck.file in text else InputError(f"{deck.file}: {text}") from None


def _section(deck: Deck, ring_angles: np.ndarray | None, wishes: Wishes) -> OwnSection:
    units = SYSTEMS[wishes.length_unit]
    found = regions(deck)
    _check_radius(deck, wishes.length_unit)
    deck, together = deck.merged(wishes.merge / units.length)
    quads, edges, split = build(deck, found.of)
    one_body(quads, lambda label: f"element {label % SCOPE}")
    origins = Origins(len(edges.ends))
    quads, laid = lay_all(deck, quads, edges, origins)
    named = {
        key: [origins.with_parts(named_edges(deck, edges, name, key)) for name in names]
        for key, names in _names(deck, wishes).items()
    }
    quads = _both_halves(quads, wishes)
    laid = {name: layer.mirrored() if wishes.mirror else layer for name, layer in laid.items()}
    rim, inner, tread = (_sides(quads, named[key], key) for key in ("rim", "inner", "tread"))
    assert rim is not None, "_names() refuses a deck without a rim"
    shape = faces(quads, rim, inner, tread)
    layers = _cords(deck, quads, laid, units)
    lines = {ply.name: ply.sides for ply in layers} | _lines(deck, quads, edges, origins, wishes)
    compounds = _rubbers(deck, found, units, wishes)
    centred, shift = _centred(quads.points * units.length)
    mesh = SectionMesh(
        order=2,
        nodes=centred,
        cells=quads.cells,
        region=quads.region,
        regions=found.names,
        outer=shape.outer,
        tread=shape.tread,
        inner=shape.inner,
        rim=shape.rim,
        plies=lines,
    )
    notes = [*shape.notes, *_said(deck, split, shift, wishes, found, units)]
    if together:
        notes.append(
            f"{together} nodes nearer than {wishes.merge:g} m to another are one with it (tire.merge)"
        )
    notes += [note for compound in compounds if compound for note in compound.notes]
    return OwnSection(
        mesh=mesh,
        rubbers=tuple(compounds),
        plies=tuple(layers),
        used=deck.used,
        unused=deck.unused,
        notes=tuple(dict.fromkeys(notes)),
        ring_angles=ring_angles,
    )


def _check_radius(deck: Deck, unit: str) -> None:
    solids = [b for b in deck.blocks if b.kind.role == "solid"]
    r = deck.points[np.concatenate([deck.rows(b.nodes, b.place).ravel() for b in solids]), 0]
    if r.min() < 0:
        raise InputError(
            f"a node at r = {r.min():.5g}: the first column is the distance from the axle, r ≥ 0"
        )
    check_size(float(r.max()), unit, deck.file)


def _names(deck: Deck, wishes: Wishes) -> dict[str, tuple[str, ...]]:
    """The sets that form each face: the scene's, otherwise those the deck holds or pressurises."""
    rim = wishes.rim or tuple(dict.fromkeys(name for name, _ in deck.held))
    if not rim and "RIM" in {name.upper() for name in deck.face_names}:
        rim = ("RIM",)
    if not rim:
        raise InputError(
            "nothing says what the wheel holds: name node sets or surfaces in tire.rim; there are: "
            + (", ".join(deck.face_names) or "none")
        )
    pressed = [name for name in dict.fromkeys(deck.pressed) if name in deck.surfaces]
    guess = {name.upper(): name for name in deck.face_names}
    inner = wishes.inner or guess.get("INNER") or (pressed[0] if len(pressed) == 1 else None)
    tread = wishes.tread or next((guess[n] for n in ("TREAD", "STREAD") if n in guess), None)
    return {
        "rim": rim,
        "inner": (inner,) if inner else (),
        "tread": (tread,) if tread else (),
    }


def _both_halves(quads: Quads, wishes: Wishes) -> Quads:
    if wishes.mirror:
        return mirrored(quads)
    if is_half(quads):
        raise InputError(
            "the section ends on z = 0 and lies on one side of it: half a tire? Then tire.mirror = true"
        )
    return quads


def _sides(quads: Quads, numbers: list[np.ndarray], key: str) -> np.ndarray | None:
    """The sides of the outline that lie on the named edges; None if nothing was named."""
    if not numbers:
        return None
    sides = on_outline(quads, with_origin(quads, np.concatenate(numbers)))
    if not len(sides):
        raise InputError(f"tire.{key}: what it names has no side on the outline of the section")
    return sides


def _cords(deck: Deck, quads: Quads, laid: dict[str, LaidMembranes], units: Units) -> list[Ply]:
    laid_plies: list[Ply] = []
    for layer in deck.layers:
        if layer.elements not in laid:
            continue
        if layer.material not in deck.materials:
            known = ", ".join(deck.materials) or "none"
            raise layer.place.error(f"there is no material {layer.material}; there are: {known}")
        material = cord(deck.materials[layer.material], units)
        lines = plies(quads, laid[layer.elements], layer, material, units.length)
        itself = _mass_per_area(deck, layer, units)
        # Carried by the cords, whose mass per area is density A / s.
        laid_plies += [
            replace(ply, density=ply.density + itself * ply.spacing / ply.area) for ply in lines
        ]
    laid_plies = [replace(ply, name=ply.name.replace("/", "-")) for ply in laid_plies]
    names = [ply.name for ply in laid_plies]
    return [
        replace(ply, name=f"{ply.name} [{n + 1}]") if names.count(ply.name) > 1 else ply
        for n, ply in enumerate(laid_plies)
    ]


def _mass_per_area(deck: Deck, layer: CordLayer, units: Units) -> float:
    """Mass of a layer's membrane itself, kg/m2: of *SURFACE SECTION, DENSITY=, or of its material."""
    mass = layer.mass * units.density * units.length
    if layer.covering is None:
        return mass
    name, thickness = layer.covering
    if name not in deck.materials:
        known = ", ".join(deck.materials) or "none"
        raise layer.place.error(f"there is no material {name}; there are: {known}")
    return mass + (density_of(deck.materials[name], units) or 0.0) * thickness * units.length


def _lines(deck: Deck, quads: Quads, edges: DeckEdges, origins: Origins, wishes: Wishes) -> dict:
    """Named lines inside the body of a Gmsh mesh, for cords of the scene."""
    faces_named = {name.upper() for names in _names(deck, wishes).values() for name in names}
    lines = {}
    for name in deck.lines:
        numbers = origins.with_parts(named_edges(deck, edges, name, "cords"))
        sides = with_origin(quads, numbers)
        if name.upper() in faces_named or len(on_outline(quads, sides)) == len(sides):
            continue
        for n, line in enumerate(strings(ends(quads, sides))[0]):
            lines[name if n == 0 else f"{name} ({n + 1})"] = forward(quads, sides[line])
    return lines


def _rubbers(deck: Deck, named: Regions, units: Units, wishes: Wishes) -> list[Rubber | None]:
    stated = {name.upper() for name in wishes.materials}
    compounds: list[Rubber | None] = []
    for name, material, place in zip(named.names, named.materials, named.places, strict=True):
        if material is None or name.upper() in stated or material.upper() in stated:
            compounds.append(None)
        elif material not in deck.materials:
            known = ", ".join(deck.materials) or "none"
            raise place.error(f"there is no material {material}; there are: {known}")
        else:
            compounds.append(rubber(deck.materials[material], units))
    return compounds


def _centred(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Points shifted to put the mid-width at y = 0, if it is off by over 5 % of the width."""
    low, high = points[:, 1].min(), points[:, 1].max()
    shift = (low + high) / 2
    if abs(shift) <= 0.05 * (high - low):
        return points, 0.0
    return points - [0.0, shift], float(shift)


def _said(
    deck: Deck, split: bool, shift: float, wishes: Wishes, found: Regions, units: Units
) -> Iterator[str]:
    yield f"units: the deck is read in {units.words}"
    if split:
        yield "triangles: each split into three quadrilaterals, every quadrilateral into four"
    if wishes.mirror:
        yield "half section: mirrored at z = 0, cords go on in the other half as the same lines"
    if shift:
        yield f"moved by {-shift:.4g} m along the axle: y = 0 is the middle of the width"
    yield from found.notes
