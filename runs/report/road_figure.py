"""A road file alone: what it is, its texture in figures and in a picture, and the table of a scene for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.kinds.iso8608 import CLASSES
from tireroad.contact.roads.kinds.iso8608 import REFERENCE as PER_METRE
from tireroad.contact.roads.road import ROADS
from tireroad.contact.roads.under_tire import REFERENCE, Texture, texture_of
from tireroad.fem.errors import InputError
from tireroad.runs.report.figures import COLOURS, WIDE, canvas, styled

KINDS = {
    ".crg": ("crg",),
    ".npz": ("grid",),
    ".h5": ("grid",),
    ".hdf5": ("grid",),
    ".csv": ("grid", "laser"),
    **dict.fromkeys((".txt", ".dat", ".asc", ".prn", ".tsv", ".xyz"), ("laser",)),
}
"""Kinds of road by ending, in the order in which they are tried."""
_LONG = 0.35  # m: shortest wave of the fit of ISO 8608, 2.83 cycles a metre
_MOST = 400_000  # heights of the middle line that are evaluated


def is_road_file(path: Path) -> bool:
    """Whether a file's ending is that of a road."""
    return path.suffix.lower() in KINDS


def describe_road(path: Path, out: Path) -> str:
    """What a road file holds, and a [road] to paste; draws out/road.png. InputError where it is none."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    kind, road, more = _read(path)
    x, z = _middle(road)
    texture = texture_of(z, float(x[1] - x[0]), 2 * road.steps[0])
    (length, width), (along, across) = road.extent_of_file, road.steps
    lines = [
        f'{path}: a road of kind "{kind}"',
        f"  {length:.6g} m long every {1e3 * along:.4g} mm, {width:.4g} m wide every {1e3 * across:.4g} mm",
        *(f"  {note}" for note in road.notes),
        f"  along its middle: heights from {1e3 * z.min():.4g} to {1e3 * z.max():.4g} mm, standard deviation {1e3 * z.std():.3g} mm",
    ]
    if texture.depth is not None:
        lines.append(f"  mean profile depth {1e3 * texture.depth:.3g} mm (ISO 13473-1:2019)")
    found = iso_class(texture)
    if found is not None:
        lines.append(
            f"  waves over {_LONG:g} m: G_d(0.1/m) = {found[1]:.3g} m3, class {found[0]} of ISO 8608"
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
    table = ["[road]", f'kind = "{kind}"', f'file = "{path.name}"', *more]
    return "\n".join([*lines, "", *table])


def _read(path: Path) -> tuple[str, Any, list[str]]:
    """Kind and road of a file, and further lines of its table: the unit of x that fits a road."""
    refused: list[str] = []
    kinds = KINDS[path.suffix.lower()]
    if len(kinds) > 1 and _is_line(path):
        kinds = ("laser",)
    for kind in kinds:
        units = ("mm", "m") if kind == "laser" else (None,)
        for unit in units:
            try:
                more = {"across": "ruts", "length_unit": unit} if unit else {}
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
    """Whether a text file has one or two numbers a line, which is no grid."""
    with path.open("rb") as file:
        first = [
            line
            for line in file.read(4000).splitlines()[:-1]
            if line.strip() and not line.startswith(b"#")
        ]
    return all(max(line.count(mark) for mark in (b",", b";", b"\t")) < 2 for line in first)


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
