"""The environment of programs that tests start."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

MPIRUN = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_orte_execute_quiet": "1",
    "PMIX_MCA_mca_base_suppress_deprecated_warning": "1",
    "OMPI_MCA_btl": "self,vader",
    "OMPI_MCA_odls_base_sigkill_timeout": "0",
    "TIREROAD_CACHE": "off",
}
"""What the launcher sets for mpirun, where pytest was started without it."""


def environment(**extra: str) -> dict[str, str]:
    """The environment of a started program; a copy, without what MPI puts into this process's.

    A worker of pytest inherits that if MPI was begun before it was started, as by tests/fem/conftest.py.
    """
    ours = {k: v for k, v in os.environ.items() if k in MPIRUN or not k.startswith(_OF_MPI)}
    return {**MPIRUN, **ours, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", **extra}


_OF_MPI = ("OMPI_", "PMIX_", "PRTE_")
