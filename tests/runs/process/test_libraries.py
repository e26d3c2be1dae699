"""Which kernels OpenBLAS is to take where it does not know the processor."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from started import ROOT, environment

from tireroad.runs.process import libraries, signals

WIDE = "avx2 fma avx512f avx512cd avx512bw avx512dq avx512vl"
ASK = "import os, tireroad, numpy; from threadpoolctl import threadpool_info; print([i.get('architecture') for i in threadpool_info()])"
ASK_THREADS = """
from tireroad.runs import start
def status(arguments):
    import numpy, threadpoolctl
    print(*{lib["num_threads"] for lib in threadpoolctl.threadpool_info() if lib["user_api"] == "blas"})
    return 0
start._status = status
start.program()
"""


@pytest.mark.parametrize(
    ("flags", "wanted"),
    [(WIDE, "SkylakeX"), ("sse2 avx2 fma avx512f", "Haswell"), ("sse2 avx", ""), ("avx2", "")],
)
def test_the_widest_that_the_processor_can(tmp_path: Path, flags: str, wanted: str) -> None:
    file = tmp_path / "cpuinfo"
    file.write_text(f"processor\t: 0\nflags\t\t: fpu {flags} sse3\n\nprocessor\t: 1\n")
    assert libraries.able(file) == wanted
    assert libraries.able(tmp_path / "none") == ""


def test_only_where_openblas_knows_nothing_better(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "able", lambda processors: "Haswell")
    # So that the end of the test takes out what is chosen below: OpenBLAS 0.3.34 with the kernels of
    # Haswell crashes on later processors of AMD (its issue 6013), in whatever test comes next.
    monkeypatch.setenv("OPENBLAS_CORETYPE", "")
    for chosen, before, after in (
        (libraries.UNKNOWN, None, "Haswell"),
        (b"Zen", None, None),
        (b"", None, None),
        (libraries.UNKNOWN, "Core2", "Core2"),
    ):
        monkeypatch.setattr(libraries, "_kernels", lambda chosen=chosen: chosen)
        monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
        if before:
            monkeypatch.setenv("OPENBLAS_CORETYPE", before)
        libraries.choose_kernels()
        assert os.environ.get("OPENBLAS_CORETYPE") == after


def test_numpy_gets_them() -> None:
    """OpenBLAS chooses anew when it is loaded again; this fails where it is merely left open."""
    if not libraries.able(Path("/proc/cpuinfo")):
        pytest.skip("a processor without AVX2")
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_CORETYPE"}
    environment["PYTHONPATH"] = str(ROOT)
    found = subprocess.run(
        [sys.executable, "-P", "-c", ASK],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "Prescott" not in found


@pytest.mark.parametrize(("given", "threads"), [({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, 2)])
def test_the_program_takes_one_blas_thread_unless_told(given: dict, threads: int) -> None:
    if (os.cpu_count() or 1) < threads:
        pytest.skip("one core")
    inherited = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    found = subprocess.run(
        [sys.executable, "-P", "-c", ASK_THREADS],
        env={**inherited, "PYTHONPATH": str(ROOT), **given},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert found.split() == [str(threads)]


STEP = {"SLURM_NODELIST": "here", "SLURM_STEP_ID": "0", "SLURM_JOB_ID": "1", "SLURM_PROCID": "0"}


@pytest.mark.parametrize(
    ("more", "count"),
    [
        ({}, 1),
        ({"SLURM_STEP_NUM_TASKS": "1"}, 1),
        ({"SLURM_STEP_NUM_TASKS": "4"}, 4),
        ({"SLURM_STEP_NUM_TASKS": "4", "PMIX_NAMESPACE": "slurm.pmix.1"}, 0),
        ({"OMPI_COMM_WORLD_SIZE": "2"}, 0),
        ({"PMI_RANK": "0"}, 0),
    ],
)
def test_tasks_of_slurm_without_mpi(more: dict[str, str], count: int) -> None:
    assert signals.without_mpi(STEP | more) == count
    assert signals.without_mpi({"SLURM_JOB_ID": "1", **more}) == 0


def test_mpi_starts_in_a_step_of_slurm(tmp_path: Path) -> None:
    """srun --pty: neither a script, nor the launcher's python, nor a command ended before anything was done."""
    size = "from mpi4py import MPI; print('size', MPI.COMM_WORLD.size)"
    (tmp_path / "size.py").write_text(size)
    for command in (
        [sys.executable, "-c", f"import tireroad; {size}"],
        [ROOT / "tireroad", "python", tmp_path / "size.py"],
        [ROOT / "tireroad", "info"],
    ):
        done = subprocess.run(
            command, env=environment(**STEP), capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr
        assert "size 1" in done.stdout or "dolfinx" in done.stdout
    done = subprocess.run(
        [ROOT / "tireroad", "info"],
        env=environment(**STEP, SLURM_STEP_NUM_TASKS="4"),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 2 and "srun started 4 processes without MPI" in done.stderr
