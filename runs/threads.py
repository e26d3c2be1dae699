"""Threads of OpenBLAS, which a time loop of small products is better off without."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

# As Debian and conda name them, and as the wheels of numpy and scipy do.
_NAMES = ("openblas_{}", "scipy_openblas_{}64_", "openblas_{}64_")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """While inside, OpenBLAS computes with one thread; nothing where it is not the BLAS in use.

    Matrices of a contact step (a megabyte) are read as fast by one core as by two, and threads that
    wait for each other in every product take other programs' time and, where cores are shared, ten
    times their own. Sums then also have one order, whatever machine computes them.
    """
    before = [(setter, getter()) for setter, getter in _libraries()]
    for setter, _ in before:
        setter(1)
    try:
        yield
    finally:
        for setter, threads in before:
            setter(threads)


@cache
def _libraries() -> list[tuple]:
    """Setter and getter of the threads of every OpenBLAS this process has loaded."""
    try:
        lines = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    paths = {line.split(maxsplit=5)[5] for line in lines if "openblas" in line and "/" in line}
    found = []
    for path in sorted(paths):
        try:
            library = ctypes.CDLL(path)
        except OSError:
            continue
        for name in _NAMES:
            if hasattr(library, name.format("set_num_threads")):
                verbs = ("set_num_threads", "get_num_threads")
                found.append(tuple(getattr(library, name.format(verb)) for verb in verbs))
                break
    return found
