"""Random scenes: texts to start from, one for each part of a tire, and keys with random values."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.image import imsave

from tireroad.contact.roads.road import ROADS
from tireroad.contact.tread.law import TREADS
from tireroad.fem.tire.material import MATERIALS
from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene

sys.path.insert(0, str(Path(__file__).parents[1] / "fem" / "decks"))
sys.path.insert(0, str(Path(__file__).parents[1] / "contact" / "roads"))

from test_opencrg import crg
from tires import soft_torus
from torus_decks import CORDS, HALF_ANGLE, Torus, membranes, plain

TIRE = (
    """
name = "fuzz"
"""
    + soft_torus(12, 4)
    + """"""
)
PRESSED = """
[static]
load = 300.0
error_estimate = false
[modal]
count = 8
"""
ROLLING = """
[rotation]
speed = 50.0
[contact]
[road]
[time]
duration = 0.004
step = 2e-4
"""
BASE = TIRE + PRESSED + ROLLING
FORCES = (
    TIRE
    + """
[modal]
count = 8
[[force]]
amplitude = 2.0
[time]
duration = 0.01
[output.receptance]
to = 100.0
step = 10.0
"""
)
PLIES = """
[[tire.cords]]
name = "belt"
angle = 20.0
youngs_modulus = 1e9
[[tire.region]]
loss_factor = 0.1
dynamic = 1.3
"""
AIR = "[tire.cavity]\ntemperature = 300.0\n"
CORNER = '[axle]\nkind = "corner"\nbody_mass = 300.0\n'
CURVES = "[stiffness]\nsteps = 2\nup_to = 0.002\n"
DECK = """
name = "fuzz"
[tire]
section = "file"
file = "tire.inp"
rim = "RIMNODES"
segments = 8
[static]
inflation = 2e4
load = 50.0
error_estimate = false
[modal]
count = 8
"""
RADIAL = """
name = "fuzz"
[tire]
section = "radial"
segments = 12
[static]
load = 2000.0
error_estimate = false
[modal]
count = 8
"""
ON_GRID = "[contact]\npoints = { dx = 0.006, dy = 0.006 }\n"
CREEPS = ON_GRID + 'tread = "viscoelastic"\n'
BRUSH = ON_GRID + "friction = 0.8\nslip = [0.01, 0.0]\nbrush_stiffness_per_area = 2e8\n"
GROOVES = """[pattern]
[[pattern.groove]]
[[pattern.groove]]
direction = "circumferential"
width = 0.01
"""
IMAGE = '[pattern]\nfile = "tread.png"\n'


def measured(kind: str, file: str) -> str:
    """A rolling scene on the road of a file that `write_files` writes."""
    road = f'[road]\nkind = "{kind}"\nfile = "{file}"\nend = "mirror"\n'
    return BASE.replace("[road]\n", road)


BASES = {  # text, tables whose keys are changed more often than others
    "rolling": (BASE, ""),
    "forces": (FORCES, "force.|output."),
    "cords": (TIRE + PLIES + PRESSED + ROLLING, "tire.cords|tire.region|damping"),
    "air": (TIRE + AIR + PRESSED + ROLLING, "tire.cavity|greens|modal"),
    "curves": (TIRE + PRESSED + CURVES, "stiffness|static"),
    "corner": (TIRE + PRESSED + CORNER + ROLLING, "axle|road.motion"),
    "deck": (DECK + ROLLING, "tire.|static"),
    "radial": (RADIAL, "tire.cavity|static|tire.footprint"),
    "laser": (measured("laser", "line.csv"), "road."),
    "grid": (measured("grid", "grid.npz"), "road."),
    "crg": (measured("crg", "road.crg"), "road."),
    "creeps": (BASE.replace("[contact]\n", CREEPS), "contact."),
    "brush": (BASE.replace("[contact]\n", BRUSH), "contact."),
    "grooves": (BASE.replace("[contact]\n", ON_GRID) + GROOVES, "pattern."),
    "image": (BASE.replace("[contact]\n", ON_GRID) + IMAGE, "pattern."),
}
NASTY = ["nan", "inf", "-inf", "true", '"text"', '""', "[]", "[1]", "[1, 2, 3]", "{}", "{a = 1}", "0",
         "-0.0", "-1", "1e308", "-1e308", "5e-324", "1" + "0" * 400, "2147483648", "1979-05-27",
         '"' + "x" * 3000 + '"', "nodes", "auto", "{dx = 1e-5, dy = 1}", "{dx = 0.004, dy = 0.004}",
         '"\\u0000"', "../../etc/passwd", "/dev/zero", "/dev/null", "/", "[[1, 2], [3]]"]  # fmt: skip
# Keys whose large values only make a run long.
SIZES = (
    "tire.segments",
    "tire.elements_arc",
    "tire.elements_thickness",
    "tire.order",
    "modal.count",
)


def write_files(folder: Path) -> None:
    """The files of the scenes: a small torus with a slanted ply as a deck, a rough road by line, grid and OpenCRG,
    and a tread's pattern as an image."""
    arcs = np.linspace(-HALF_ANGLE, HALF_ANGLE, 33)
    belt = membranes("B", 0.006, arcs, 9001, 9001, True, 70.0)
    (folder / "tire.inp").write_text(plain(Torus(arcs=8, wall=1)) + belt + CORDS)
    x, y = 0.005 * np.arange(601), 0.005 * np.arange(-40, 41)
    z = 5e-4 * np.sin(x[:, None] / 0.03) * np.cos(y / 0.05) + 2e-4 * np.cos(x[:, None] / 0.011)
    np.savez(folder / "grid.npz", x=x, y=y, z=z)
    x = 0.0005 * np.arange(6001)
    line = np.column_stack([x, 5e-4 * np.sin(x / 0.03) + 2e-4 * np.cos(x / 0.011)])
    np.savetxt(folder / "line.csv", 1e3 * line, delimiter=",")
    (folder / "road.crg").write_bytes(crg("KDBI", z[::2, ::10]))
    ink = np.add.outer(np.arange(64), np.arange(400)) % 40 < 6
    imsave(folder / "tread.png", 1.0 - ink, cmap="gray")


