"""A loop that chatters begins again with damped forces, and is resumed as such."""

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.contact.results.chatter import ANY, LIMIT, Alternation, Chatter
from tireroad.runs.files.cache import Cache
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.process.signals import Stopped
from tireroad.runs.scene.load import load
from tireroad.runs.stages import contact

pytestmark = pytest.mark.slow

SCENE = (
    """
name = "again"
"""
    + soft_torus(12, 4)
    + """[static]
load = 400.0
error_estimate = false
[modal]
count = 12
[rotation]
speed = 40.0
[contact]
youngs_modulus = 1e7
[road]
kind = "sine"
amplitude = 1e-4
wavelength = 0.2
[time]
duration = 0.02
step = 2e-4
"""
)


@pytest.fixture
def run(tmp_path):
    (tmp_path / "again.toml").write_text(SCENE)

    def started(folder: str, *sets: str) -> None:
        scene = load(tmp_path / "again.toml", sets)
        (tmp_path / folder).mkdir(exist_ok=True)
        with console.quiet():
            run_scene(
                scene,
                tmp_path / folder,
                MPI.COMM_SELF,
                until="contact",
                fresh=False,
                petsc_options=[],
                cache=Cache(tmp_path / "cache"),
            )

    return started


def history(folder) -> tuple[np.ndarray, str]:
    with h5py.File(folder / "contact.h5") as file:
        return file["normal_force"][:], file.attrs["scheme"]


@pytest.fixture
def attempts(monkeypatch):
    """Ends so many loops as chattering, and asks the one after them to stop after its first block of steps, once."""
    ended: list[float] = []

    def arrange(count: int) -> list[float]:
        def check(self, limit: float) -> None:
            if len(ended) < count:
                ended.append(limit)
                raise Chatter("points open and close from step to step")

        class StopsOnce:
            asked = False

            def __init__(self, comm, seconds: float) -> None:
                pass

            def __call__(self, signal) -> tuple[str, bool]:
                if len(ended) == count and not StopsOnce.asked:
                    StopsOnce.asked = True
                    return "SIGTERM", False
                return "", False

        monkeypatch.setattr(Alternation, "check", check)
        monkeypatch.setattr(contact, "Watch", StopsOnce)
        return ended

    return arrange


@pytest.mark.parametrize(
    ("ended", "limits", "scheme"),
    [(1, [LIMIT], "damped"), (2, [LIMIT, ANY], "constant")],
    ids=["chatter", "growth"],
)
def test_the_other_scheme_is_tried_and_a_stop_after_it_goes_on_as_begun(
    run, tmp_path, attempts, ended: int, limits: list[float], scheme: str
) -> None:
    """With damped forces where linear ones alternate, and with constant ones where these do not hold."""
    run("whole", f"time.scheme={scheme}")
    tried = attempts(ended)
    with pytest.raises(Stopped):
        run("again")
    run("again")
    assert tried == limits  # the loop that goes on is not tried once more
    (expected, _), (found, name) = (history(tmp_path / folder) for folder in ("whole", "again"))
    assert name == scheme
    assert np.array_equal(found, expected)
    assert np.ptp(found.sum(axis=1)) > 1.0
