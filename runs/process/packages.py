"""Message for a required package that is not installed."""

NEEDED = {
    "dolfinx", "basix", "ffcx", "ufl", "petsc4py", "slepc4py", "mpi4py", "h5py", "numpy", "scipy",
    "matplotlib", "rich", "jinja2", "threadpoolctl", "cffi", "pytest",
}  # fmt: skip
_INSTALL = (
    "./tireroad of a checkout installs on Debian what is missing; with conda: conda install -c"
    " conda-forge fenics-dolfinx petsc4py slepc4py mpi4py h5py scipy matplotlib rich jinja2"
    " threadpoolctl"
)


def missing(error: ModuleNotFoundError) -> str | None:
    """One line about a required package that is missing; None for any other module."""
    package = (error.name or "").partition(".")[0]
    if package not in NEEDED:
        return None
    return f"error: the Python package {package} is missing ({error}): {_INSTALL}"
