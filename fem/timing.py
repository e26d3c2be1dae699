"""Seconds by part of a solver."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Timing(dict[str, float]):
    """`with timing("assembly"):` adds the seconds inside to that part. Not collective."""

    @contextmanager
    def __call__(self, part: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self[part] = self.get(part, 0.0) + time.perf_counter() - began
