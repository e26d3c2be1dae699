"""Stage contact: the tire rolls over the road."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from typing import ClassVar

from threadpoolctl import threadpool_limits

from tireroad.contact.loop import Loop, roll
from tireroad.contact.model import solver_name
from tireroad.contact.results.chatter import Chatter, Chosen
from tireroad.contact.results.energy import Work
from tireroad.contact.results.totals import Totals
from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files import store
from tireroad.runs.process import observe
from tireroad.runs.process.signals import Deferred, Stopped
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Done, Stage
from tireroad.runs.stages.build import pattern
from tireroad.runs.stages.build.energy import Losses, describe_energy, works
from tireroad.runs.stages.build.point_forces import shortest_period
from tireroad.runs.stages.build.rolling.loop import driven_tire, freely_rolling, make_loop
from tireroad.runs.stages.build.rolling.scheme import chosen_scheme, reported
from tireroad.runs.stages.build.rolling.stepping import (
    Planned,
    integration,
    passing_period,
    planned,
)
from tireroad.runs.stages.build.rolling.watch import Watch
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.stored import contact_figures, road_file
from tireroad.runs.stages.stored.contact_file import (
    ContactFile,
    ContactHistory,
    begun_with,
    forget_checkpoint,
)


@dataclass(frozen=True, kw_only=True)
class ContactStage(Stage[ContactHistory]):
    """The time loop. Its file is written as it proceeds, from the last checkpoint if any."""

    name: ClassVar[str] = "contact"
    static: Done[StaticState]
    rotating: Done[RollingModes]
    greens: Done[Responses]
    setup: Done[ContactSetup]

    def inputs(self) -> dict:
        """The Green's functions, the contact, the road (a file by its content) and the time."""
        scene = self.job.scene
        return {
            "greens": self.greens.key,
            "contact": asdict(scene.contact),
            "road": [asdict(scene.road), pattern.inputs(self.job)],
            "file": store.file_hash(scene.road.file) if scene.road.file else None,
            "speed": self.setup.product.rolled.speed,
            "slip": [scene.rotation.free_rolling, scene.rotation.slip_angle]
            if scene.rotation
            else None,
            "axle_force": scene.output.axle_force,
            "forces": [asdict(force) for force in scene.force],
            "time": {k: v for k, v in asdict(scene.time).items() if k != "checkpoint"},
        }

    def produce(self, key: str, record: Record) -> ContactHistory:
        """Run the time loop and read the history back. Collective."""
        self._roll(key, record)
        return self.stored()

    def _roll(self, key: str, record: Record) -> None:
        """Run the time loop with the scheme that suits the contact; the other one if it chatters.

        Collective.
        """
        response, setup = self.greens.product.contact, self.setup.product
        plan = planned(self.job, record, response, self._shortest_period())
        with record.timing("tread and solver"):
            setup, rise = setup.settled(
                response, self.static.product.normal_force, self.job.scene.contact
            )
            if rise:
                record.indicators["rise of the tire as it settles on the grid"] = (rise, "m")
            begun = begun_with(self.job, key)
            chosen = chosen_scheme(self.job, record, setup, plan, begun)
            setup, slip = self._rolling_freely(record, setup, plan, chosen.scheme)
        spec, patch = self.job.scene.contact, setup.patch
        count = f"{len(patch.points)} contact points on {len(patch.index)} nodes"
        observe.say(f"  {count}, tread {spec.tread}, solver {solver_name(spec, patch)}")
        if spec.points == "nodes" and spec.law.compliant and self.job.speed:
            observe.say(
                '  points are nodes: contact.points = "auto" takes as many as the footprint needs'
            )
        while True:
            try:
                return self._attempt(key, record, setup, slip, plan, chosen)
            except Chatter as chatter:
                chosen = reported(record, chosen.instead(chatter))
                forget_checkpoint(self.job)

    def _rolling_freely(self, record: Record, setup: ContactSetup, plan: Planned, scheme: str):
        """(setup, slip) of free rolling if the scene asks for it, else slip 0. Collective."""
        rotation, response = self.job.scene.rotation, self.greens.product.contact
        if rotation is None or not rotation.free_rolling:
            return setup, 0.0
        setup, slip = freely_rolling(self.job, setup, response, plan.step, scheme)
        record.headline["slip of free rolling"] = (100 * slip, "%")
        return setup, slip

    def _attempt(
        self,
        key: str,
        record: Record,
        setup: ContactSetup,
        slip: float,
        plan: Planned,
        scheme: Chosen,
    ) -> None:
        """Run the loop, writing by blocks; raises Chatter beyond the scheme's limit. Collective."""
        response, chosen = self.greens.product.contact, integration(self.job, plan, scheme.scheme)
        with record.timing("tread and solver"):
            driven = driven_tire(self.job, chosen)
            loop = self._loop(record, setup, driven or chosen.tire, chosen.step)
        totals = Totals(setup.patch, setup.reach, scheme.limit, work=Work(scheme.scheme))
        losses = Losses(chosen, response, self.rotating.product)
        with ExitStack() as stack, record.timing("time loop"):
            attributes = {"step": chosen.step, "scheme": chosen.scheme, "road_relief": setup.relief}
            attributes |= {"free_slip": slip, "scheme_reason": scheme.reason}
            attributes["scheme_limit"] = scheme.limit
            file = ContactFile(self.job, key, setup, attributes)
            kept = file.open(stack, self.job.path(self.name))
            if kept is not None:
                loop.restore(kept)
                totals.set_state(kept)
                losses.set_state(kept)
                reached = totals.figures.steps * chosen.step
                observe.say(f"  goes on from the checkpoint at t = {reached:.6g} s")
            done, began = totals.figures.steps, time.thread_time()
            self._steps(setup, loop, driven, file, totals, losses, chosen)
            # CPU time of this process's own thread: the cost of a step when no other process needs
            # the cores.
            busy = (time.thread_time() - began) / max(chosen.steps - done, 1)
            record.indicators["processor time a step"] = (1e6 * busy, "us")
            file.finish()
        contact_figures.describe(record, totals, loop.solver, chosen, chosen.steps - done)
        contact_figures.alternation(record, totals.alternation.worst, scheme)
        contact_figures.points(record, setup.patch, self.static.product.footprint(), setup.relief)
        deflection, held = self.static.product.deflection, self.job.scene.axle.kind == "fixed"
        contact_figures.excursion(record, totals.figures.excursion, deflection, held=held)
        pattern.describe(record, setup)
        road_file.describe(record, setup, self.job.scene.road)
        if chosen.scheme != "convolution":
            work = works(totals.work, driven if self.job.scene.force else None)
            given = self.rotating.product, response, loop.tire.snapshot(), work
            state = self.static.product
            pressed = float(state.normal_force.sum()) * (state.deflection or 0.0)
            describe_energy(record, *given, losses, chosen.step, pressed)

    def _shortest_period(self) -> float:
        """Shortest period of all excitation, s."""
        scene, setup = self.job.scene, self.setup.product
        passing = passing_period(scene.road, setup.shortest, setup.rolled.speed)
        return min(passing, shortest_period(scene.force))

    def _loop(self, record: Record, setup: ContactSetup, tire, step: float) -> Loop:
        """The loop of tire, normal solver and friction at the patch's points; recorded."""
        spec = self.job.scene.contact
        loop = make_loop(spec, setup, tire, step)
        if loop.friction is not None:
            limit = loop.friction.largest_unique(setup.patch.force > 0, loop.solver)
            record.indicators["friction up to which a step has one answer"] = (limit, "-")
            record.warnings += [
                text for text in beyond_unique(spec.friction, limit) if text not in record.warnings
            ]
        return loop

    def _steps(self, setup, loop: Loop, driven, file: ContactFile, totals, losses, chosen) -> None:
        """Take the remaining steps; stops between two of them when requested. Collective."""
        done, steps = totals.figures.steps, chosen.steps
        given = setup.patch, setup.drive, chosen.step, steps
        instants = roll(loop.tire, loop.solver, *given, loop.friction, done, loop.memory)
        watch = Watch(self.job.comm, self.job.scene.time.checkpoint)
        with (
            Deferred() as deferred,
            observe.Progress("contact", steps, begun=done) as bar,
            # One core reads a step's matrices, a megabyte, as fast as two; threads that wait for
            # each other in every product took ten times as long where cores are shared.
            threadpool_limits(1, "blas"),
        ):
            for instant in instants:
                full = file.add(instant, driven.reading if driven else None)
                bar.advance()
                stop, due = watch(deferred.asked)
                if full or stop or due:
                    file.flush(totals.add)
                    losses.flush()
                if stop or due:
                    file.checkpoint(loop.snapshot() | totals.state() | losses.state())
                if stop:
                    raise Stopped(stop)
            file.flush(totals.add)
            totals.finish()
            losses.flush()

    def read(self, file) -> ContactHistory:
        """The totals over time, without the single points."""
        return ContactHistory.of(file)


def beyond_unique(friction: float | None, limit: float) -> list[str]:
    """A warning if slipping points may leave a step with more than one solution."""
    if friction is None or friction <= limit:
        return []
    return [
        f"contact.friction = {friction:g} is more than {limit:.3g}, up to which the solution of a step is "
        "known to be unique: where points slip there may be others; lower it, or take a softer tread"
    ]
