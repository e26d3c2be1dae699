"""A deck, mesh or road file alone: what it is, its figures and pictures, and a scene to start from."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tireroad.contact.roads.kinds.iso8608 import CLASSES
from tireroad.contact.roads.kinds.iso8608 import REFERENCE as PER_METRE
from tireroad.contact.roads.meaning import ReadAs, layout_of
from tireroad.contact.roads.road import ROADS
from tireroad.contact.roads.text_table import head_of, lines_of, opened
from tireroad.contact.roads.under_tire import REFERENCE, Texture, texture_of
from tireroad.fem.decks.compounds import SYSTEMS, Rubber
from tireroad.fem.decks.deck import Deck
from tireroad.fem.decks.history import DeckHistory, history
from tireroad.fem.decks.user_section import MESHES, Wishes, no_solids, section_of
from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import INFLATION, RADII
from tireroad.runs.files.names import scene_name
from tireroad.runs.report.figures import COLOURS, WIDE, canvas, styled
from tireroad.runs.report.section_figure import NAME, save_section
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.sections.file import FileSection, own_section
from tireroad.runs.scene.tables.tire import TireTable

_RIM = re.compile(r"RIM|BEAD|FLANGE|WHEEL")
_INNER = re.compile(r"INNER|INSIDE|LINER|CAVITY|INFLAT|PRESS|_IN\b|^IN\b")
_TREAD = re.compile(r"TREAD|OUTSIDE|OUTER|GROUND|ROAD|CONTACT|_OUT\b|^OUT\b")
KINDS = {
    ".crg": ("crg",),
    ".npz": ("grid",),
    ".h5": ("grid",),
    ".hdf5": ("grid",),
    ".csv": ("grid", "laser"),
    ".nc": ("grid",),
    **dict.fromkeys((".txt", ".tsv", ".xyz"), ("grid", "laser")),
    **dict.fromkeys((".dat", ".asc", ".prn"), ("laser",)),
}
"""Kinds of road by ending, in the order in which they are tried."""
_LONG = 0.35  # m: shortest wave of the fit of ISO 8608, 2.83 cycles a metre
_MOST = 400_000  # heights of the middle line that are evaluated


def is_tire_file(path: Path) -> bool:
    """Whether a file's ending is that of a deck or mesh."""
    return path.suffix.lower() in MESHES


