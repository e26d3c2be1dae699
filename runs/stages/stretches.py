"""Stage stretches: more of the same rough road, so that levels are those of the road and not of one stretch of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from mpi4py import MPI

from tireroad.contact.results.chance import (
    MOST_WINDOWS,
    StretchPlan,
    asked,
    freedom,
    largest,
    planned,
    steps,
    windows,
)
from tireroad.contact.results.spectra import nominal
from tireroad.contact.roads.road import placed
from tireroad.contact.roads.under_tire import begun_at
from tireroad.contact.rolling import rolling_steadily
from tireroad.contact.setup import ContactSetup
from tireroad.fem.collective import broadcast
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.static.state import StaticState
from tireroad.greens.recursion import loop_communicator
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import attribute, dataset
from tireroad.runs.process import console
from tireroad.runs.scene.road_cache import road_of
from tireroad.runs.scene.tables.scene import RoadTable
from tireroad.runs.stages import corner
from tireroad.runs.stages.accuracy import equilibrated, model_limit
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.rolling import blocks, first_step, recursive, run_in
from tireroad.runs.stages.stage import Computed, Record, Result

Array = np.ndarray
Forces = dict[str, Array]


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """Forces on r further stretches of a rough road, n steps each after their run-in.

    `length`: steps of a window, as many as the run's own record has after its run-in; `contact_force`, `axle_force` (r, n, 3)
    N, `hub_moment` (r, n, 3) N m, and `driven` (r, n, k, 3) m, the displacement at driven points, where the run has them.
    """

    length: int = attribute("window")
    contact_force: Array = dataset("N")
    axle_force: Array | None = dataset("N", default=None)
    hub_moment: Array | None = dataset("N m", default=None)
    driven: Array | None = dataset("m", "driven_displacement", default=None)

    @property
    def held(self) -> tuple[int, ...]:
        """Windows of the run's own record, and of each stretch."""
        count = len(windows(self.contact_force[0], self.length)) if len(self.contact_force) else 0
        return 1, *[count] * len(self.contact_force)


@dataclass(frozen=True, kw_only=True)
class StretchesStage(Computed[Stretches]):
    """The time loop on further stretches of the road: as many as [accuracy] chance_db asks for."""

    name: ClassVar[str] = "stretches"
    kind: ClassVar[type] = Stretches
    reads: ClassVar[tuple[str, ...]] = ("accuracy.chance_db",)
    static: Result[StaticState]
    rotating: Result[RollingModes]
    greens: Result[Responses]
    setup: Result[ContactSetup]
    contact: Result[ContactHistory]

    def compute(self, record: Record) -> Stretches:
        """Roll over the stretches, each process over its own where it holds a loop by itself. Collective."""
        history, setup, road = self.contact.product, self.setup.product, self.job.scene.road
        first = first_step(setup, road, history.time)
        length = len(history.time) - first
        plan = self._plan(record, length)
        grown = int(np.ceil(run_in(setup, road) / history.step))
        more = grown + (steps(plan.windows, length) if plan.stretches else 0)
        with record.timing("steady rolling"):
            settled = self._settled()
        roads = list(stretches(road, settled, plan, more * history.step))
        with record.timing("time loops"):
            rolled = self._rolled(roads, more, grown)
        return Stretches(length=length, **rolled)

    def _plan(self, record: Record, length: int) -> StretchPlan:
        """How many stretches of how many windows; recorded, with the chance that they leave."""
        history, scene = self.contact.product, self.job.scene
        limit = model_limit(self.setup.product, self.rotating.product, history.step).frequency
        spacing, decibels = 1 / (length * history.step), scene.accuracy.chance_db
        bands = asked(spacing, limit)
        plan = planned(bands, spacing, decibels)
        room = _with_room(scene.road, self.setup.product, plan, length, history.step)
        left = largest(freedom(bands, spacing, room.all_windows)) if len(bands) else np.nan
        record.headline |= {
            "stretches of road beside the run's own": (room.stretches, "-"),
            "half-overlapping windows of each": (room.windows, "-"),
            "length of a window": (length * history.step, "s"),
        }
        if not len(bands):
            record.warnings.append(
                "the run has no third octave whose chance could be narrowed: lengthen time.duration"
            )
            return room
        lowest = f"{nominal(bands[:1])[0]:g} Hz"
        record.headline[f"chance of a third octave from {lowest} on, 95 %, at most"] = (left, "dB")
        console.say(
            f"  {room.stretches} stretches of {room.windows} half-overlapping windows of {length * history.step:.4g} s: "
            f"third octaves from {lowest} on are within {left:.3g} dB of the road's by the number of their lines"
        )  # fmt: skip
        if left > decibels:
            record.warnings.append(
                f"levels of the road are known within {left:.3g} dB from {lowest} on, not {decibels:g} dB: the road ends, or "
                f"more than {plan.stretches} stretches would be needed. Take a longer road, a longer time.duration, or a "
                "larger accuracy.chance_db"
            )
        return room

    def _settled(self) -> ContactSetup:
        """The setup in which each stretch begins: settled on the tread, and rolling steadily where the run does."""
        response, contact = self.greens.product.contact, self.job.scene.contact
        state, step = self.static.product, self.contact.product.step
        settled = equilibrated(self.job, self.setup.product, response, state.normal_force)
        try:
            return rolling_steadily(contact, settled, response, step)
        except ConvergenceError:  # the run, too, began at rest, and said so
            return replace(settled, free=False)

    def _rolled(self, roads: list[ContactSetup], count: int, grown: int) -> Forces:
        """Forces (r, n, ...) by the names of `Stretches`, of `count` steps less the first `grown`. Collective."""
        response, comm = self.greens.product.contact, self.job.comm
        resolved = response.resolved(self.contact.product.step)
        together = loop_communicator(resolved, comm)
        alone = together.size < comm.size
        mine = range(comm.rank if alone else 0, len(roads), comm.size if alone else 1)
        rolled, error = dict[int, Forces](), None
        try:
            with console.ProgressBar(self.name, count * len(mine)) as bar:
                for number in mine:
                    rolled[number] = self._forces(roads[number], count, grown, together, bar)
        except (ConvergenceError, InputError) as told:
            error = told
        failed = [failure for failure in comm.allgather(error) if failure is not None]
        if failed:
            raise failed[0]
        every = [
            broadcast(comm, rolled.get(number), number % comm.size if alone else 0)
            for number in range(len(roads))
        ]
        if not every:
            return {"contact_force": np.zeros((0, 0, 3))}
        return {name: np.stack([one[name] for one in every]) for name in every[0]}

    def _forces(
        self,
        setup: ContactSetup,
        count: int,
        grown: int,
        comm: MPI.Comm,
        bar: console.ProgressBar,
    ) -> Forces:
        """Forces (n, ...) of one stretch. Collective on `comm`."""
        history, response = self.contact.product, self.greens.product.contact
        scheme = recursive(history.scheme)
        parts: dict[str, list[Array]] = {}
        arguments = self.job, setup, response, history.step, count, scheme, comm
        states = self.greens.product.states(self.rotating.product)
        for block in blocks(*arguments, states=states):
            told = {"contact_force": block.total_force, "axle_force": block.axle_force}
            told |= self._read(setup, block.reading)
            for name, values in told.items():
                parts.setdefault(name, []).append(values)
            bar.advance(len(block.time))
        if history.axle_force is None:
            del parts["axle_force"]
        return {name: np.concatenate(values)[grown:] for name, values in parts.items()}

    def _read(self, setup: ContactSetup, readings: Array | None) -> Forces:
        """The readings (n, r) of the tire that have levels."""
        if readings is None:
            return {}
        forces = len(self.job.scene.force)
        points, wheel = np.split(readings, [3 * forces], axis=1)
        values = {"driven": points.reshape(-1, forces, 3)} if forces else {}
        if corner.readings(self.job):
            moment = corner.parts(wheel, corner.standing_moment(setup.patch))["hub_moment"]
            values["hub_moment"] = moment
        return values


