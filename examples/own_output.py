"""An output of one's own in a scene: how long the footprint is from step to step.

Run it with `./tireroad python examples/own_output.py`. A class with a decorator is all it takes: its
parameters become the table `[output.footprint_length]`, checked like any other, and its curves stand in response.h5.
"""

import tempfile
from pathlib import Path
from typing import ClassVar

import numpy as np
from mpi4py import MPI

import tireroad
from tireroad.fem.parameters import number
from tireroad.runs.pipeline import run_scene
from tireroad.runs.scene.load import load
from tireroad.runs.scene.outputs import OUTPUTS, Output


@OUTPUTS.register("footprint_length", "length of the footprint over time")
class FootprintLength(Output):
    """Distance between the first and the last point of the patch that carries more than a share of the largest."""

    of: ClassVar[str] = "contact"
    share: float = number(0.01, "-", "least force that counts, of the largest", least=0, most=1)

    def curves(self, seen, record):
        """max x - min x (nt,) m over the points that touch."""
        force, x = seen.of_contact("normal_force"), seen.of_contact("points")[:, 0]
        touches = force > self.share * force.max()
        front = np.where(touches, x, -np.inf).max(axis=1)
        back = np.where(touches, x, np.inf).min(axis=1)
        length = np.where(touches.any(axis=1), front - back, 0.0)
        record.headline["mean length of the footprint"] = (float(length.mean()), "m")
        return {"footprint_length": (length, "m")}


SCENE = """
[tire]
segments = 24
elements_arc = 8
[tire.material]
youngs_modulus = 48e6
[static]
load = 300.0
[modal]
count = 12
[rotation]
speed = 50.0
[contact]
youngs_modulus = 1e7
points = { dx = 0.005, dy = 0.01 }
[road]
kind = "sine"
amplitude = 2e-4
[time]
duration = 0.02
step = 4e-4
[accuracy]
estimate = false
[output.footprint_length]
share = 0.02
"""


def main() -> np.ndarray:
    """Length (nt,) of the footprint, m."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(SCENE)
        (out := Path(folder) / "results").mkdir()
        run_scene(load(path), out, MPI.COMM_WORLD, until="response", fresh=False, petsc_options=[])
        return tireroad.load(out)["response/footprint_length"]


if __name__ == "__main__":
    length = main()
    print(f"{1e3 * length.min():.1f} to {1e3 * length.max():.1f} mm")
    OUTPUTS.forget("footprint_length")
