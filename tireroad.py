"""tireroad: a rolling tire on a rough road.

The packages `fem`, `modal`, `greens`, `contact` and `runs` beside this file are
`tireroad.fem` and so on. Installed, this file is the package's `__init__`; in a checkout it is a
module that finds them where they lie. So nothing but `tireroad` is a top-level name anywhere.
"""

from pathlib import Path

__path__ = [str(Path(__file__).resolve().parent)]
