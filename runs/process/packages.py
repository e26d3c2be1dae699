"""The packages that the program needs: the message where one is missing, and the versions of all."""

import json
import os
import platform
import sys
from importlib import metadata

from tireroad.runs.process.installation import PACKAGES, compiler

NEEDED = {*PACKAGES, "basix", "ffcx", "ufl", "cffi", "pytest"}
_INSTALL = (
    "./tireroad of a checkout finds or installs what is missing, and ./tireroad python runs a script with"
    ' it; with pip: pip install ".[solver]"; with conda: conda install -c conda-forge fenics-dolfinx'
    " petsc4py slepc4py mpi4py h5py scipy matplotlib rich jinja2 threadpoolctl"
)


def missing(error: ModuleNotFoundError) -> str | None:
    """One line about a required package that is missing; None for any other module."""
    package = (error.name or "").partition(".")[0]
    if package not in NEEDED:
        return None
    return f"error: the Python package {package} is missing ({error}): {_INSTALL}"


def installation() -> dict[str, str]:
    """Versions and places of everything a result depends on, by name. Starts MPI; not collective."""
    import dolfinx
    import h5py
    import mpi4py
    from mpi4py import MPI
    from petsc4py import PETSc
    from slepc4py import SLEPc

    from tireroad.fem import form_cache
    from tireroad.runs.files.cache import Cache
    from tireroad.runs.files.store import libraries
    from tireroad.runs.version import PROGRAM, VERSION

    folder = Cache.of_user().folder
    return {
        PROGRAM: VERSION,
        "Python": f"{platform.python_version()} ({sys.executable})",
        **libraries(),
        "dolfinx": dolfinx.__version__,
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
        "SLEPc": ".".join(map(str, SLEPc.Sys.getVersion())),
        "MPI": MPI.Get_library_version().partition("\n")[0].partition(",")[0].strip("\0"),
        "mpi4py": mpi4py.__version__,
        "matplotlib": metadata.version("matplotlib"),
        "h5py": f"{h5py.__version__} (HDF5 {h5py.version.hdf5_version})",
        "BLAS": _blas(),
        "C compiler": compiler() or "none",
        "machine": f"{platform.machine()}, {len(os.sched_getaffinity(0))} of {os.cpu_count()} cores",
        "cache of stages": str(folder or "off"),
        "cache of forms": str(form_cache.kept_in()),
    }


def described(as_json: bool) -> str:
    """`installation` as text, one line each, or as JSON."""
    setup = installation()
    if as_json:
        return json.dumps(setup, indent=2)
    width = max(map(len, setup))
    return "\n".join(f"{name:{width}s}  {text}" for name, text in setup.items())


def _blas() -> str:
    """BLAS libraries with their kernels and threads; scipy's and PETSc's may be two."""
    import threadpoolctl

    libraries = [
        f"{library['internal_api']} {library['version']} ({library.get('architecture', 'unknown kernels')},"
        f" {library['num_threads']} thread{'s' if library['num_threads'] > 1 else ''})"
        for library in threadpoolctl.threadpool_info()
        if library["user_api"] == "blas"
    ]
    return "; ".join(dict.fromkeys(libraries)) or "unknown"
