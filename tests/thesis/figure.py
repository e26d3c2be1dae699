"""A figure or table of the thesis: name, content, and the function that recomputes it."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tireroad.fem.errors import InputError
from tireroad.tests.thesis.claim import Claim, verdict
from tireroad.tests.thesis.runner import Scenes


@dataclass(frozen=True, kw_only=True)
class Reproduced:
    """The program's result: a line, `claims`, a `picture` (data URI; root process), its caption."""

    shows: str
    claims: tuple[Claim, ...]
    picture: Callable[[], str] | None = None
    caption: str = ""

    @property
    def verdict(self) -> str:
        """Verdict on all claims together."""
        return verdict(self.claims)


@dataclass(frozen=True, kw_only=True)
class Figure:
    """`name` on the command line, `title`, a line on the `thesis`, and `compute` (collective)."""

    name: str
    title: str
    thesis: str
    compute: Callable[[Scenes], Reproduced]


FIGURES: dict[str, Figure] = {}


def figure(name: str, title: str, thesis: str) -> Callable:
    """Decorate a collective function of the scenes that computes the named figure."""

    def add(compute: Callable[[Scenes], Reproduced]) -> Callable[[Scenes], Reproduced]:
        FIGURES[name] = Figure(name=name, title=title, thesis=thesis, compute=compute)
        return compute

    return add


def chosen(names: Sequence[str], known: dict[str, Figure]) -> list[Figure]:
    """The figures with these names, each once, in the order of the thesis; all without names.

    Raises InputError for an unknown name, suggesting one like it.
    """
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.6)
            hint = f" did you mean {near[0]}?" if near else ""
            raise InputError(f"reproduce: there is no {name!r}:{hint} there are {', '.join(known)}")
    return [one for name, one in known.items() if name in names or not names]
