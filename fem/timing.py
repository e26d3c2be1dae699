"""Seconds by part of a solver."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ClassVar


class Timing(dict[str, float]):
    """`with timing("assembly"):` adds the seconds inside to that part, by the `clock`. Not collective."""

    clock: ClassVar[Callable[[], float]] = time.perf_counter

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        began = Timing.clock()
        yield
        self[part] = self.get(part, 0.0) + Timing.clock() - began

    def take(self, other: Timing) -> None:
        """Add the seconds of another solver, which starts from none again."""
        for part, seconds in other.items():
            self[part] = self.get(part, 0.0) + seconds
        other.clear()


@contextmanager
def by_processor() -> Iterator[None]:
    """While inside, seconds are those that the processor works for this process: what a busy machine changes little."""
    before, Timing.clock = Timing.clock, time.process_time
    try:
        yield
    finally:
        Timing.clock = before
