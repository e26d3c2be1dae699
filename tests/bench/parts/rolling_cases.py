"""The cases for estimated errors and searches: 3 tires, 4 roads, 2 speeds, of the radial tire more, and their reference
runs, whose forces are stored for benchmarks that resume, or share them."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import InputError
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.disk import replacing
from tireroad.runs.pipeline import Finished, run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import AccuracyTable, Scene
from tireroad.runs.validation.tables import asked
from tireroad.tests.bench.parts.apart import apart


@dataclass(frozen=True, kw_only=True)
class Tire:
    """A tire: its part of a scene (`text`) and the settings (as for `sets`) in which its runs
    (`run`) and its reference (`fine`) differ from the common ones. Rolling belts use attachment
    modes, as searches do."""

    text: str
    run: Mapping[str, Any] = field(default_factory=dict)
    fine: Mapping[str, Any] = field(default_factory=dict)


_SOFT = """
[tire]
footprint_size = 0.25
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
error_estimate = false
[damping]
mass = 300.0
"""
_BELT = """
[[tire.cords]]
name = "belt"
depth = 0.006
arc = [-30.0, 30.0]
angle = 0.0
youngs_modulus = 2e9
"""
_RADIAL = """
[tire]
section = "radial"
footprint_size = 0.25
[static]
inflation = 2.2e5
load = 4000.0
error_estimate = false
"""
# What is heard of the built-in tire in benches that judge its error bars.
HEARD = """
[sound]
microphones = ["cpx", "pass-by"]
"""
_ATTACHED = {"residual": "attachment"}
# The mesh and the points of quickstart.toml.
_QUICK = {"segments": 16, "arc": 10, "order": 2, "pitch": 0.010}
_QUICK_FINE = {"segments": 24, "arc": 16, "order": 2, "footprint": 0.15, "pitch": 0.005} | _ATTACHED
TIRES = {
    "soft": Tire(text=_SOFT),
    "belted": Tire(text=_SOFT + _BELT, run=_ATTACHED, fine=_ATTACHED),
    # 205/60 R15 under rated load: order 2, several elements through the wall, a footprint ten times
    # as wide.
    "radial": Tire(
        text=_RADIAL,
        run={"segments": 16, "arc": 14, "order": 2} | _ATTACHED,
        fine={"segments": 26, "arc": 24, "order": 2, "footprint": 0.1, "pitch": 0.004} | _ATTACHED,
    ),
    "quick": Tire(text=_RADIAL, run=_QUICK | _ATTACHED, fine=_QUICK_FINE),
    "quick-static": Tire(text=_RADIAL, run=_QUICK | {"residual": "static"}, fine=_QUICK_FINE),
}
# The cleat is reached after the run-in, which no figure includes. At both speeds a wave of the sine
# takes longer than 10 ms, the period of the highest frequency of interest in searches.
ROADS = {
    "sine": 'kind = "sine"\namplitude = 2e-4\nwavelength = 0.25',
    "cleat": 'kind = "cleat"\nheight = 0.003\nlength = 0.02\nposition = 0.5',
    "texture": 'kind = "texture"\nrms = 2e-4\nroll_off = 0.2\ncut_off = 0.03',
    "cobblestones": 'kind = "cobblestones"\njoint_depth = 0.003\nheight_scatter = 0.0002',
}
SPEEDS = (30.0, 60.0)  # rad/s
DURATION = 0.16  # s
# Finer than any settings tested and their companions. The near field of a point force scales with
# the size of the elements at the footprint: nodes there are 2.7 mm apart, a fifth of those of 18 x
# 8 elements. Points are closer than half of 8 mm.
FINE: dict[str, Any] = {
    "segments": 40,
    "arc": 14,
    "order": 3,
    "footprint": 0.07,
    "modes": 200,
    "pitch": 0.003,
    "step": 1e-4,
}
REACH = 0.012  # m, of the patch: alike on every road, so that stages before the loop are shared
# Free rolling is asked for, so that a run that does not find it fails: a wheel that begins at rest, without slip, has forces along and
# across the road of another kind than those it would be compared with. The wheel turns freely: held, forces along the road do not converge
# with the points (docs/verification/contact-points.md).
SCENE = """
name = "case"
{tire}
[rotation]
speed = {speed}
free_rolling = true
wheel = "free"
[contact]
youngs_modulus = 1e7
reach = {reach}
[road]
{road}
[time]
duration = {duration}
"""


@dataclass(frozen=True)
class Case:
    """A `tire` on a `road` at a `speed` (rad/s)."""

    tire: str
    road: str
    speed: float

    def __str__(self) -> str:
        return f"{self.tire}, {self.road}, {self.speed:g} rad/s"

    @property
    def words(self) -> tuple[str, str, str]:
        """What names it among others: tire, road and speed."""
        return self.tire, self.road, f"{self.speed:g}"

    @property
    def wheel(self) -> str:
        """Name of what all roads share: tire and speed."""
        return f"{self.tire}-{self.speed:g}"

    @property
    def given(self) -> tuple[str, str]:
        """Tire and road as in a scene."""
        return TIRES[self.tire].text, ROADS[self.road]

    @property
    def radial(self) -> bool:
        """Whether the tire is the built-in one, whose sound is of interest."""
        return TIRES[self.tire].text == _RADIAL

    def scene(self, folder: Path, duration: float, *sets: str, heard: bool = False) -> Scene:
        """The scene with keys as for --set, `heard` by microphones or not; its file is written to the folder."""
        from tireroad.runs.scene.load import load

        folder.mkdir(parents=True, exist_ok=True)
        tire, road = self.given
        keys = {"tire": tire, "road": road, "speed": self.speed}
        text = SCENE.format(**keys, reach=REACH, duration=duration) + (HEARD if heard else "")
        (folder / "given.toml").write_text(text)
        return load(folder / "given.toml", sets)


CASES = tuple(Case(*one) for one in product(("soft", "belted", "radial"), ROADS, SPEEDS))
RADIAL = tuple(
    Case(*one) for one in product(("radial", "quick", "quick-static"), ROADS, (30.0, 60.0, 90.0))
)


def chosen(cases: Iterable[Case], only: Sequence[str]) -> list[Case]:
    """The cases that have all words of one of `only`, as in "radial texture 30"; all for none. InputError if none has."""
    cases = list(cases)
    some = [case for case in cases if asked(case.words, only)]
    if not some:
        every = sorted({word for case in cases for word in case.words})
        raise InputError(
            f"--only: no case has all words of one of them; words are {', '.join(every)}"
        )
    return some


def by_wheel(cases: Iterable[Case]) -> list[Case]:
    """Cases sorted by wheel, since cases of one wheel share stages."""
    return sorted(cases, key=lambda case: (list(TIRES).index(case.tire), case.speed))


def sets(
    *,
    segments: int,
    arc: int,
    order: int,
    modes: int,
    pitch: float,
    step: float,
    footprint: float = 0.25,
    residual: str = "static",
) -> tuple[str, ...]:
    """Settings of mesh, modes, points, step and residual as for --set."""
    return (
        f"tire.segments={segments}",
        f"tire.elements_arc={arc}",
        f"tire.order={order}",
        f"tire.footprint_size={footprint}",
        f"modal.count={modes}",
        f"contact.points={{ dx = {pitch}, dy = {pitch} }}",
        f"time.step={step}",
        f"greens.residual={residual}",
    )


def told_settings(keys: Mapping[str, Any], part: Literal["run", "fine"]) -> str:
    """Settings in words, including the tires whose settings differ in this `part`."""
    own = {name: getattr(tire, part) for name, tire in TIRES.items()}
    others = [f"of the {name} tire {_told({**keys, **one})}" for name, one in own.items() if one]
    return "; ".join([_told(keys), *others])


def _told(keys: Mapping[str, Any]) -> str:
    residual = f", residual {keys['residual']}" if "residual" in keys else ""
    return (
        f"{keys['segments']} x {keys['arc']} elements of order {keys['order']}, {keys['modes']} modes, points "
        f"{1e3 * keys['pitch']:g} mm apart, steps of {1e3 * keys['step']:g} ms{residual}"
    )


NAMES = ("total_force", "axle_force")


@dataclass(frozen=True)
class Recorded:
    """The `total_force` and `axle_force` (n, 3) N of a run after each of its steps of `step` s, and the third octaves `heard`
    at its microphones, if any, each (2, b): their middle, Hz, and level, dB."""

    forces: dict[str, np.ndarray]
    step: float
    heard: dict[str, np.ndarray]


@dataclass(frozen=True)
class Driven(Recorded):
    """The products and forces of a run."""

    done: Finished


def driven(scene: Scene, folder: Path, until: str, cache: Cache = NO_CACHE) -> Driven:
    """Run a scene without terminal output; stages are shared through a `cache`. Collective."""
    folder.mkdir(parents=True, exist_ok=True)
    with console.quiet():
        done = run_scene(
            scene, folder, MPI.COMM_WORLD, until=until, fresh=False, petsc_options=[], cache=cache
        )
    with h5py.File(folder / "contact.h5") as file:
        step, forces = done.done["contact"].product.step, {name: file[name][:] for name in NAMES}
    heard = {}
    if "sound" in done.done:
        sound = done.done["sound"].product
        levels = [np.array([sound.centre, level]) for level in sound.level]
        heard = dict(zip(sound.names, levels, strict=True))
    return Driven(forces, step, heard, done)


def recorded(scene: Scene, folder: Path, kept: Path, cache: Cache = NO_CACHE) -> Recorded:
    """The forces of a run, and what is heard of it, in a separate process, or those stored in the folder `kept` for the same
    scene (used whatever program version computed them, until deleted)."""
    bare = replace(scene, accuracy=AccuracyTable(estimate=False))
    values = json.dumps(tomllib.loads(dumps(bare)), sort_keys=True)  # without the keys' comments
    file = kept / f"{hashlib.sha256(values.encode()).hexdigest()[:16]}.npz"
    if not file.exists():
        apart(_record, bare, folder, file, cache)  # frees the memory of a fine run
    with np.load(file) as found:
        forces = dict(zip(NAMES, found["forces"], strict=True))
        heard = dict(zip(found["names"].tolist(), found["levels"], strict=True))
        return Recorded(forces, float(found["step"]), heard)


def _record(scene: Scene, folder: Path, file: Path, cache: Cache) -> None:
    """Write the forces of a run, and what is heard of it, to a file. On one process."""
    run = driven(scene, folder, "sound" if scene.sound else "contact", cache)
    forces = np.array([run.forces[name] for name in NAMES])
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as part, part.open("wb") as opened:
        names, levels = np.array(list(run.heard), str), np.array(list(run.heard.values()))
        np.savez_compressed(opened, step=run.step, forces=forces, names=names, levels=levels)
