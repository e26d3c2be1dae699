"""What several tests need: the repository, the measured roads, the program started as users do."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

MPIRUN = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_orte_execute_quiet": "1",
    "OMPI_MCA_btl": "self,vader",
    "OMPI_MCA_odls_base_sigkill_timeout": "0",
}
"""What the launcher sets for mpirun, where pytest was started without it."""


def environment(**extra: str) -> dict[str, str]:
    """The environment of a started program; a copy, without what MPI puts into this process's."""
    return {**MPIRUN, **os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", **extra}


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
        return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)

    return run
