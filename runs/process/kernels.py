"""The kernels of OpenBLAS, where it does not know the processor."""

import _ctypes
import ctypes
import os
import resource
from pathlib import Path

UNKNOWN = b"Prescott"  # what OpenBLAS takes on x86-64 for want of a better one: SSE3, two numbers at a time
_FLAGS = (  # what a kernel needs, the widest first
    ("SkylakeX", {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl", "fma"}),
    ("Haswell", {"avx2", "fma"}),
)


def choose_kernels() -> None:
    """Set OPENBLAS_CORETYPE to what the processor can, where OpenBLAS takes its oldest kernels.

    OpenBLAS of Debian 12 (0.3.21) knows no processor made since: there dense products took five times as long,
    the static state of a passenger tire twice. To call before anything loads OpenBLAS; a value of the user's
    stays, and so does an OpenBLAS by another name. Not collective.
    """
    if "OPENBLAS_CORETYPE" in os.environ or _kernels() != UNKNOWN:
        return
    name = able(Path("/proc/cpuinfo"))
    if name:
        os.environ["OPENBLAS_CORETYPE"] = name


def able(processors: Path) -> str:
    """The widest kernels that the processor of a /proc/cpuinfo can run; empty where the oldest are right."""
    try:
        lines = processors.read_text().splitlines()
    except OSError:
        return ""
    flags = next((set(line.split()) for line in lines if line.startswith("flags")), set())
    return next((name for name, needed in _FLAGS if needed <= flags), "")


def _kernels() -> bytes:
    """What OpenBLAS chose; empty where it cannot be asked. It is unloaded again, so that it may choose anew."""
    if resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY:
        return b""  # with little room OpenBLAS waits for ever
    try:
        library = ctypes.CDLL("libopenblas.so.0")
        name = library.openblas_get_corename
    except (OSError, AttributeError):
        return b""
    name.restype = ctypes.c_char_p
    chosen = bytes(name())
    _ctypes.dlclose(library._handle)
    return chosen
