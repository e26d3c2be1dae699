"""The record of a stage: figures, warnings, and time by part."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

from tireroad.fem.timing import Timing

Figures = dict[str, tuple[Any, str]]


@dataclass
class Record:
    """The record of a stage: figures as name: (value, unit), seconds by part."""

    headline: Figures = field(default_factory=dict)
    indicators: Figures = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    cost: Timing = field(default_factory=Timing)

    def line(self) -> str:
        """The headline figures in one line."""
        return ", ".join(
            f"{name} {_shown(v)} {unit}".rstrip(" -") for name, (v, unit) in self.headline.items()
        )

    def timing(self, part: str) -> AbstractContextManager[None]:
        """Add the seconds spent inside the context to a part of the stage's cost."""
        return self.cost(part)

    @property
    def shares(self) -> str:
        """Seconds of each part, the largest first."""
        total = sum(self.cost.values()) or 1.0
        parts = sorted(self.cost.items(), key=lambda part: -part[1])
        return "time: " + ", ".join(f"{k} {v:.2g} s ({v / total:.0%})" for k, v in parts)


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
