"""Cache of figures drawn by this process, for members of a sweep that show the same ones."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import numpy as np

P = ParamSpec("P")

MOST = 16  # figures, each up to some hundred kB
_drawn: OrderedDict[bytes, str] = OrderedDict()


def once(draw: Callable[P, str]) -> Callable[P, str]:
    """Decorate `draw` to keep its latest figures and reuse them for bitwise equal arguments."""

    @wraps(draw)
    def drawn(*given: P.args, **named: P.kwargs) -> str:
        key = _digest(draw.__qualname__, given, sorted(named.items()))
        if key not in _drawn:
            _drawn[key] = draw(*given, **named)
        _drawn.move_to_end(key)
        while len(_drawn) > MOST:
            _drawn.popitem(last=False)
        return _drawn[key]

    return drawn


def _digest(*given: Any) -> bytes:
    """Hash of arrays by their bytes, of sequences item by item, of anything else by its repr."""
    digest = hashlib.sha256()
    for one in given:
        if isinstance(one, np.ndarray):
            digest.update(f"{one.dtype}{one.shape}".encode() + np.ascontiguousarray(one).tobytes())
        elif isinstance(one, list | tuple):
            digest.update(f"{len(one)}".encode() + _digest(*one))
        else:
            digest.update(repr(one).encode())
        digest.update(b"\0")
    return digest.digest()