def describe_tire(path: Path, out: Path) -> str:
    """Describe the content of a deck or mesh, with a scene to start from, which is out/scene.toml, too.

    Draws out/section.png and, of rubbers fitted to test data, out/test_data.png. Raises InputError
    where no section can be made of the file, after writing the scene as far as it is known.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    steps = history(path) if path.suffix.lower() == ".inp" else DeckHistory()
    if steps.has_steps and not steps.has_mesh:
        return "\n".join(
            [
                f"{path}: steps of an analysis without a mesh of its own; what a scene can take from them:",
                "",
                *_run(steps, "m"),
            ]
        )
    deck = MESHES[path.suffix.lower()](path)
    wishes, guessed = _guess(deck)
    out.mkdir(parents=True, exist_ok=True)

    def write() -> str:
        tables = (
            *_table(path, scene_name(out.name), wishes, guessed),
            "",
            *_run(steps, wishes.length_unit),
        )
        text = "\n".join(tables) + "\n"
        (out / "scene.toml").write_text(text)
        return text

    try:
        wishes = _readable(deck, wishes)
    except InputError as error:
        write()
        raise InputError(
            f"{error}\n  a scene to complete: {out / 'scene.toml'}\n  sets and surfaces: "
            + (", ".join(deck.face_names) or "none")
        ) from None
    scene = write()
    keys = {key: getattr(wishes, key) for key in ("inner", "tread", "rim", "length_unit", "mirror")}
    tire = TireTable(section="file", shape=FileSection(file=str(path), **keys))
    own = own_section(tire)
    radius, width = own.mesh.nodes[:, 0].max(), np.ptp(own.mesh.nodes[:, 1])
    kind = "section" if deck.dimension == 2 else "body"
    lines = [
        f"{path}: a tire's {kind}, outer radius {1e3 * radius:.4g} mm, width {1e3 * width:.4g} mm",
        *tire.shape.described(tire),
    ]
    save_section(own.mesh, out / NAME, tire.shape.angles(tire))
    lines.append(f"drawn: {out / NAME}")
    fits = [rubber for rubber in own.rubbers if rubber is not None and rubber.fit]
    if fits:
        draw_fits(fits).savefig(out / "test_data.png", dpi=150, bbox_inches="tight")
        lines.append(f"drawn: {out / 'test_data.png'}, laws fitted to test data")
    return "\n".join([*lines, f"a scene to start from: {out / 'scene.toml'}", "", scene])


def _guess(deck: Deck) -> tuple[Wishes, dict[str, str]]:
    """Unit, faces and half section that the file suggests, and why, by key."""
    guessed: dict[str, str] = {}
    solids = [block for block in deck.blocks if block.kind.role == "solid"]
    if not solids:
        raise no_solids(deck)
    points = deck.points[
        np.unique(np.concatenate([deck.rows(b.nodes, b.place).ravel() for b in solids]))
    ]
    flat = deck.dimension == 2
    radius = float(points[:, 0].max() if flat else np.abs(points).max())
    fitting = [unit for unit, of in SYSTEMS.items() if RADII[0] <= radius * of.length <= RADII[1]]
    unit = "mm" if "mm" in fitting else fitting[0] if fitting else "m"
    guessed["length_unit"] = f"guessed: the largest radius is {radius:.5g} in the file's unit"
    names = deck.face_names
    plain = [name for name in names if "." not in name]
    rim = tuple(dict.fromkeys(name for name, _ in deck.held))
    if rim:
        guessed["rim"] = "held by *RIGID BODY"
    else:
        rim = tuple(name for name in plain if _RIM.search(name.upper()))
        guessed["rim"] = (
            "guessed by name"
            if rim
            else "name what the wheel holds, of the sets and surfaces: " + ", ".join(plain[:12])
        )
    pressed = [name for name in dict.fromkeys(deck.pressed) if name in deck.surfaces]
    inner = pressed[0] if pressed else _first(_INNER, plain)
    guessed["inner"] = "under pressure in a step" if pressed else "guessed by name"
    tread = _first(_TREAD, [name for name in plain if name != inner])
    guessed["tread"] = "guessed by name"
    y = points[:, 1] if flat else points[:, 2]
    size = max(float(np.ptp(y)), 1e-300)
    half = flat and min(abs(float(y.min())), abs(float(y.max()))) < 1e-6 * size
    if half:
        guessed["mirror"] = "guessed: the section ends on z = 0"
    wishes = Wishes(inner=inner, tread=tread, rim=rim, length_unit=unit, mirror=half)
    return wishes, guessed


def _first(pattern: re.Pattern[str], names: list[str]) -> str | None:
    return next((name for name in names if pattern.search(name.upper())), None)


def _readable(deck: Deck, wishes: Wishes) -> Wishes:
    """The guessed names that are on a face of the section. Raises InputError where none is its rim."""

    def reads(some: Wishes) -> InputError | None:
        try:
            section_of(deck, some)
        except InputError as error:
            return error
        return None

    first = reads(wishes)
    if first is None and len(wishes.rim) < 2:
        return wishes
    bare = replace(wishes, inner=None, tread=None)
    rim = tuple(name for name in wishes.rim if reads(replace(bare, rim=(name,))) is None)
    if first is None:
        return replace(wishes, rim=rim)
    if not rim:
        raise first
    bare = replace(bare, rim=rim)
    inner = None if reads(replace(bare, inner=wishes.inner)) else wishes.inner
    tread = None if reads(replace(bare, tread=wishes.tread)) else wishes.tread
    wishes = replace(bare, inner=inner, tread=tread)
    if error := reads(wishes):
        raise error
    return wishes


def _table(path: Path, name: str, wishes: Wishes, guessed: dict[str, str]) -> list[str]:
    """The [tire] of a scene, with why each key has its value."""

    def line(key: str, value: str) -> str:
        reason = guessed.get(key, "")
        return f"{key} = {value}".ljust(40) + (f" # {reason}" if reason else "")

    rows = [
        f'name = "{name}"',
        "",
        "[tire]",
        'section = "file"',
        f"file = {literal(str(path.resolve()))}",
        line("length_unit", f'"{wishes.length_unit}"'),
        line("rim", literal(wishes.rim)),
    ]
    for key in ("inner", "tread"):
        found = getattr(wishes, key)
        rows.append(
            line(key, literal(found))
            if found
            else f"# {key}: absent, found from the section's shape"
        )
    if wishes.mirror:
        rows.append(line("mirror", "true"))
    return rows


def _run(steps: DeckHistory, unit: str) -> list[str]:
    """The other tables, as far as the deck's steps give figures for them."""
    of = SYSTEMS[unit]
    force = of.stress * of.length**2
    rows = []
    if steps.segments:
        rows += [
            f"# segments = {steps.segments}   # [tire]: of *SYMMETRIC MODEL GENERATION, which revolves by {steps.angle:g} degrees; "
            "absent: as many as the program takes"
        ]
    has_pressure = steps.pressure is not None
    pressure = steps.pressure * of.stress if steps.pressure is not None else INFLATION
    rows += [
        "[static]",
        f"inflation = {pressure:.6g}".ljust(40)
        + (" # Pa, of *DSLOAD" if has_pressure else " # Pa, not in the file"),
    ]
    if steps.load is not None:
        rows.append(
            f"load = {steps.load * force:.6g}".ljust(40)
            + " # N, of *CLOAD (twice that, if the model is a half)"
        )
    if steps.speed is not None:
        rows += [
            "",
            "[rotation]",
            f"speed = {steps.speed:.6g}".ljust(40) + " # rad/s, of *TRANSPORT VELOCITY",
        ]
    rows += [
        "",
        "[modal]",
        f"count = {steps.modes or 20}".ljust(40) + (" # of *FREQUENCY" if steps.modes else ""),
    ]
    if steps.friction is not None:
        rows += [
            "",
            f"# *FRICTION of the deck: [static] friction or [contact] friction = {steps.friction:.4g}",
        ]
    return rows


