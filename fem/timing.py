"""Seconds spent in each part of a solver."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ClassVar


class Timing(dict[str, float]):
    """`with timing("assembly"):` adds the seconds inside to that part. Not collective."""

    clock: ClassVar[Callable[[], float]] = time.perf_counter

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        began = Timing.clock()
        yield
        self[part] = self.get(part, 0.0) + Timing.clock() - began

    def take(self, other: Timing) -> None:
        """Add the seconds of another solver and reset those to zero."""
        for part, seconds in other.items():
            self[part] = self.get(part, 0.0) + seconds
        other.clear()


@contextmanager
def by_processor() -> Iterator[None]:
    """Inside, measure CPU time of this process, which other load on the machine changes little."""
    before, Timing.clock = Timing.clock, time.process_time
    try:
        yield
    finally:
        Timing.clock = before
