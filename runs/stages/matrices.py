"""Matrices held in memory for a family's next run with the same static state."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")
MOST = 2  # per kind: those of a run and of its coarser companion
_kept: dict[str, OrderedDict[Hashable, Any]] | None = None


def keep_matrices() -> None:
    """Start keeping: this process computes the members of a family one after the other."""
    global _kept
    _kept = {}


def memoize(kind: str, key: Hashable, make: Callable[[], T]) -> T:
    """The value of `make`, or that of an earlier run with the same key. Collective if `make` is."""
    if _kept is None:
        return make()
    known = _kept.setdefault(kind, OrderedDict())
    if key not in known:
        while len(known) >= MOST:  # freed before the new ones need the memory
            known.popitem(last=False)
        known[key] = make()
    known.move_to_end(key)
    return known[key]


def forget_matrices() -> None:
    """Drop everything, before a new static state: matrices belong to one state."""
    if _kept is not None:
        _kept.clear()
