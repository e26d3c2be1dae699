"""Every key of a scene is read by some run."""

import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imsave
from mpi4py import MPI
from scene_keys import KEYS

from tireroad.contact.roads.road import ROADS
from tireroad.fem.tire.material import MATERIALS
from tireroad.runs.pipeline import run_scene
from tireroad.runs.scene.load import load
from tireroad.runs.scene.schema import collection_of, variant_of, walk
from tireroad.runs.scene.tables import tire as tire_tables
from tireroad.runs.scene.tables.contact import PatternTable
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.setup import make_pattern

TIRE = """
[tire]
segments = 12
elements_arc = 4
"""
ROLLING = (
    TIRE
    + """
[static]
load = 300.0
[modal]
count = 8
[rotation]
speed = 50.0
[rotation.campbell]
to = 20.0
[contact]
brush_stiffness = 1e4
friction = 0.5
[road]
kind = "{kind}"
[time]
duration = 0.004
step = 2e-4
"""
)
STANDING = (
    TIRE
    + """
[modal]
up_to = 250.0
[[force]]
amplitude = 2.0
[road]
[time]
duration = 0.004
[output]
impulse = true
[output.receptance]
to = 20.0
step = 10.0
direct = 1
[output.transmissibility]
to = 20.0
step = 10.0
free_rim = 4
"""
)
FULL = (
    TIRE
    + """
[modal]
count = 4
[rotation]
speed = 20.0
method = "full"
[[force]]
[output.receptance]
to = 20.0
step = 10.0
"""
)
RUBBING = (
    TIRE
    + """
[static]
load = 100.0
friction = 0.5
[modal]
count = 4
"""
)
# What a search reads, before and between runs (tests/runs/families/test_search.py).
UNREAD = {
    f"AccuracyTable.{name}" for name in ("target", "target_db", "of", "search", "trials", "budget")
}
DRAWING = """
tread = 0.05
outline.arcs = [[0.32, 0], [0.28, 0.08], [0.2, 0.1]]
layer = [{ name = "wall", compound = "rubber", thickness = 0.01 }]
compound.rubber = { youngs_modulus = 5e6, density = 1100 }
"""


class Recorder:
    """Notes which keys of a scene's tables are read, whoever reads them but dataclasses' own helpers
    and the modules that show the scene as a whole."""

    WHOLE = ("dataclasses.py", "schema.py", "resolved.py", "load.py", "source.py", "check.py")

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.seen: set[str] = set()
        self._patch = monkeypatch
        for of in {of for _, of, _, _ in walk(Scene)}:
            self._watch(of)

    def _watch(self, of: type) -> None:
        names = {item.name for item in fields(of)}
        switches = {f.name for item in fields(of) if (c := collection_of(item)) for f in c.fields()}
        plain: Callable = of.__getattribute__
        label, seen = of.__name__, self.seen

        def reading(holder: Any, name: str) -> Any:
            if name in names or name == "__dict__":
                file = sys._getframe(1).f_code.co_filename
                if not file.endswith(Recorder.WHOLE):
                    seen.update(f"{label}.{n}" for n in (names if name == "__dict__" else [name]))
                    if switches and name == "kinds":  # whoever takes them all takes each
                        seen.update(f"{label}.{n}" for n in switches)
            return plain(holder, name)

        self._patch.setattr(of, "__getattribute__", reading, raising=False)


def _run(folder: Path, text: str, *overrides: str, until: str = "spectra") -> None:
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(text)
    scene = load(folder / "scene.toml", overrides)
    run_scene(scene, folder, MPI.COMM_WORLD, until=until, fresh=False, petsc_options=[])


