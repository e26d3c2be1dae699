"""Differences between installations: libraries that do not fit together; forms as plain libraries."""

import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from started import environment

from tireroad.fem import compat

OPEN_MPI = "7f-80 r-xp 00000000 08:01 1 /usr/lib/x86_64-linux-gnu/libmpi.so.40.30.4\n"
MPICH = "7f-80 r-xp 00000000 08:01 2 /home/a/env/lib/libmpi.so.12.7.0\n"
BINDINGS = (
    "7f-80 r-xp 00000000 08:01 3 /usr/lib/libmpi_cxx.so.40.30.1\n7f-80 rw-p 00000000 00:00 0\n"
)
PETSC = "7f-80 r-xp 00000000 08:01 4 /usr/lib/libpetsc_real.so.3.18.5\n"

LOAD = """
import tireroad as tr
from tireroad.fem import compat
import cffi, importlib, sys
import ffcx.codegeneration.jit as jit
if sys.argv[1] == "extension modules":
    import importlib.util
    jit.cffi, jit.importlib = cffi, importlib
    compat.JIT["cffi_extra_compile_args"].remove("-shared")
else:
    assert jit.cffi.FFI is compat._PlainBuilder
tire = tr.torus(youngs_modulus=48e6, segments=8, elements_arc=4, order=1)
print(tr.press(tire, inflation=2e5, deflection=0.002).load)
"""


@pytest.mark.parametrize(
    ("version", "scalar", "maps", "says"),
    [
        ("0.11.0.post0", np.float64, OPEN_MPI * 2 + BINDINGS + PETSC, ""),
        ("0.4.1", np.float64, "", "too old"),
        ("0.9.0", np.complex128, "", "real ones are needed"),
        ("0.9.0", np.float64, OPEN_MPI + MPICH, "two copies of MPI"),
        ("0.9.0", np.float64, PETSC + PETSC.replace("usr", "opt"), "two copies of PETSc"),
    ],
)
def test_what_does_not_fit_is_named(version: str, scalar: type, maps: str, says: str) -> None:
    found = compat.misfit(version, scalar, maps)
    assert says in found if says else found == ""


@pytest.mark.slow
@pytest.mark.skipif(
    not (Path(sysconfig.get_path("include")) / "Python.h").exists(), reason="no headers of Python"
)
def test_plain_libraries_compute_what_extension_modules_do(tmp_path: Path) -> None:
    """The same load as with the modules that FFCx makes by itself, computed and taken from the cache."""

    def load(kind: str) -> str:
        return subprocess.run(
            [sys.executable, "-P", "-c", LOAD, kind],
            env=environment(XDG_CACHE_HOME=str(tmp_path / kind)),
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    expected = float(load("extension modules"))
    assert [float(load("plain")), float(load("plain"))] == pytest.approx([expected] * 2, rel=1e-12)
