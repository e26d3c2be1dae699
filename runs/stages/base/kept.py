"""What one run of a family leaves to the next in the same process, while the static state is the same: matrices above all."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")

MOST = 2  # of a kind: those of a run and of its coarser companion
_kept: dict[str, OrderedDict[Hashable, Any]] | None = None


def begin() -> None:
    """From now on keep them: this process computes one member of a family after the other."""
    global _kept
    _kept = {}


def once(kind: str, key: Hashable, make: Callable[[], T]) -> T:
    """What `make` gives, of the same key that of the run before. Collective where `make` is."""
    if _kept is None:
        return make()
    known = _kept.setdefault(kind, OrderedDict())
    if key not in known:
        while len(known) >= MOST:  # before the new ones take their memory
            known.popitem(last=False)
        known[key] = make()
    known.move_to_end(key)
    return known[key]


def forget() -> None:
    """Nothing is kept: a new static state is computed, of which there are no matrices yet."""
    if _kept is not None:
        _kept.clear()
