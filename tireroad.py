"""tireroad: a rolling tire on a rough road.

The packages `fem`, `modal`, `greens`, `contact` and `runs` beside this file are
`tireroad.fem` and so on. Installed, this file is the package's `__init__`; in a checkout it is a
module that finds them where they lie. So nothing but `tireroad` is a top-level name anywhere.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

__path__ = [str(Path(__file__).resolve().parent)]

import_module("tireroad.runs.process.kernels").choose_kernels()  # before anything loads BLAS

# Where each public name lives; imported when it is first asked for, so that `import tireroad` costs
# nothing and reading results needs no finite elements.
_HOMES = {
    "torus": "tireroad.runs.library",
    "press": "tireroad.runs.library",
    "modes": "tireroad.runs.library",
    "roll": "tireroad.runs.library",
    "drive": "tireroad.runs.drive",
    "make_road": "tireroad.contact.roads.road",
    "Material": "tireroad.fem.tire.material",
    "compound": "tireroad.fem.tire.material",
    "Turning": "tireroad.fem.turning",
    "load": "tireroad.runs.files.reader",
    "RunResults": "tireroad.runs.files.reader",
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