@styled
def draw_fits(rubbers: list[Rubber]) -> Figure:
    """Nominal stress over stretch: test data as points, the fitted laws as lines."""
    figure, axes = canvas(WIDE, 3.0 * len(rubbers), rows=len(rubbers))
    for (here,), rubber in zip(axes, rubbers, strict=True):
        assert rubber.fit is not None
        for colour, curve in zip(COLOURS, rubber.fit.curves, strict=False):
            name = curve.test.split()[0].lower()
            here.plot(curve.stretch, curve.stress, "o", ms=4, color=colour, label=f"{name}, data")
            here.plot(curve.along, curve.fitted, color=colour, label=f"{name}, law")
        here.set_xlabel("stretch")
        here.set_ylabel("nominal stress, unit of the file")
        here.set_title(
            f"{rubber.name}: {rubber.fit.model}, {100 * rubber.fit.error:.2g} % off in stress"
        )
        here.legend(fontsize=8)
    return figure


def is_road_file(path: Path) -> bool:
    """Whether a file's ending is that of a road."""
    return path.suffix.lower() in KINDS


def describe_road(path: Path, out: Path) -> str:
    """Describe the content of a road file, and a [road] to paste; draws out/road.png. InputError where it is none."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    kind, road, more = _read(path)
    x, z = _middle(road)
    texture = texture_of(z, float(x[1] - x[0]), 2 * road.steps[0])
    (length, width), (along, across) = road.extent_of_file, road.steps
    lines = [
        f'{path}: a road of kind "{kind}"',
        f"  {length:.6g} m long every {1e3 * along:.4g} mm, {width:.4g} m wide every {1e3 * across:.4g} mm",
        *(f"  {_reading(reading)}" for reading in road.readings),
        *(f"  {note}" for note in road.notes),
        f"  along its middle: heights from {1e3 * z.min():.4g} to {1e3 * z.max():.4g} mm, standard deviation {1e3 * z.std():.3g} mm",
    ]
    if texture.depth is not None:
        lines.append(f"  mean profile depth {1e3 * texture.depth:.3g} mm (ISO 13473-1:2019)")
    name = iso_class(texture)
    if name is not None:
        lines.append(
            f"  waves over {_LONG:g} m: G_d(0.1/m) = {name[1]:.3g} m3, class {name[0]} of ISO 8608"
        )
    for wave, level in list(zip(texture.wavelength, texture.level, strict=True))[
        :: max(len(texture.level) // 8, 1)
    ]:
        lines.append(f"  texture level {level:.1f} dB re 1 um at {1e3 * wave:.3g} mm (ISO 13473-4)")
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "road.png").write_bytes(_drawn(x, z, texture))
        lines.append(f"  drawn: {out / 'road.png'}")
    except OSError as error:
        lines.append(f"  not drawn: {out / 'road.png'}: {error.strerror}")
    table = ["[road]", f'kind = "{kind}"', f"file = {literal(str(path.resolve()))}", *more]
    return "\n".join([*lines, "", *table])


def _reading(reading: ReadAs) -> str:
    """Lines on the quantities that were read of the file, with places and units."""
    return f"{reading.quantity}: {reading.place}, {reading.unit}" + (
        f", {reading.remark}" if reading.remark else ""
    )


def _read(path: Path) -> tuple[str, Any, list[str]]:
    """Kind and road of a file, and further lines of its table: the unit of x that fits a road."""
    refused: list[str] = []
    kinds = KINDS[path.suffix.lower()]
    if len(kinds) > 1 and _is_line(path):
        kinds = ("laser",)
    for kind in kinds:
        for unit in (None, "m") if kind == "laser" else (None,):
            try:
                more = {"across": "ruts", "length_unit": unit} if kind == "laser" else {}
                road = ROADS.make(kind, file=str(path), **more).make()
            except InputError as error:
                if unit != "m":
                    refused.append(f"as {kind}: {error}")
                continue
            table = (
                ['length_unit = "m"           # of x; guessed, mm make no road']
                if unit == "m"
                else []
            )
            return kind, road, table
    raise InputError(
        "\n  ".join([f"{path} cannot be used as a road", *refused])
        if len(refused) > 1
        else refused[0]
    )


def _is_line(path: Path) -> bool:
    """Whether a text file is a profile along a line and no grid: one or two columns, or x and z without y."""
    source = str(path)
    with opened(path, source) as stream:
        try:
            layout = layout_of(head_of(lines_of(stream, source)), source)
        except InputError:
            return False  # told by the reader
    if layout is None:
        return False
    return layout.width < 3 or bool(layout.of("z") and not layout.of("y"))


def _middle(road: Any) -> tuple[NDArray, NDArray]:
    """x (n,) m from the road's beginning, and heights (n,) m of its middle line, holes bridged."""
    (first, last), (right, left) = road.measured, road.extent[1]
    pitch = max(road.steps[0], (last - first) / _MOST)
    x = first + pitch * np.arange(int((last - first) / pitch) + 1)
    z = road.height(x, np.full(len(x), (right + left) / 2))
    known = np.isfinite(z)
    if not known.any():
        raise InputError(f"{road.source}: no height is known along its middle")
    return x, np.interp(x, x[known], z[known])


