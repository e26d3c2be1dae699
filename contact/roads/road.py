"""The road as the tire meets it: any `Road`, shifted under the axle, levelled and eased in."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.cobblestones import Blocks, Cobblestones
from tireroad.contact.roads.flat import Flat
from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.grid_file import read_grid
from tireroad.contact.roads.iso8608 import Iso8608
from tireroad.contact.roads.obstacle import Obstacle
from tireroad.contact.roads.opencrg import read_opencrg
from tireroad.contact.roads.sine import Sine
from tireroad.contact.roads.texture import Texture
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]


def make_road(spec: Any = None, /, **keys: Any) -> RoadUnderTire:
    """The road of a scene, make_road(scene.road), or of keys, make_road(kind="flat").

    Read are the attributes kind, start, lateral, run_in, offset, datum, longest_wave, and by kind:
    sine: amplitude and wavelength (m), phase (degrees); cobblestones: block_length, block_width,
    joint_width, joint_depth, edge_radius, height_scatter (m), stagger, seed; step and cleat:
    position, height, ramp (m), angle (degrees), cleat: length (m); iso8608: road_class,
    shortest_wave (m), seed; texture: rms, roll_off, cut_off (m), hurst, seed; grid and crg: file,
    holes, end; grid: length_unit, height_unit.
    What is absent or None takes its default; datum and longest_wave are only for files and
    cobblestones and iso8608, datum "mean" by default: the others are about zero by themselves.
    InputError for an unknown kind, a missing key or a file that cannot be used.
    """
    spec = SimpleNamespace(**keys) if spec is None else spec
    kind = _get(spec, "kind")
    if kind not in _MAKERS:
        raise InputError(f'road.kind = "{kind}" is not supported: take one of {", ".join(_MAKERS)}')
    return RoadUnderTire(
        _MAKERS[kind](spec),
        start=_get(spec, "start", 0.0),
        lateral=_get(spec, "lateral", 0.0),
        run_in=_get(spec, "run_in", 0.1),
        offset=_get(spec, "offset", 0.0),
        datum=_get(spec, "datum", "mean") if kind in _UNEVEN else "zero",
        longest_wave=getattr(spec, "longest_wave", None),
    )


def _get(spec: Any, key: str, default: Any = None) -> Any:
    value = getattr(spec, key, None)
    if value is None and default is None:
        raise InputError(f"road.{key} is missing")
    return default if value is None else value


def _sine(spec: Any) -> Sine:
    phase = np.deg2rad(_get(spec, "phase", 0.0))
    return Sine(_get(spec, "amplitude"), _get(spec, "wavelength"), float(phase))


def _cobblestones(spec: Any) -> Cobblestones:
    return Cobblestones(
        Blocks(
            length=_get(spec, "block_length"),
            width=_get(spec, "block_width"),
            joint_width=_get(spec, "joint_width"),
            joint_depth=_get(spec, "joint_depth"),
            edge_radius=_get(spec, "edge_radius", 0.0),
            scatter=_get(spec, "height_scatter", 0.0),
            stagger=_get(spec, "stagger", True),
            seed=_get(spec, "seed", 0),
        )
    )


def _obstacle(spec: Any) -> Obstacle:
    length = _get(spec, "length") if _get(spec, "kind") == "cleat" else np.inf
    return Obstacle(
        _get(spec, "position"),
        _get(spec, "height"),
        length,
        _get(spec, "ramp"),
        float(np.deg2rad(_get(spec, "angle", 0.0))),
    )


def _iso8608(spec: Any) -> Iso8608:
    return Iso8608(
        _get(spec, "road_class"), _get(spec, "shortest_wave", 0.1), _get(spec, "seed", 0)
    )


def _texture(spec: Any) -> Texture:
    sizes = (_get(spec, key) for key in ("rms", "hurst", "roll_off", "cut_off"))
    return Texture(*sizes, seed=_get(spec, "seed", 0))


def _from_file(reader: Any) -> Any:
    def make(spec: Any) -> Grid:
        return reader(
            Path(_get(spec, "file")),
            holes=_get(spec, "holes", "refuse"),
            end=_get(spec, "end", "refuse"),
        )

    return make


def _grid(spec: Any) -> Grid:
    return read_grid(
        Path(_get(spec, "file")),
        holes=_get(spec, "holes", "refuse"),
        end=_get(spec, "end", "refuse"),
        length_unit=getattr(spec, "length_unit", None),
        height_unit=getattr(spec, "height_unit", None),
    )


_MAKERS = {
    "flat": lambda spec: Flat(),
    "sine": _sine,
    "cobblestones": _cobblestones,
    "step": _obstacle,
    "cleat": _obstacle,
    "iso8608": _iso8608,
    "texture": _texture,
    "grid": _grid,
    "crg": _from_file(read_opencrg),
}


_UNEVEN = ("cobblestones", "iso8608", "grid", "crg")
