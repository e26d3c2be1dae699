"""Stage nonlinear: the reduced nonlinear force of the tire, trained on the road of the run and judged by the run itself.

First the standing tire climbs rises, and the road as it lies under the footprint at places along the run. Then the time
loop runs, over the bumps up to the greatest one, with the first few vectors of these states, and it is found what the road feels of what they leave out: more of them
follow where it is much. States of a run join only where none goes through: a belted tire does not move where its
reduced force lets it, and its vectors then answer to what no tire does, which the road's force does not tell: on a bar of 15 mm it
told that 7.6 % was left out with them, and the axle's force was 15 % off in place of 5.5. Vectors of a linear tire's motion alone did not let the loop settle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.loop import Drive
from tireroad.contact.results.chatter import LARGE
from tireroad.contact.rolling import make_loop
from tireroad.contact.setup import ContactSetup
from tireroad.contact.training_roads import ERROR_PER_METRE, TrainingRoads, expected
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.model import SmallMotions
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.road import contact_points
from tireroad.fem.nonlinear.training import Settings, Trained, Trainer, Training, trained_on
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.basis import ModalBasis
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files import store
from tireroad.runs.process import console
from tireroad.runs.scene.tables.contact import ContactTable
from tireroad.runs.stages import setup as stages_setup
from tireroad.runs.stages.greens import Responses, fill_response, read_response
from tireroad.runs.stages.large import Factors, Instants, LargeMotion
from tireroad.runs.stages.nonlinear import Nonlinear, stored
from tireroad.runs.stages.rolling import (
    Integration,
    Planned,
    driven_tire,
    integration,
    planned,
    shortest_excitation,
)
from tireroad.runs.stages.stage import MUMPS, Computed, Record, Result, Shared

Array = np.ndarray

LIMIT = 0.03  # of forces: error of the linear tire from which on "auto" takes large motions
BED = 1e9  # N/m3: springs of the tread under the standing tire, 10 MPa over 10 mm
RUNS, INSTANTS, STEPS = 8, 60, 4000  # at most: runs, instants of each, steps of each
FEW = 4  # vectors of the first run; twice as many where they leave out too much
COARSER = 2.0  # shortest periods, by which a step that is left open is longer in these runs
ENOUGH = 0.05  # of the change of the road's force: what the training may leave out of a run
SETTINGS = Settings(most=160, turns=6, precision=5e-3)
DONE, MORE, STATES, ALL = "little is left out", "more vectors", "its states", "no more is gained"
_RESPONSE = "response"


@dataclass(frozen=True, kw_only=True)
class Restoring(Shared[RestoringForce]):
    """The restoring force of the elements about the static state, with the moduli of small motions."""

    name: ClassVar[str] = "restoring"
    static: Result[StaticState]
    motions: Result[SmallMotions]

    def make(self) -> RestoringForce:
        """The force. Collective."""
        motions, state = self.motions.product, self.static.product
        motions.operators.body.set_displacement(state.displacement)
        return RestoringForce(motions.operators, state.inflation)


@dataclass(frozen=True)
class TrainedMotion:
    """The reduced nonlinear force as it is `stored`, and the `response` of the contact with it
    (greens.large_motion.large_response)."""

    stored: Nonlinear
    response: Response


@dataclass(frozen=True, kw_only=True)
class NonlinearStage(Computed[TrainedMotion]):
    """The training by runs of the loop."""

    name: ClassVar[str] = "nonlinear"
    static: Result[StaticState]
    rotating: Result[RollingModes]
    greens: Result[Responses]
    setup: Result[ContactSetup]
    wheel: Result[Wheel]
    fields: Result[ModalBasis]
    restoring: Result[RestoringForce]

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        return (
            f"at most {RUNS} runs of {STEPS} steps, {INSTANTS} instants of each, until {ENOUGH:g} of the road's force is left out or more vectors gain nothing; at most "
            f"{SETTINGS.most} vectors; weights of cells off by at most {SETTINGS.tolerance:g}; {MUMPS}"
        )

    def idle(self) -> str | None:
        """Why the motion stays linear where the scene leaves it open."""
        if self.job.scene.motion.kind != "auto":
            return None
        height = expected(self.setup.product)
        error = ERROR_PER_METRE * height
        told = (
            f"the road takes the tire {1e3 * height:.3g} mm up or down, by which forces of a linear one are some "
            f"{100 * error:.2g} % off"
        )
        if error <= LIMIT:
            return f'motion.kind = "auto" takes a linear tire: {told}'
        console.say(f'{self.name} motion.kind = "auto" takes large motions: {told}')
        return None

    def inputs(self) -> dict[str, Any]:
        """The Green's functions and all that the loop depends on."""
        return {
            "greens": self.greens.key,
            **stages_setup.loop_inputs(self.job, self.setup.product),
            "training": [RUNS, INSTANTS, STEPS, COARSER, ENOUGH, BED, repr(SETTINGS)],
        }

    def compute(self, record: Record) -> TrainedMotion:
        """Train. Collective."""
        with (
            console.ProgressBar(self.name, unit="roads and runs") as bar,
            threadpool_limits(1, "blas"),
        ):

            def told(line: str) -> None:
                console.log(f"  {line}")
                bar.advance()

            linear = linear_motion(self)
            with record.timing("standing on the road"):
                trainer = self._stood(linear.restoring, told)
            try:
                return self._run(record, linear, trainer, told)
            finally:
                linear.factors.destroy()

    def _stood(self, restoring: RestoringForce, told: Callable[[str], None]) -> Trainer:
        """The training of the standing tire on the road under its footprint. Collective."""
        roads = TrainingRoads.of(self.setup.product).smooth()
        lattice, (length, width) = restoring.body.lattice, roads.reach
        width = min(width, float(np.abs(lattice.points(lattice.face)[:, 1]).max()))
        given = lattice, self.static.product, BED
        points = contact_points(*given, half_length=length, half_width=width)
        trainer = Trainer(restoring, points, SETTINGS, told)
        for rise in roads.rises():
            trainer.visit(rise)
        trainer.follow(roads.ways(), roads.under)
        return trainer

    def _run(
        self, record: Record, linear: LargeMotion, trainer: Trainer, told: Callable[[str], None]
    ) -> TrainedMotion:
        """The training by runs of the loop, begun with the states of the standing tire. Collective."""
        with console.quiet():
            shortest = COARSER * shortest_excitation(self.job.scene, self.setup.product)
            plan = planned(self.job, Record(), linear.response, shortest)
        setup, seen, runs = (
            self._settled(linear.response),
            [trainer.states],
            trainer.record,
        )
        best: tuple[float, Training, LargeMotion] | None = None
        most = FEW
        for number in range(1, RUNS + 1):
            with record.timing("vectors and cells"):
                states, answers = (np.hstack(part) for part in zip(*seen, strict=True))
                settings = replace(SETTINGS, most=most)
                training = trained_on(linear.restoring, states, answers, settings, runs)
            with record.timing("response to the force"):
                motion = linear.trained(training.force, training.vectors)
            with record.timing("time loops"):
                kept = replace(plan, response=motion.response.resolved(plan.step))
                instants, stopped = self._rolled(motion, setup, kept)
            with record.timing("forces of the elements"):
                felt = None if stopped else motion.felt(instants, plan.step)
            left_out = felt.share if felt else np.inf
            count = training.vectors.shape[1]
            told(
                f"run {number} with {count} vectors and {len(training.force.cells)} cells: "
                + (stopped or f"{100 * left_out:.3g} % of the change of the road's force left out")
            )
            runs.append(Trained(f"run {number}", len(instants), left_out, 0.0, stopped or "whole"))
            before = best[0] if best else np.inf
            if not stopped and (best is None or left_out < before):
                best = left_out, training, motion
            more = count == most < SETTINGS.most
            next_one = after_run(left_out, before, more)
            if next_one in (DONE, ALL):
                break
            if next_one == MORE:
                most = min(2 * most, SETTINGS.most)
                continue
            with record.timing("forces of the elements"):
                left = motion.left_out(instants, plan.step)
            some = left.shares > ENOUGH / 2
            seen.append((left.motion[:, some], left.answer[:, some]))
        if best is None:
            raise ConvergenceError(
                f"large motions: no run of the training went through ({runs[-1].how}); take a smaller time.step, a lower road, "
                'or motion.kind = "linear"'
            )
        left_out, training, motion = best
        _describe(record, training, left_out)
        return TrainedMotion(stored(training, motion.restoring), motion.response)

    def _settled(self, response: Response) -> ContactSetup:
        """The setup in which each run begins: settled on the tread."""
        force = self.static.product.normal_force
        setup = self.setup.product.equilibrated(response, force, self._contact)[0]
        return replace(setup, free=False)

    @property
    def _contact(self) -> ContactTable:
        """The contact of the runs: without friction, as that of the standing tire, so that nothing has to roll steadily first."""
        contact = self.job.scene.contact
        assert contact is not None, "a scene with contact"
        return replace(contact, friction=0.0)

    def _rolled(
        self, motion: LargeMotion, setup: ContactSetup, plan: Planned
    ) -> tuple[Instants, str]:
        """Instants of a run of the loop, and where it stopped; "" if nowhere. Collective."""
        with console.quiet():
            chosen: Integration = integration(self.job, plan, LARGE.scheme)
        assert isinstance(chosen.tire, Recursion), "damped forces are integrated by a recursion"
        tire = motion.tire(chosen.tire, chosen.scheme)
        driven = driven_tire(self.job, chosen, setup.patch, tire)
        loop = make_loop(self._contact, setup, driven or tire or chosen.tire, plan.step)
        drive, steps = self._stretch(setup, plan)
        instants = Instants(chosen.tire, loop.contact)
        try:
            for block in loop.roll(drive, plan.step, steps, at_once=max(steps // INSTANTS, 1)):
                instants.add(float(block.time[-1]))
        except ConvergenceError as error:
            if not len(instants):
                raise
            return instants, f"to t = {instants.kept[-1][0]:.4g} s: {error}"
        return instants, ""

    def _stretch(self, setup: ContactSetup, plan: Planned) -> tuple[Drive, int]:
        """The road that a run of the training rolls over, until its greatest bump has passed, and the number of steps: from where
        it is no longer level if nothing but the road moves the tire."""
        first, last = TrainingRoads.of(setup).passage()
        drive, rolled, steps = setup.drive, setup.rolled, plan.steps
        if rolled.lift or self.job.scene.force or not rolled.speed:
            return drive, min(steps, STEPS)
        way = rolled.speed * plan.step
        steps = min(steps - int(first / way), int(np.ceil((last - first) / way)), STEPS)
        return drive.after(first), max(steps, 1)

    def write(self, file: Any, product: TrainedMotion) -> None:
        """The stored force, and the response as a group."""
        store.write_fields(file, product.stored)
        fill_response(file, _RESPONSE, product.response, 0)

    def read(self, file: Any) -> TrainedMotion:
        """The same, read back."""
        held = Nonlinear(**store.read_fields(file, Nonlinear))
        return TrainedMotion(held, read_response(file[_RESPONSE]))


def after_run(left_out: float, before: float, more: bool) -> str:
    """The step that follows a run whose training leaves out a share of the force, inf if it stopped, and the best run `before` another:
    nothing if it is little, or no less than before; vectors of the states known if there are `more`; the run's own states if none went
    through."""
    if left_out <= ENOUGH:
        return DONE
    # On bars twice as many vectors left three to five times as much out where they left more, or grew.
    if before < np.inf and left_out >= before:
        return ALL
    if more:
        return MORE
    return STATES if left_out == np.inf else ALL


def linear_motion(stage: Any) -> LargeMotion:
    """The motion of a stage's linear tire, with what its large motions need. Collective."""
    rolling, fields = stage.rotating.product, stage.fields.product
    if fields is not rolling.basis:
        rolling = replace(rolling, basis=fields)
    response = stage.greens.product.contact
    points = stages_setup.probes(stage.job, stage.static.product, stage.setup.product).outputs
    restoring, loaded = stage.restoring.product, response.residual.shape[1]
    return LargeMotion(
        restoring=restoring,
        force=None,
        vectors=np.zeros((len(restoring.at_rest), 0)),
        response=response,
        points=points,
        loaded=loaded,
        wheel=stage.wheel.product,
        rolling=rolling,
        factors=Factors(stage.wheel.product, restoring, points[:loaded]),
    )


def _describe(record: Record, training: Training, left_out: float) -> None:
    """Record what was trained, what the road feels of what it leaves out in its best run, and the roads that were not climbed to their height."""
    runs = [one for one in training.record if one.road.startswith("run ")]
    roads = training.record[: len(training.record) - len(runs)]
    record.headline |= {
        "roads under the standing tire": (len(roads), "-"),
        "runs of the loop": (len(runs), "-"),
        "states": (training.states, "-"),
        "vectors": (training.vectors.shape[1], "-"),
        "cells of the mesh": (len(training.force.cells), "-"),
        "largest motion of a state left out": (100 * training.left, "%"),
    }
    if np.isfinite(left_out):
        record.headline["force of the run left out"] = (100 * left_out, "%")
    record.indicators["error of the weighted cells"] = (100 * training.error, "%")
    short = [one for one in roads if one.how.startswith("to ")]
    if short:
        record.notes.append(
            f"{len(short)} of {len(roads)} roads of the training were not climbed to their height (the first, {short[0].road}, "
            f"{short[0].how.split(':')[0]}): on flanks so steep points jump without inertia"
        )
    for one in runs:
        if one.how != "whole":
            record.notes.append(f"{one.road} of the training went {one.how}")
