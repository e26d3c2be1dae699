"""Settings that must be made before shared libraries are loaded: BLAS kernels, MPI in a Slurm step, MPI and compiler of wheels."""

import _ctypes
import ctypes
import os
import resource
import shlex
import sys
from importlib import metadata
from pathlib import Path

from tireroad.runs.process import signals
from tireroad.runs.process.installation import compiler, found

UNKNOWN = b"Prescott"  # OpenBLAS's fallback on x86-64: SSE3, two numbers at a time
_FLAGS = (  # CPU flags required by each kernel, the widest first
    ("SkylakeX", {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl", "fma"}),
    ("Haswell", {"avx2", "fma"}),
)


def prepare() -> None:
    """Settle all of it. Changes OPENBLAS_CORETYPE and CC where they are needed and not set, forgets SLURM_NODELIST where
    Slurm has started one process without MPI, and loads
    the MPI library of the mpich wheel where dolfinx is a wheel. Not collective, does not start MPI."""
    choose_kernels()
    if signals.without_mpi(os.environ) == 1:
        del os.environ["SLURM_NODELIST"]
    if found("dolfinx_solver"):
        _load_mpi_of_wheel()
    if compiler() is None and found("ziglang"):
        os.environ["CC"] = f"{shlex.quote(sys.executable)} -m ziglang cc"


def _load_mpi_of_wheel() -> None:
    """dolfinx and PETSc of the wheel dolfinx-solver-real are linked to libmpi.so.12 without saying
    where it is: they find the one that is loaded."""
    try:
        files = metadata.files("mpich") or []
    except metadata.PackageNotFoundError:
        return  # another MPI was chosen for them
    for file in files:
        if file.name == "libmpi.so.12":
            ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)
            return


def choose_kernels() -> None:
    """Set OPENBLAS_CORETYPE to what the processor can do, if OpenBLAS takes its oldest kernels.

    OpenBLAS of Debian 12 (0.3.21) recognises no later processor: there dense products took five
    times as long, the static state of a passenger tire twice. Must be called before anything loads
    OpenBLAS. A value set by the user is kept; an OpenBLAS under another name is not changed. Not
    collective.
    """
    if "OPENBLAS_CORETYPE" in os.environ or _kernels() != UNKNOWN:
        return
    name = able(Path("/proc/cpuinfo"))
    if name:
        os.environ["OPENBLAS_CORETYPE"] = name


def able(processors: Path) -> str:
    """The widest kernels that the processor in a /proc/cpuinfo supports; "" if the oldest fit."""
    try:
        lines = processors.read_text().splitlines()
    except OSError:
        return ""
    flags = next((set(line.split()) for line in lines if line.startswith("flags")), set())
    return next((name for name, needed in _FLAGS if needed <= flags), "")


def _kernels() -> bytes:
    """The kernels OpenBLAS chose; empty if unknown. Unloads it again, so that it chooses anew."""
    if resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY:
        return b""  # with little address space OpenBLAS waits forever
    try:
        library = ctypes.CDLL("libopenblas.so.0")
        name = library.openblas_get_corename
    except (OSError, AttributeError):
        return b""
    name.restype = ctypes.c_char_p
    chosen = bytes(name())
    _ctypes.dlclose(library._handle)
    return chosen
