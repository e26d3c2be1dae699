"""The air that a run squeezes out of the footprint, over frequency."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import h5py
import numpy as np
from scipy import sparse

from tireroad.contact.results.squeezed_air import FootprintCells, squeezed
from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.greens.footprint_air import (
    Groove,
    LateralGroove,
    Outlets,
    on_elements,
    radiation_resistance,
)
from tireroad.greens.tire_sound import SoundingTire, Transfer, road_axes
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.stage import Job
from tireroad.runs.stages.whole_tire import Lines, transformed

Array = np.ndarray
_ROWS = 512  # steps read at a time


def grooves(scene: Scene, circumference: float) -> tuple[list[Groove], list[LateralGroove]]:
    """The grooves of the scene's tread of a rolling `circumference` (m): around the tire and lateral ones.

    Those of [pattern]; where that has none around the tire, those of the section itself.
    """
    table = scene.pattern
    every = table.groove if table else ()
    around = [
        Groove(g.position, g.width, g.depth) for g in every if g.direction == "circumferential"
    ]
    lateral = [
        LateralGroove(
            g.width, g.depth, circumference / table.pitches, g.span, math.tan(math.radians(g.angle))
        )
        for g in every
        if table and g.direction == "lateral"
    ]
    return around or [Groove(*groove) for groove in scene.tire.shape.grooves_around], lateral


@dataclass(frozen=True)
class LeavingAir:
    """Volume velocities that leave a footprint at the `places` (o, 2) m of the road, over the lines (f,) of a run.

    `amplitude` and `spectrum` (o, f) m3/s: as those of runs.stages.whole_tire.Lines; `height` (m): mean gap in the footprint;
    `shares` (e, o): of a tire's elements in the places.
    """

    places: Array
    shares: sparse.csr_matrix
    amplitude: Array
    spectrum: Array
    height: float

    @staticmethod
    def of(
        job: Job,
        setup: ContactSetup,
        lines: Lines,
        tire: SoundingTire,
        state: StaticState,
        far: Transfer,
    ) -> LeavingAir | None:
        """From the gaps in contact.h5, in front of a `tire` with Green's functions to places `far` away.

        None of contact points that are no grid on a plane. Root process only.
        """
        patch = setup.patch
        if patch.places is None or patch.frames is not None:
            return None
        with h5py.File(job.path("contact")) as file:
            cells = FootprintCells.of(patch.places, file["static_force"][:])
            if not len(cells.cell):
                return None
            pattern = setup.pattern
            around = pattern.circumference if pattern else math.nan
            known = grooves(job.scene, around)
            outlets = Outlets.of(cells.inside, cells.cell, *_grid(setup), *known)
            step, speed = float(file.attrs["step"]), float(file.attrs["road_speed"])
            first = len(file["time"]) - round(lines.duration / step)
            gaps = _blocks(file["gap"], first)
            depths = _depths(setup, _blocks(file["time"], first)) if pattern else None
            air = squeezed(cells, gaps, outlets.sums, speed, step, depths)
        numbers = np.rint(lines.frequency * lines.duration).astype(int)
        # What is known is the mean over a time before each instant.
        late = lines.frequency * air.over
        true = np.exp(1j * np.pi * late) / np.sinc(np.minimum(late, 0.5))
        shares = on_elements(tire, _face(state), outlets.places)
        ends = shares[:, len(outlets.edge) :]
        resistance = radiation_resistance(far, ends, shares, lines.frequency)
        rate = np.stack([(part * true[:, None]).T for part in transformed(air.rate, step, numbers)])
        arguments = lines.frequency, air.height, far.air, resistance
        amplitude, spectrum = outlets.leaving(rate, *arguments)
        return LeavingAir(outlets.places, shares, amplitude, spectrum, air.height)

    def on(self, tire: SoundingTire, state: StaticState) -> LeavingAir:
        """The same air in front of another tire's elements."""
        return replace(self, shares=on_elements(tire, _face(state), self.places))

    def volumes(self, frequency: Array) -> Array:
        """Displaced volumes (2, e, f) m3 of the elements that sound as this air does: amplitude and spectrum."""
        rate = 2j * np.pi * frequency
        return np.stack([self.shares @ part / rate for part in (self.amplitude, self.spectrum)])


def _face(state: StaticState) -> Array:
    """Nodes (s, 3) m of the outer face in the road's axes, over the road."""
    axes, height = road_axes(state)
    place: Array = state.positions @ axes.T + [0.0, 0.0, height]
    return place


def _grid(setup: ContactSetup) -> tuple[Array, Array]:
    """x and y (m) of the rows and columns of the grid of contact points."""
    places = setup.patch.places
    assert places is not None, "contact points on a grid"
    cell = np.divmod(places.place, places.shape[1])
    known = zip(places.shape, places.spacing, cell, setup.patch.points.T[:2], strict=True)
    x, y = (at[0] + apart * (np.arange(count) - number[0]) for count, apart, number, at in known)
    return x, y


def _blocks(dataset: h5py.Dataset, first: int) -> Iterator[Array]:
    for start in range(first, len(dataset), _ROWS):
        yield dataset[start : start + _ROWS]


def _depths(setup: ContactSetup, times: Iterator[Array]) -> Iterator[Array]:
    """Depth (n, c) m of the pattern under the contact points at blocks of times (n,) s."""
    assert setup.pattern is not None, "a tread with a pattern"
    x, y = setup.patch.points[:, 0], setup.patch.points[:, 1]
    for time in times:
        along = x + setup.rolled.speed * time[:, None]
        yield setup.pattern.depth(along, np.broadcast_to(y, along.shape))
