"""From a mesh file to a section: the only entry point of this package."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tireroad.fem.decks.compounds import Rubber, cord, rubber
from tireroad.fem.decks.deck import SCOPE, Deck
from tireroad.fem.decks.drawn import drawn
from tireroad.fem.decks.files import abaqus, gmsh
from tireroad.fem.decks.named import named_edges
from tireroad.fem.decks.regions import Regions, regions
from tireroad.fem.decks.shape import faces
from tireroad.fem.decks.shape.chains import ends, forward, strings, with_origin
from tireroad.fem.decks.shape.cut import Origins
from tireroad.fem.decks.shape.embedding import lay_all
from tireroad.fem.decks.shape.mirror import is_half, mirrored
from tireroad.fem.decks.shape.plies import Laid, Ply, plies
from tireroad.fem.decks.shape.quad_split import Quads
from tireroad.fem.decks.shape.quads import DeckEdges, build
from tireroad.fem.decks.solids import revolved
from tireroad.fem.decks.units import SYSTEMS, Units, check_size
from tireroad.fem.errors import InputError
from tireroad.fem.sections.mesh2d import SectionMesh


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """Settings of the scene for a file: face names, length unit ("m", "mm", "in"), half section.

    `materials`: regions or materials that the scene defines itself; the deck's are ignored.
    """

    inner: str | None = None
    tread: str | None = None
    rim: tuple[str, ...] = ()
    length_unit: str = "m"
    mirror: bool = False
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
    readers = {".inp": abaqus.read, ".msh": gmsh.read}
    if path.suffix.lower() not in readers:
        raise InputError(
            f"{path}: a section is read from .inp (Abaqus), .msh (Gmsh) or .toml (section file)"
        )
    deck = readers[path.suffix.lower()](path)
    try:
        return _section(*revolved.reduced(deck), wishes)
    except InputError as error:
        text = str(error)
        raise error if deck.file in text else InputError(f"{deck.file}: {text}") from None


def _section(deck: Deck, ring_angles: np.ndarray | None, wishes: Wishes) -> OwnSection:
    units = SYSTEMS[wishes.length_unit]
    found = regions(deck)
    _check_radius(deck, wishes.length_unit)
    quads, edges, split = build(deck, found.of)
    faces.one_body(quads, lambda label: f"element {label % SCOPE}")
    origins = Origins(len(edges.ends))
    quads, laid = lay_all(deck, quads, edges, origins)
    named = {
        key: [origins.with_parts(named_edges(deck, edges, name, key)) for name in names]
        for key, names in _names(deck, wishes).items()
    }
    quads = _both_halves(quads, wishes)
    laid = {name: one.mirrored() if wishes.mirror else one for name, one in laid.items()}
    rim, inner, tread = (_sides(quads, named[key], key) for key in ("rim", "inner", "tread"))
    assert rim is not None, "_names() refuses a deck without a rim"
    shape = faces.faces(quads, rim, inner, tread)
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
    notes += [note for one in compounds if one for note in one.notes]
    return OwnSection(
        mesh=mesh,
        rubbers=tuple(compounds),
        plies=tuple(layers),
        used=deck.used,
        unused=deck.unused,
        notes=tuple(notes),
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
    sides = faces.on_outline(quads, with_origin(quads, np.concatenate(numbers)))
    if not len(sides):
        raise InputError(f"tire.{key}: what it names has no side on the outline of the section")
    return sides


def _cords(deck: Deck, quads: Quads, laid: dict[str, Laid], units: Units) -> list[Ply]:
    made: list[Ply] = []
    for layer in deck.layers:
        if layer.elements not in laid:
            continue
        if layer.material not in deck.materials:
            known = ", ".join(deck.materials) or "none"
            raise layer.place.error(f"there is no material {layer.material}; there are: {known}")
        material = cord(deck.materials[layer.material], units)
        made += plies(quads, laid[layer.elements], layer, material, units.length)
    made = [replace(ply, name=ply.name.replace("/", "-")) for ply in made]
    names = [ply.name for ply in made]
    return [
        replace(ply, name=f"{ply.name} [{n + 1}]") if names.count(ply.name) > 1 else ply
        for n, ply in enumerate(made)
    ]


def _lines(deck: Deck, quads: Quads, edges: DeckEdges, origins: Origins, wishes: Wishes) -> dict:
    """Named lines inside the body of a Gmsh mesh, for cords of the scene."""
    faces_named = {name.upper() for names in _names(deck, wishes).values() for name in names}
    found = {}
    for name in deck.lines:
        numbers = origins.with_parts(named_edges(deck, edges, name, "cords"))
        sides = with_origin(quads, numbers)
        if name.upper() in faces_named or len(faces.on_outline(quads, sides)) == len(sides):
            continue
        for n, line in enumerate(strings(ends(quads, sides))[0]):
            found[name if n == 0 else f"{name} ({n + 1})"] = forward(quads, sides[line])
    return found


def _rubbers(deck: Deck, found: Regions, units: Units, wishes: Wishes) -> list[Rubber | None]:
    given = {name.upper() for name in wishes.materials}
    compounds: list[Rubber | None] = []
    for name, material, place in zip(found.names, found.materials, found.places, strict=True):
        if material is None or name.upper() in given or material.upper() in given:
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