def iso_class(texture: Texture) -> tuple[str, float] | None:
    """Class of ISO 8608 and G_d(0.1/m) m3 of the waves over 0.35 m; None of fewer than three bands.

    With the exponent 2 of the standard, the geometric mean over the third octaves.
    """
    long = texture.wavelength > _LONG
    if long.sum() < 3:
        return None
    n = 1 / texture.wavelength[long]
    density = REFERENCE**2 * 10 ** (texture.level[long] / 10) / (n * (10**0.05 - 10**-0.05))
    there = float(np.exp(np.log(density * (n / PER_METRE) ** 2).mean()))
    name = min(CLASSES, key=lambda one: abs(np.log(CLASSES[one] / there)))
    return name, there


@styled
def _drawn(x: NDArray, z: NDArray, texture: Texture) -> bytes:
    from io import BytesIO

    figure, axes = canvas(WIDE, 4.6, 2)
    step = max(len(x) // 4000, 1)
    axes[0, 0].plot(x[::step], 1e3 * z[::step], color=COLOURS[0], linewidth=0.6)
    axes[0, 0].set(xlabel="x in m", ylabel="height in mm", title="middle line")
    if len(texture.level):
        axes[1, 0].step(1e3 * texture.wavelength, texture.level, where="mid", color=COLOURS[0])
    axes[1, 0].set(
        xlabel="wavelength in mm",
        ylabel="level in dB re 1 um",
        xscale="log",
        title="texture, third octaves",
    )
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=130)
    return stream.getvalue()
