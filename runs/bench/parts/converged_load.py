"""Part of `bench discretisation`: load and footprint at given heights of the road against a sequence that converges."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe

HEIGHTS = (0.002, 0.005, 0.010, 0.015, 0.020)  # m above the first touch of the finest
CUTS = 2  # times that elements at the footprint are cut in two
QUANTITIES = ("load", "length", "width")


@dataclass(frozen=True)
class Pressed:
    """`load` N, `length` and `width` m of the footprint, `estimate` % of the load's error (None: not asked for)."""

    load: float
    length: float
    width: float
    estimate: float | None = None

    @property
    def values(self) -> np.ndarray:
        """Load, length, width."""
        return np.array([self.load, self.length, self.width])


@dataclass(frozen=True)
class Converged:
    """What ever smaller elements come to, as `values` of Pressed, and how sure that is, `error` (3,) relative."""

    values: np.ndarray
    error: np.ndarray


def converged(sequence: list[Pressed]) -> Converged:
    """The limit of a sequence of halved sizes, by Aitken where it closes in, else its last; the error is what
    the last step changed."""
    last = np.array([one.values for one in sequence[-3:]])
    before, step = last[-2] - last[-3], last[-1] - last[-2]
    ratio = np.divide(step, before, out=np.ones(3), where=before != 0)
    closing = np.where((ratio > 0) & (ratio < 0.7), ratio / (1 - np.clip(ratio, 0, 0.7)), 0.0)
    return Converged(last[-1] + closing * step, np.abs(step / last[-1]))


def at_heights(loader, heights, cuts: int = 0) -> list[tuple[Pressed, Converged | None]]:
    """An inflated tire at each height (m, of the road), with the estimate; and what it converges to with its
    elements at the footprint cut in two, `cuts` times over. Collective."""
    from tireroad.fem.static.load_error import at_finer_footprint, load_error

    found = []
    rolling = loader.equilibrium.rolling
    for _ in loader.visit([height - loader.touch for height in heights]):
        estimate = load_error(loader, rolling)
        known = None if isinstance(estimate, str) else 100 * estimate.relative
        own = pressed(loader, known)
        sequence, finer = [own], loader
        for _ in range(cuts):
            finer = at_finer_footprint(finer, rolling)
            sequence.append(pressed(finer))
        found.append((own, converged(sequence) if cuts >= 2 else None))
    return found


def pressed(loader, estimate: float | None = None) -> Pressed:
    """Load and footprint of a tire on the road. Collective."""
    from tireroad.fem.static.state import static_state

    # Of a companion the first touch is not known; the footprint does not ask for it.
    extent = static_state(loader.equilibrium, 0.0).footprint()
    return Pressed(loader.load(), extent.length, extent.width, estimate)


def table(meshes: dict[str, object], reference: str, make) -> Table:
    """Of `meshes`, sections by name; `make(section)` gives an inflated loader; `reference` names the one whose
    footprint is cut. Collective."""
    exact = make(meshes[reference])
    heights = [exact.touch + height for height in HEIGHTS]
    observe.say("  loads: the sequence that converges ...")
    truth = at_heights(exact, heights, CUTS)
    rows = []
    for name, section in meshes.items():
        began = time.process_time()
        found = truth if name == reference else at_heights(make(section), heights)
        seconds = time.process_time() - began
        observe.say(f"  loads: {name}, {seconds:.1f} s")
        for height, (own, _), (_, limit) in zip(HEIGHTS, found, truth, strict=True):
            off = 100 * (own.values / limit.values - 1)
            ratio = own.estimate / abs(float(off[0]))
            rows.append([name, 1e3 * height, *map(float, off), own.estimate, ratio])
    sure = max(float(limit.error[0]) for _, limit in truth)
    return Table(
        "Load and footprint at given heights of the road",
        [
            ("mesh", ""),
            ("above first touch", "mm"),
            ("error of the load", "%"),
            ("of the length", "%"),
            ("of the width", "%"),
            ("estimated error of the load", "%"),
            ("estimated over true", "-"),
        ],
        rows,
        [
            f"Against {reference} with its elements at the footprint cut in two {CUTS} times, extrapolated; the last "
            f"cut changes the load by {100 * sure:.2g} % at most. Asked: load 0.5 %, footprint 3 %, estimate 0.5 to 2.",
        ],
    )
