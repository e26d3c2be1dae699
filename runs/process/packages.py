"""The packages that the program needs: the message where one is missing, and the versions of all."""

import json
import os
import platform
import sys
from importlib import metadata

NEEDED = {
    "dolfinx", "basix", "ffcx", "ufl", "petsc4py", "slepc4py", "mpi4py", "h5py", "numpy", "scipy",
    "matplotlib", "rich", "jinja2", "threadpoolctl", "cffi", "pytest",
}  # fmt: skip
_INSTALL = (
    "./tireroad of a checkout finds or installs what is missing, and ./tireroad python runs a script with"
    ' it; with pip: pip install ".[solver]"; with conda: conda install -c conda-forge fenics-dolfinx'
    " petsc4py slepc4py mpi4py h5py scipy matplotlib rich jinja2 threadpoolctl"
)
_DISTRIBUTIONS = "ufl", "mpi4py", "numpy", "scipy", "matplotlib"


def missing(error: ModuleNotFoundError) -> str | None:
    """One line about a required package that is missing; None for any other module."""
    package = (error.name or "").partition(".")[0]
    if package not in NEEDED:
        return None
    return f"error: the Python package {package} is missing ({error}): {_INSTALL}"


def installation() -> dict[str, str]:
    """Versions and places of everything a result depends on, by name. Starts MPI; not collective."""
    import basix
    import dolfinx
    import ffcx
    import h5py
    from mpi4py import MPI
    from petsc4py import PETSc
    from slepc4py import SLEPc

    from tireroad.fem import compat, form_cache
    from tireroad.runs.files.cache import Cache
    from tireroad.runs.process.installation import compiler
    from tireroad.runs.version import PROGRAM, VERSION

    folder = Cache.of_user().folder
    return {
        PROGRAM: VERSION,
        "Python": f"{platform.python_version()} ({sys.executable})",
        "dolfinx": dolfinx.__version__,
        "basix, ffcx": f"{basix.__version__}, {ffcx.__version__}",
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
        "SLEPc": ".".join(map(str, SLEPc.Sys.getVersion())),
        "MPI": MPI.Get_library_version().partition("\n")[0].partition(",")[0].strip("\0"),
        **{name: _version(name) for name in _DISTRIBUTIONS},
        "h5py": f"{h5py.__version__} (HDF5 {h5py.version.hdf5_version})",
        "BLAS": _blas(),
        "C compiler": compiler() or "none",
        "forms are compiled into": (
            "extension modules" if compat.HAS_HEADERS else "plain libraries (no headers of Python)"
        ),
        "machine": f"{platform.machine()}, {len(os.sched_getaffinity(0))} of {os.cpu_count()} cores",
        "cache of stages": str(folder or "off"),
        "cache of forms": str(form_cache.kept_in()),
    }


def described(as_json: bool) -> str:
    """`installation` as text, one line each, or as JSON."""
    found = installation()
    if as_json:
        return json.dumps(found, indent=2)
    width = max(map(len, found))
    return "\n".join(f"{name:{width}s}  {text}" for name, text in found.items())


def _version(name: str) -> str:
    for distribution in (name, f"fenics-{name}"):
        try:
            return metadata.version(distribution)
        except metadata.PackageNotFoundError:
            continue
    return "unknown"


def _blas() -> str:
    """BLAS libraries with their kernels and threads; scipy's and PETSc's may be two."""
    import threadpoolctl

    found = [
        f"{one['internal_api']} {one['version']} ({one.get('architecture', 'unknown kernels')},"
        f" {one['num_threads']} thread{'s' if one['num_threads'] > 1 else ''})"
        for one in threadpoolctl.threadpool_info()
        if one["user_api"] == "blas"
    ]
    return "; ".join(dict.fromkeys(found)) or "unknown"