def stretches(
    road: RoadTable, setup: ContactSetup, plan: StretchPlan, duration: float
) -> Iterator[ContactSetup]:
    """The setups of further stretches, each `duration` s: drawn by seeds of their own, or one after the other behind the run's."""
    rolled = replace(setup.rolled, duration=duration)
    x0, x1, y0, y1 = setup.patch.extent
    for number in range(1, plan.stretches + 1):
        surface, table = road.surface.another(number), road
        if surface is None:
            own = road_of(road.surface)
            begun = begun_at(own, road.start) + setup.rolled.travel + x1 - x0
            table = replace(road, start=begun + (number - 1) * (rolled.travel + x1 - x0))
        under = placed(surface.make() if surface else own, surface or road.surface, table)
        yield replace(setup, road=under.prepare(x1, x1 + rolled.travel, y0, y1), rolled=rolled)


def _with_room(
    road: RoadTable, setup: ContactSetup, plan: StretchPlan, length: int, step: float
) -> StretchPlan:
    """As many of the planned stretches and windows as the rest of the road holds; all where it is drawn or endless."""
    if not plan.stretches or road.surface.another(1) is not None:
        return plan
    own, (x0, x1, _, _) = road_of(road.surface), setup.patch.extent
    _, end = getattr(own, "measured", own.extent[0])
    left = end - begun_at(own, road.start) - setup.rolled.travel - x1
    if road.drum_radius is not None or setup.rolled.speed <= 0:
        left = 0.0  # a drum comes round again

    def fits(plan: StretchPlan) -> bool:
        duration = run_in(setup, road) + (steps(plan.windows, length) + 1) * step
        return plan.stretches * (setup.rolled.speed * duration + x1 - x0) <= left

    if fits(plan):
        return plan
    numbers = [2**k for k in range(plan.stretches.bit_length())]
    smaller = [StretchPlan(n, w) for n in numbers for w in range(1, MOST_WINDOWS + 1)]
    most = plan.stretches * plan.windows
    held = [plan for plan in smaller if plan.stretches * plan.windows <= most and fits(plan)]
    return max(held, key=lambda plan: plan.stretches * plan.windows, default=StretchPlan(0, 0))
