"""tireroad: a rolling tire on a rough road.

The packages `fem`, `modal`, `greens`, `contact` and `runs` beside this file are imported as
`tireroad.fem` and so on, so that `tireroad` is the only top-level name. When installed, this file
is the package's `__init__`; in a checkout it is a module that finds the packages beside it.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

__path__ = [str(Path(__file__).resolve().parent)]

import_module("tireroad.runs.process.libraries").prepare()  # before anything loads BLAS or MPI

# Module of each public name. A name is imported on first use, so that `import tireroad` is cheap
# and reading results does not load the finite elements.
_HOMES = {
    "torus": "tireroad.runs.library",
    "radial": "tireroad.runs.library",
    "press": "tireroad.runs.library",
    "modes": "tireroad.runs.library",
    "roll": "tireroad.runs.library",
    "campbell": "tireroad.runs.library",
    "drive": "tireroad.runs.library",
    "make_road": "tireroad.contact.roads.road",
    "radiate": "tireroad.greens.sound",
    "listen": "tireroad.runs.listen",
    "pass_by": "tireroad.runs.pass_by",
    "loudness": "tireroad.runs.loudness",
    "PorousLayer": "tireroad.greens.absorbing_road",
    "Material": "tireroad.fem.tire.material",
    "compound": "tireroad.fem.tire.material",
    "Turning": "tireroad.fem.wheel",
    "StrainEnergy": "tireroad.fem.wheel",
    "load": "tireroad.runs.results.reader",
    "RunResults": "tireroad.runs.results.reader",
    "InputError": "tireroad.fem.errors",
    "ConvergenceError": "tireroad.fem.errors",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'tireroad' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