@pytest.mark.long
def test_every_key_is_read_by_a_run(tmp_path: Path, monkeypatch) -> None:
    """Scenes that between them have every table: no key stands in `check` for nothing."""
    with monkeypatch.context() as patched:
        recorder = Recorder(patched)
        x, y = np.arange(0.0, 2.0, 0.01), np.arange(-0.3, 0.3, 0.01)
        (tmp_path / "rolling").mkdir()
        np.savez(tmp_path / "rolling" / "road.npz", x=x, y=y, z=np.zeros((len(x), len(y))))
        line = np.column_stack([1e3 * x, np.sin(40 * x)])  # mm
        np.savetxt(tmp_path / "rolling" / "line.csv", line, fmt="%.4f", delimiter=",")
        files = {"grid": ["road.file=road.npz"], "laser": ["road.file=line.csv"]}
        for kind in ROADS:
            file = files.get(kind, [])
            if kind != "crg":  # its keys are the grid's
                _run(tmp_path / "rolling", ROLLING.format(kind=kind), *file)
        for tread in ("layer", "winkler", "viscoelastic"):
            points = "contact.points={dx=0.02,dy=0.02}"
            _run(
                tmp_path / "rolling", ROLLING.format(kind="flat"), f"contact.tread={tread}", points
            )
        _run(
            tmp_path / "rolling",
            ROLLING.format(kind="flat"),
            "road.motion.kind=sine",
            "greens.dynamic=6",
        )
        wheel = "road.motion.kind=ramp", "axle.kind=corner", "axle.body_mass=300"
        grooves = "pattern.pitches=50", "pattern.groove=[{width=0.004}]"
        points = "contact.points={dx=0.01,dy=0.01}"
        _run(tmp_path / "rolling", ROLLING.format(kind="flat"), *grooves, points)
        imsave(tmp_path / "tread.png", np.ones((4, 9)), cmap="gray")
        make_pattern(PatternTable(file=str(tmp_path / "tread.png")), 0.3)
        area = "contact.brush_stiffness=", "contact.brush_stiffness_per_area=1e7"
        wheel += (*area, "rotation.speed=", "rotation.travel_speed=10")
        _run(tmp_path / "rolling", ROLLING.format(kind="flat"), *wheel)
        _run(tmp_path / "standing", STANDING)
        stiffness = "stiffness.steps=1", "stiffness.up_to=0.001", "stiffness.which=vertical"
        _run(tmp_path / "standing", STANDING, *stiffness)
        _run(
            tmp_path / "standing",
            STANDING,
            "stiffness.deflections=[0.001]",
            "stiffness.which=vertical",
        )
        slides = (
            "tire.material.youngs_modulus=48e6",
            "static.load=1500",
            "stiffness.deflections=[0.02]",
            "stiffness.slide_steps=1",
        )
        _run(tmp_path / "rubbing", RUBBING, *slides)
        _run(tmp_path / "rubbing", RUBBING, *slides, "rotation.speed=20")
        _run(tmp_path / "rubbing", RUBBING, "sound.up_to=100", "sound.road.thickness=0.03")
        heard = "sound.up_to=150", "time.duration=0.1", points
        _run(tmp_path / "rolling", ROLLING.format(kind="flat"), *heard, until="sound")
        _run(tmp_path / "full", FULL)
        (tmp_path / "drawing.toml").write_text(DRAWING)
        for section in ('section = "radial"', 'mesh = "drawing.toml"'):
            (tmp_path / "tire.toml").write_text(f"[tire]\n{section}\n")
            load(tmp_path / "tire.toml").tire.ring()
    tire = {
        of.__name__
        for of in vars(tire_tables).values()
        if isinstance(of, type) and is_dataclass(of)
    }
    tire |= {MATERIALS[name].__name__ for name in MATERIALS}  # tests/fem/tire/test_material.py
    missing = {
        name
        for name in set(KEYS) - recorder.seen - UNREAD
        if name.split(".")[0] not in tire | {"CrgFile"}
    }
    assert not missing, f"keys that nobody reads: {sorted(missing)}"
    assert not {f.name for f in fields(Scene) if variant_of(f)}
