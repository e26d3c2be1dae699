"""A road and a tread law of one's own, in a scene.

Run it with `./tireroad python examples/own_road.py`. A class with a decorator is all it
takes: its parameters become keys of `[road]` and `[contact]` with unit, range and meaning, checked like
any other. Scenes hold no code, so the classes are made known by the script that loads the scene.
"""

import tempfile
from pathlib import Path

import numpy as np
from mpi4py import MPI

import tireroad
from tireroad.contact.roads.road import EndlessRoad, road_kind
from tireroad.contact.tread.law import TreadLaw, tread_law
from tireroad.fem.parameters import ParameterError, number
from tireroad.runs.pipeline import run_scene
from tireroad.runs.scene.load import load


@road_kind("humps", "rounded humps across the road, one after the other")
class Humps(EndlessRoad):
    """z = h cos²(pi x'/l) for |x'| < l/2, x' the distance from the nearest hump's middle."""

    hump: float = number(0.005, "m", "height of a hump", least=0, most=0.2)
    length: float = number(0.05, "m", "length of a hump", least=0.005, most=10)
    pitch: float = number(
        0.2, "m", "distance between the middles of two humps", least=0.01, most=100
    )

    def validate(self) -> None:
        if self.length > self.pitch:
            raise ParameterError("length", f"= {self.length:g} m must not be more than pitch")

    @property
    def spacing(self) -> float:
        return self.length / 4

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        place = (np.asarray(x) + self.pitch / 2) % self.pitch - self.pitch / 2
        wave = np.cos(np.pi * place / self.length) ** 2
        return self.hump * np.where(np.abs(place) < self.length / 2, wave, 0.0)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        return self.hump

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        return 0.0


@tread_law(
    "brush-blocks", "tread blocks that do not touch each other: springs of modulus over height"
)
class Blocks(TreadLaw):
    """1/(k A) at each point of area A, k = share E/h."""

    modulus: float = number(1e7, "Pa", "Young's modulus of the blocks", least=1e5, most=1e10)
    block_height: float = number(0.008, "m", "height of the blocks", least=1e-3, most=0.1)
    share: float = number(
        0.7, "-", "share of the tread that is rubber, not groove", least=0.1, most=1
    )

    def influence(self, farthest: float):
        stiffness = self.share * self.modulus / self.block_height

        def of(x, y, a, b):
            return np.where((x == 0) & (y == 0), 1 / (4 * a * b * stiffness), 0.0)

        return of


SCENE = """
name = "own-road"
tire = { segments = 24, elements_arc = 8, material = { youngs_modulus = 48e6 } }
static = { load = 400.0 }
modal = { count = 30 }
rotation = { speed = 30.0 }
contact = { tread = "brush-blocks", modulus = 8e6 }
road = { kind = "humps", hump = 0.003, pitch = 0.15, run_in = 0.0 }
time = { duration = 0.02, step = 1e-4 }
"""


def main() -> float:
    """The largest load (N) as the tire rolls over a hump."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(SCENE)
        scene = load(folder / "scene.toml")
        run_scene(scene, folder, MPI.COMM_WORLD, until="contact", fresh=False, petsc_options=[])
        force = tireroad.load(folder)["contact/normal_force"].sum(axis=1)
    print(f"{force[0]:.1f} N at rest, {force.max():.1f} N at most")
    return float(force.max())


if __name__ == "__main__":
    main()
