"""What several tests need: the repository, the measured roads, the program started as users do."""

import ctypes
import gc
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from started import ROOT, environment

import tireroad  # noqa: F401 - before numpy: it chooses the kernels of BLAS

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
os.environ["TIREROAD_CACHE"] = "off"  # the user's has stages of earlier runs


@pytest.fixture(scope="session", autouse=True)
def collected() -> None:
    """The garbage collector passes over what collecting the tests has made: 1.4 s less after each module."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def released(request: pytest.FixtureRequest) -> Iterator[None]:
    """What a module keeps for its tests ends with it, PETSc's objects too, and the C library gives its memory back.

    Without that workers grew to 7 GB: 1.4 GB after one module, 0.3 GB of them in use.
    """
    handlers = {number: signal.getsignal(number) for number in STOPS}
    yield
    for number, handler in handlers.items():  # a command run in this process ends deaf to them
        signal.signal(number, handler)
    for kept in vars(request.module).values():
        if hasattr(kept, "cache_clear") and kept.__module__ == request.module.__name__:
            kept.cache_clear()
    gc.collect()
    # Under mpirun not here: a module that fails on one process would leave the others waiting.
    if (
        "tireroad.fem.collective" in sys.modules
        and os.environ.get("OMPI_COMM_WORLD_SIZE", "1") == "1"
    ):
        from mpi4py import MPI

        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
            sys.modules["tireroad.fem.collective"].collect(comm)
    with suppress(OSError, AttributeError):  # of glibc alone
        ctypes.CDLL("libc.so.6").malloc_trim(0)


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's root."""
    return ROOT


@pytest.fixture(scope="session")
def roads() -> Path:
    """The folder of measured roads, which are not ours to keep here."""
    folder = Path(os.environ.get("TIREROAD_ROADS", ROOT.parent / "shared" / "roads"))
    if not folder.is_dir():
        pytest.skip(f"no measured roads: {folder} is absent (set TIREROAD_ROADS)")
    return folder


@pytest.fixture(scope="session")
def launch() -> Callable[..., subprocess.CompletedProcess]:
    """Run `python3 *arguments` on `processes` processes; the completed process with its texts."""

    def run(*arguments: object, processes: int = 1, **options) -> subprocess.CompletedProcess:
        command = [sys.executable, "-P", *map(str, arguments)]
        if processes > 1:
            command = ["mpirun", "-n", str(processes), *command]
        options.setdefault("env", environment())
        return subprocess.run(command, capture_output=True, text=True, timeout=1200, **options)

    return run


@pytest.fixture(scope="session")
def ran(launch) -> Callable[..., tuple[str, dict]]:
    """Run a scene file into a folder, with options; what was printed and the stages of the summary."""

    def run(scene: Path, out: Path, *options: str, processes: int = 1, status: int = 0):
        start = "-m", "runs", "run", scene, "--out", out, *options
        done = launch(*start, processes=processes)
        assert done.returncode == status, done.stderr + done.stdout
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        return done.stdout + done.stderr, summary["stages"]

    return run
