"""Compiled C beside a module: one library a source file, kept in the user's cache like the forms.

A source declares its interface for Python between two marks,

    // for Python
    ...
    // end

in C that cffi reads, so each structure and function is declared once. Dense products and factors come from the
BLAS and LAPACK that SciPy is linked to: a source that declares `blas` has it filled.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sysconfig
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cython_blas, cython_lapack

from tireroad.fem.errors import InputError
from tireroad.fem.form_cache import user_folder

# Sums may be reordered, for vector instructions; infinities and numbers that are none keep their meaning.
FLAGS = ("-O3", "-march=native", "-std=gnu11", "-fno-math-errno", "-fno-trapping-math", "-fassociative-math",
         "-fno-signed-zeros", "-shared", "-fPIC", "-Wl,-Bsymbolic")  # fmt: skip
INCLUDED = Path(__file__).with_name("products.h")
_BEGIN, _END = "// for Python\n", "// end\n"


def cpu() -> str:
    """Hash of the processor type, which is part of the name of what is compiled for it.

    It separates the compiled code of different processors that share a cache, such as the nodes of a
    cluster.
    """
    try:
        with open("/proc/cpuinfo") as file:
            kind = {line for line in file if line.startswith(("model name", "flags", "Features"))}
    except OSError:
        kind = {platform.processor()}
    return hashlib.sha256("".join(sorted(kind)).encode()).hexdigest()[:12]


class Library:
    """A compiled source: `ffi` and `lib` of cffi, and arrays passed as pointers.

    Compiled by the process that first needs it, in about a second; several at once do no harm, since the file is
    renamed into place. InputError where it cannot be compiled or loaded. Not collective.
    """

    def __init__(self, source: Path) -> None:
        code = source.read_text(encoding="utf-8")
        declared = code[code.index(_BEGIN) + len(_BEGIN) : code.index(_END)]
        self.ffi = cffi.FFI()
        self.ffi.cdef(declared)
        self.lib: Any = self.ffi.dlopen(str(_built(source, code)))
        if "} blas;" in declared:
            self._link()

    def _link(self) -> None:
        linked = self.ffi.addressof(self.lib, "linked")
        for name in dir(linked):
            module = cython_lapack if name in cython_lapack.__pyx_capi__ else cython_blas
            setattr(linked, name, self.ffi.cast("void *", _address(module.__pyx_capi__[name])))

    def doubles(self, values: NDArray[np.float64]) -> Any:
        """Pointer to a contiguous array of doubles, which must outlive its use."""
        return self._pointer("double[]", values, np.float64)

    def ints(self, values: NDArray[np.int32]) -> Any:
        """Pointer to a contiguous array of 32-bit integers."""
        return self._pointer("int[]", values, np.int32)

    def flags(self, values: NDArray[np.bool_]) -> Any:
        """Pointer to a contiguous array of booleans."""
        return self._pointer("uint8_t[]", values, np.bool_)

    def _pointer(self, kind: str, values: NDArray[Any], dtype: type) -> Any:
        assert values.dtype == dtype and values.flags.c_contiguous, f"{values.dtype} for {kind}"
        return self.ffi.from_buffer(kind, values)


@cache
def library(source: Path) -> Library:
    """The library of a C source, compiled at most once for this processor."""
    return Library(source)


def _built(source: Path, code: str) -> Path:
    """The shared library of a source, from the cache or compiled into it."""
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    parts = code, INCLUDED.read_text(encoding="utf-8"), *FLAGS, command, cpu()
    name = f"{source.stem}-{hashlib.sha256('|'.join(parts).encode()).hexdigest()[:16]}.so"
    try:
        folder = user_folder() / "compiled"
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / name).exists():
            return folder / name
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".part", delete=False) as file:
            part = Path(file.name)
    except OSError:  # nothing can be kept there: compiled anew in every process
        folder = Path(tempfile.mkdtemp(prefix="tireroad-compiled-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        part = folder / f"{name}.part"
    try:
        run = [
            *shlex.split(command),
            *FLAGS,
            f"-I{INCLUDED.parent}",
            str(source),
            "-o",
            str(part),
            "-lm",
        ]
        done = subprocess.run(run, capture_output=True, text=True)
        if done.returncode:
            raise InputError(
                f"{source.name} cannot be compiled ({command}: {done.stderr.strip()[-500:]}): this needs a C compiler"
                " (CC names another one)"
            )
        os.replace(part, folder / name)
    except OSError as error:
        raise InputError(
            f"{source.name} cannot be compiled into {folder} ({error}): this needs a C compiler and some room; name"
            " another folder by XDG_CACHE_HOME, another compiler by CC"
        ) from error
    finally:
        part.unlink(missing_ok=True)
    return folder / name


def _address(capsule: Any) -> int:
    """The address of a function that a Cython module exports."""
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = (
        ctypes.c_char_p,
        [ctypes.py_object],
    )
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule)))
