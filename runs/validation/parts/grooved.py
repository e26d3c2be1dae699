"""Pitch orders of a tread pattern on a rigid wheel: (case, unit, computed, exact).

For grooves that never touch, on a bed of springs, F(t) is the sum of the slick's forces over the
land. Its order n is the groove's Fourier coefficient sin(n pi w/l)/(n pi), with groove width w and
pitch l, times the transform of the slick's force along x.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from tireroad.contact.loop import roll
from tireroad.contact.patch import Patch
from tireroad.contact.roads.kinds.flat import Flat
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.setup import ContactSetup, Rolled
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import winkler_compliance
from tireroad.contact.tread.pattern import Pattern, pitch_starts
from tireroad.runs.measure.synthetic import oval_patch
from tireroad.runs.scene.tables.pattern import Groove

BED, SPEED, STEP, PITCHES = 2e8, 20.0, 1e-4, 40
AROUND = 2.0  # m
WIDTH, LOAD, TIMES = 0.012, 500.0, 10  # m: width of a groove; N; number of pitches that pass


class Rigid:
    """A rigid tire."""

    comm = MPI.COMM_SELF

    def __init__(self, count: int) -> None:
        self.same_step = np.zeros((count, count))

    def start(self, force: np.ndarray) -> None: ...

    def predict(self) -> np.ndarray:
        return np.zeros(len(self.same_step))

    def advance(self, force: np.ndarray) -> None: ...

    def inertia_force(self) -> np.ndarray:
        return np.zeros(3)

    def snapshot(self) -> dict[str, np.ndarray]:
        return {}

    def restore(self, kept: dict[str, np.ndarray]) -> None: ...


def rows() -> Iterator[tuple]:
    """Mean and the first three orders."""
    force, _ = rolled(
        grooves(width=WIDTH, depth=0.05, flank=1e-4), round(TIMES * AROUND / PITCHES / SPEED / STEP)
    )
    yield "patterned tread, mean force", "N", force.mean(), LOAD * (1 - WIDTH * PITCHES / AROUND)
    for order, found in zip((1, 2, 3), orders(force), strict=True):
        yield f"patterned tread, order {order} of its pitches", "N", found, by_hand(order)


def orders(force: np.ndarray) -> np.ndarray:
    """Amplitudes (3,) N of the first orders of a force (steps,) N."""
    lines = 2 * np.abs(np.fft.rfft(force - force.mean())) / len(force)
    return lines[TIMES * np.array([1, 2, 3])]


def by_hand(order: int) -> float:
    """The amplitude of an order in closed form, N."""
    slick, pitch = oval(), AROUND / PITCHES
    along = abs(np.sum(slick.force * np.exp(2j * np.pi * order * slick.points[:, 0] / pitch)))
    return float(abs(2 * np.sin(np.pi * order * WIDTH / pitch) / (np.pi * order)) * along)


def oval() -> Patch:
    """The footprint of a slick."""
    return oval_patch((120, 5), (0.001, 0.02), LOAD)


def grooves(**given) -> Pattern:
    """One groove per pitch, all pitches equal."""
    return Pattern(AROUND, [Groove(**given)], pitch_starts(PITCHES, [1.0], 1, AROUND))


def rolled(pattern: Pattern | None, steps: int) -> tuple[np.ndarray, Patch]:
    """Vertical force (steps,) N of a rigid tire on springs on a flat road, and its patch."""
    patch = oval()
    bed = winkler_compliance(patch.area, BED)
    patch = replace(patch, gap=np.where(patch.force > 0, 0.0, patch.gap))
    way = Rolled(speed=SPEED, duration=steps * STEP, motion=lambda t: 0.0)
    _, x1, y0, y1 = patch.extent
    road = RoadUnderTire(Flat()).prepare(x1, x1 + way.travel, y0, y1)
    setup = ContactSetup(patch=patch, reach=1.0, road=road, rolled=way, pattern=pattern)
    if pattern is not None:  # settled: points over a groove carry nothing
        begun = setup.begun
        free = np.maximum(patch.force - begun / np.diag(bed), 0.0)
        lifted = np.maximum(begun - np.diag(bed) * patch.force, 0.0)
        carried = np.where(begun > 0, free, patch.force)
        setup = replace(setup, patch=replace(patch, force=carried, gap=patch.gap + lifted))
    run = roll(Rigid(len(patch.points)), ActiveSet(bed), setup.patch, setup.drive, STEP, steps)
    return np.array([one.force.sum() for one in run]), setup.patch
