"""Part of `bench discretisation`: load and footprint at given road heights, against their limit."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table

if TYPE_CHECKING:
    from tireroad.fem.static.load_error import LoadError

# Heights (m) above first contact on the finest mesh, each with the number of bisections of the
# elements at the footprint. The edge of a footprint falls anywhere within an element: the width of a
# soft torus at 2 mm deflection went 11.18, 10.69, 10.40, 10.55 mm, which two bisections took for a
# sequence that ends at 9.96. Of the larger footprints a third one takes over 12 GB, two 8 GB.
HEIGHTS = {0.002: 3, 0.005: 3, 0.010: 2, 0.015: 2, 0.020: 2}
QUANTITIES = ("load", "length", "width")


@dataclass(frozen=True)
class Pressed:
    """`load` N, `length` and `width` m of the footprint as solved."""

    load: float
    length: float
    width: float

    @classmethod
    def of(cls, balance) -> Pressed:
        """Figures of a tire in equilibrium (fem.static.load_error)."""
        extent = balance.extent
        return cls(balance.load, extent.length, extent.width)

    @property
    def values(self) -> np.ndarray:
        """Load, length, width."""
        return np.array([self.load, self.length, self.width])


@dataclass(frozen=True)
class Known:
    """A tire at one road height: its `own` state, its `estimate` (fem.static.load_error), and its
    limit, if computed."""

    own: Pressed
    estimate: LoadError
    limit: Converged | None


@dataclass(frozen=True)
class Converged:
    """The limit for ever smaller elements: `values` of Pressed, and relative `error` (3,)."""

    values: np.ndarray
    error: np.ndarray


def converged(sequence: list[Pressed]) -> Converged:
    """The limit of a sequence of halved sizes; its error is the change of the last step.

    By Aitken's extrapolation if the whole sequence converges, else its last value.
    """
    values = np.array([one.values for one in sequence])
    steps = np.diff(values, axis=0)
    ratios = np.divide(steps[1:], steps[:-1], out=np.ones_like(steps[1:]), where=steps[:-1] != 0)
    closes = ((ratios > 0) & (ratios < 0.7)).all(axis=0)
    ratio = np.clip(ratios[-1], 0, 0.7)
    limit = values[-1] + np.where(closes, ratio / (1 - ratio), 0.0) * steps[-1]
    return Converged(limit, np.abs(steps[-1] / values[-1]))


def at_heights(loader, cuts: Mapping[float, int]) -> list[Known]:
    """An inflated tire at each road height (m) of `cuts`, with its error estimate.

    From 2 `cuts` on also its limit, from that many bisections of the elements at the footprint.
    Collective.
    """
    from tireroad.fem.static.load_error import Balance, at_finer_footprint, load_error

    found = []
    rolling = loader.equilibrium.rolling
    for height, _ in zip(cuts, loader.visit([at - loader.touch for at in cuts]), strict=True):
        told = load_error(loader, rolling)
        assert not isinstance(told, str), told
        finer = Balance.of(loader, rolling)
        sequence = [Pressed.of(finer)]
        for _ in range(cuts[height]):
            finer = at_finer_footprint(finer)
            sequence.append(Pressed.of(finer))
        found.append(Known(sequence[0], told, converged(sequence) if cuts[height] >= 2 else None))
    return found


def _said() -> str:
    return ", ".join(f"{count} times at {1e3 * height:g} mm" for height, count in HEIGHTS.items())


def table(meshes: dict[str, object], reference: str, make) -> Table:
    """Table of `meshes`, sections by name; `reference` names the one with bisected footprint.

    `make(section)` gives an inflated loader. Collective.
    """
    exact = make(meshes[reference])
    cuts = {exact.touch + height: count for height, count in HEIGHTS.items()}
    console.say("  loads: the sequence that converges ...")
    truth = at_heights(exact, cuts)
    rows = []
    for name, section in meshes.items():
        began = time.process_time()
        found = truth if name == reference else at_heights(make(section), dict.fromkeys(cuts, 0))
        seconds = time.process_time() - began
        console.say(f"  loads: {name}, {seconds:.1f} s")
        for height, one, exact_one in zip(HEIGHTS, found, truth, strict=True):
            limit = exact_one.limit.values
            off = 100 * (one.own.values / limit - 1)
            seen = 100 * (
                np.array([one.estimate.extent.length, one.estimate.extent.width]) / limit[1:] - 1
            )
            estimate = 100 * one.estimate.relative
            ratio = estimate / abs(float(off[0]))
            rows.append([name, 1e3 * height, *map(float, [*off, *seen]), estimate, ratio])
    sure = np.max([one.limit.error for one in truth], axis=0)
    return Table(
        "Load and footprint at given heights of the road",
        [
            ("mesh", ""),
            ("above first touch", "mm"),
            ("error of the load", "%"),
            ("of the length as solved", "%"),
            ("of the width as solved", "%"),
            ("of the length as told", "%"),
            ("of the width as told", "%"),
            ("estimated error of the load", "%"),
            ("estimated over true", "-"),
        ],
        rows,
        [
            f"Against {reference} with its elements at the footprint cut in two {_said()}, extrapolated; the last "
            f"cut changes load, length and width by {', '.join(f'{100 * value:.2g}' for value in sure)} % at most. Footprint as told: of the "
            "companion with elements half as long there. Asked: load 0.5 %, footprint 3 %, estimate 0.5 to 2.",
        ],
    )