def value(rng: np.random.Generator, key, legal: bool) -> str:
    """A value of a key in TOML: one of its range, its ends included, or anything at all."""
    if not legal and rng.random() < 0.6:
        return str(rng.choice(NASTY))
    if key.choices:
        return str(rng.choice(list(key.choices)))
    if key.values == "true, false":
        return str(rng.choice(["true", "false"]))
    if key.limits is None:
        return str(rng.choice(NASTY))
    if "numbers" in key.values:
        counted = key.values.split()[0]
        count = int(counted) if counted.isdigit() else int(rng.integers(1, 4))
        return f"[{', '.join(_number(rng, key.limits, legal) for _ in range(count))}]"
    number = _number(rng, key.limits, legal)
    return str(int(float(number))) if key.values == str(key.limits) and key.unit == "-" else number


def _number(rng: np.random.Generator, limits, legal: bool) -> str:
    low, high = (limits.least, limits.most) if limits.least is not None else (-1e3, 1e3)
    kind = rng.integers(4)
    if kind == 0:
        return repr(float(rng.choice([low, high])))
    if kind == 1 and low >= 0 and high > 0:
        return repr(float(np.exp(rng.uniform(np.log(max(low, 1e-9 * high)), np.log(high)))))
    if kind == 2 and not legal:
        return repr(float(rng.choice([low, high]) * (1 + rng.choice([-1e-9, 1e-9, 1e-3, -2.0]))))
    return repr(float(rng.uniform(low, high)))


def needed(name: str, of: type, key) -> list[str]:
    """What must be set for a key to be one of its table's kind."""
    table = name.rpartition(".")[0]
    found = []
    registries = ("road.kind", ROADS), ("contact.tread", TREADS), (f"{table}.model", MATERIALS)
    for selector, registry in registries:
        kinds = [kind for kind in registry if registry[kind] is of]
        found += [f"{selector}={kind}" for kind in kinds if not kind.startswith(("grid", "crg"))]
    if key.only_for is not None and key.only_for[0] != "section":
        found.append(f"{table}.{key.only_for[0]}={key.only_for[1][0]}")
    return found


def overrides(rng: np.random.Generator, legal: bool, focus: str = "") -> list[str]:
    """Some keys with random values, more of them of the tables in `focus`."""
    known = [(name.replace("[]", ".0"), of, key) for name, of, _, key in walk(Scene)]
    if legal:
        known = [k for k in known if not k[2].is_file and k[0] not in SIZES and k[0] != "name"]
    near = [k for k in known if focus and k[0].startswith(tuple(focus.split("|")))]
    changed = []
    for _ in range(rng.integers(1, 4 if legal else 6)):
        among = near if near and rng.random() < 0.7 else known
        name, of, key = among[rng.integers(len(among))]
        if legal:
            changed += needed(name, of, key)
        elif rng.random() < 0.1:
            name = name[: rng.integers(1, len(name))]
        changed.append(f"{name}={value(rng, key, legal)}")
    return changed


def damaged(rng: np.random.Generator, text: str) -> bytes:
    """A scene's text with bytes changed, cut, or lines doubled."""
    data = bytearray(text.encode())
    for _ in range(rng.integers(1, 6)):
        data[rng.integers(len(data))] = rng.integers(256)
    if rng.random() < 0.3:
        data = data[: rng.integers(len(data))]
    if rng.random() < 0.3:
        data += data[rng.integers(len(data) + 1) :]
    return bytes(data)
