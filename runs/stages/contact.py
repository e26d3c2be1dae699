"""Stage contact: the tire rolls over the road."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from tireroad.contact.choices import MOST_ALTERNATING, USABLE
from tireroad.contact.free_wheel import FreeWheel, with_spin
from tireroad.contact.loop import ContactProblem, DrivenTire, Loop
from tireroad.contact.model import solver_name
from tireroad.contact.patch import Patch
from tireroad.contact.results.chatter import LIMIT, Chatter, Chosen, warning
from tireroad.contact.results.energy import (
    Circulation,
    Relaxed,
    StateMotion,
    Totals,
    Work,
    energy_left,
    own_states,
    springs,
)
from tireroad.contact.roads.kinds.shapes import Edges
from tireroad.contact.rolling import make_loop, rolling_steadily
from tireroad.contact.setup import ContactSetup
from tireroad.contact.solver.solvers import SOLVERS
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel
from tireroad.greens.large_motion import LargeTire
from tireroad.greens.recursion import Recursion, loop_communicator
from tireroad.greens.response import Response
from tireroad.greens.schemes import SCHEMES, keeps_history
from tireroad.modal.basis import ModalBasis
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root_beside
from tireroad.runs.process.signals import Deferred, Stopped
from tireroad.runs.scene.tables.scene import RoadTable, Scene
from tireroad.runs.stages import contact_file, corner
from tireroad.runs.stages import setup as stages_setup
from tireroad.runs.stages.contact_file import (
    ContactFile,
    ContactHistory,
    begun_with,
    forget_checkpoint,
)
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.large import Greatest, LargeMotion
from tireroad.runs.stages.large import describe as describe_large
from tireroad.runs.stages.rolling import (
    Integration,
    Planned,
    chosen_scheme,
    driven_tire,
    free_wheel,
    integration,
    planned,
    reported,
    shortest_excitation,
)
from tireroad.runs.stages.stage import Record, Result, Stage
from tireroad.runs.stages.training import TrainedMotion, linear_motion

# Fewest point spacings per footprint width. Measured on cobblestones on two tires: deviation 23 %
# too large at 1.8, 2 % at 2.4 (torus.toml), 5 % too small at 2.5, 3 % at 3.6. Only on a mesh
# whose nodes are as far apart as the footprint is wide was it 35 % at 2.4: its error bars tell.
FEW = 2.2
# Times the band's end: least frequency at which points pass an edge. Over a step of 10 mm (quickstart.toml, no friction)
# the longitudinal force was 2.2 times too large at 1.8 times, whether with 10 mm at 30 or 5 mm at 15 km/h, and 4 to 9 %
# at 3.6; work over the step 127, 78 J and 58, 66 J, where lifting the tire takes 50 J.
APART = 3.0
_CREEPING = 0.02
_ASTRAY = 1e-3  # of the steps
_STEADY = 0.8  # friction of a whole footprint that slides steadily (docs/verification/stability.md)
# Share of the static deflection: motion of the contact up to which a linear tire is trusted.
LINEAR = 1 / 3

# Share of the energy exchanged, beyond which the steps are too long or something is wrong.
# Measured: 0.012 at most where forces were right to 1 % up to 300 Hz, 0.024 where they were off by
# 35 %.
_UNBALANCED = 0.02
_TAKEN = 0.1  # share of the energy exchanged that the forces of a scheme may dissipate
_LEAST = 1e-9  # J: below is rounding
# Share of the energy of the static contact (load times deflection), below which no error matters:
# a run on a road of 1 um moved 1e-7 of it.
_SLIGHT = 1e-6


def describe(
    record: Record, counted: Totals, factorisations: int, chosen: Integration, taken: int
) -> None:
    """Record loads, the step, its cost and accuracy; `taken`: steps since the checkpoint."""
    totals, chattering = counted.figures, counted.alternation.worst
    record.headline |= {
        "mean load": (float(totals.sum / totals.steps), "N"),
        "points touching at most": (totals.most_active, "-"),
        "step": (chosen.step, "s"),
        "scheme": (chosen.scheme, "-"),
        "time a step": (record.cost["time loop"] / max(taken, 1) * 1e6, "us"),
    }
    record.indicators |= {
        # Impacts of points let a single step go far beyond what the band holds.
        "least load of a step, all frequencies": (float(totals.least), "N"),
        "largest load of a step, all frequencies": (float(totals.most), "N"),
        "worst complementarity residual": (float(totals.residual), "-"),
        "largest penetration": (float(totals.penetration), "m"),
        "factorisations": (factorisations, "-"),
        "points that change back from step to step, at worst": (chattering, "-"),
    }
    if totals.least == 0:
        record.warnings.append("the tire lost contact with the road for a while")


def meeting(record: Record, contact: ContactProblem, steps: int) -> None:
    """Record how often a step was solved for where its points lie, and warn where they were not found."""
    record.indicators |= {
        "solutions or Newton steps of a time step, in the mean": (
            contact.solutions / steps,
            "-",
        ),
        "steps that do not meet the road where the points lie": (contact.unsettled, "-"),
    }
    if contact.unsettled > _ASTRAY * steps:
        record.warnings.append(
            f"in {contact.unsettled} of {steps} steps the road is not met where the points lie: on flanks so steep a point can "
            "rest at several places and slip off; take a smaller time.step, or a road whose flanks are longer"
        )


def rubbing(record: Record, friction: float, scene: Scene, lagging: int, steps: int) -> None:
    """Record the coefficient of friction; warn where horizontal forces are those of a road without any, and where more than
    single ones of the `steps` have forces that lag."""
    record.headline["friction"] = (friction, "-")
    rotation, free = scene.rotation, corner.turns_freely(scene)
    if friction and rotation is not None and rotation.speed:
        record.headline["the wheel's rate of rotation"] = ("free" if free else "held", "-")
        if rotation.wheel == "free" and (why := corner.held_by(scene)):
            record.warnings.append(
                f"the wheel's rate of rotation is held, since a free one does not go with {why}: the force along a rough road lacks most of "
                "what it has below 50 Hz, and its mean is not the rolling resistance"
            )
    if friction:
        record.indicators["steps in which normal and horizontal forces lag behind each other"] = (
            lagging,
            "-",
        )
    if lagging > _ASTRAY * steps:
        advice = (
            f"A footprint that slides as a whole at a friction of {friction:g} vibrates by itself; contact.friction up to {_STEADY:g} slides "
            "steadily on a passenger tire"
            if friction > _STEADY
            else "Take a smaller time.step"
        )
        record.warnings.append(
            f"in {lagging} of {steps} steps no normal and horizontal forces were found that fit each other: there each took the other's of "
            f"the step before. {advice}"
        )
    if not friction and scene.horizontal_forces and scene.static.friction is None:
        record.warnings.append(
            "the loop has no friction: horizontal forces come from the road's slope alone and were up to 12 dB off below "
            "200 Hz on a passenger tire, sound up to 7 dB; contact.friction = 1.0 is dry asphalt"
        )


def alternation(record: Record, worst: float, scheme: Chosen) -> None:
    """Warn if points open and close from step to step; with damped forces that is the road."""
    if worst > LIMIT and SCHEMES[scheme.scheme].chatters:
        record.warnings.append(warning(worst))


def points(record: Record, patch: Patch, extent: Footprint, relief: float) -> None:
    """Record the static footprint's size in point spacings; warn if too few on a rough road.

    That of the finite elements, or the distance of the outermost points that touch, which is longer
    where the tread is the softer part.
    """
    spacing = patch.spacing
    if not spacing.all():
        return
    size = np.maximum([extent.length, extent.width], (patch.touching - 1) * spacing)
    long, wide = size / spacing
    record.indicators["length of the footprint over the points' spacing"] = (float(long), "-")
    record.indicators["width of the footprint over the points' spacing"] = (float(wide), "-")
    if relief and 0 < min(long, wide) < FEW:
        record.warnings.append(
            f"contact points are {1e3 * spacing[0]:.3g} × {1e3 * spacing[1]:.3g} mm apart on a footprint of {1e3 * size[0]:.3g} × "
            f"{1e3 * size[1]:.3g} mm: on a rough road forces of so few may vary by a third too much; take a quarter "
            "of its width and length or less (contact.points)"
        )


def edges(record: Record, road: RoadTable, patch: Patch, speed: float, highest: float) -> None:
    """Warn if the points pass an edge of the road (speed, m/s) at a frequency near the modes' band, `highest` Hz.

    They meet it one by one, with a force each along the road, which the tire then feels; not where it rolls so
    slowly that it follows them at rest.
    """
    spacing, end = float(patch.spacing[0]), USABLE * highest
    if not (isinstance(road.surface, Edges) and spacing and speed > 0):
        return
    passing = speed / spacing
    if _CREEPING * end < passing < APART * end:
        record.warnings.append(
            f"contact points {1e3 * spacing:.3g} mm apart pass the edges of the {road.kind} at {passing:.3g} Hz, less than "
            f"{APART:g} times the band's end of {end:.3g} Hz: the tire feels them one by one, and forces along the road may be "
            f"twice too large; take contact.points.dx = {speed / (APART * end):.2g} m or less"
        )


def excursion(record: Record, most: float, deflection: float | None, *, held: bool) -> None:
    """Record how far the contact moved from the state about which the tire is linearised.

    `held`: whether the axle is.
    """
    record.indicators["largest motion of the contact beyond the static state"] = (most, "m")
    if not deflection:
        return
    share = most / deflection
    record.indicators["that, of the static deflection"] = (share, "-")
    if share > LINEAR:
        record.warnings.append(
            f"the contact moved by up to {1e3 * most:.3g} mm beyond the static state, {share:.2g} of the static "
            f"deflection of {1e3 * deflection:.3g} mm: the tire is linear about that state, so forces are doubtful "
            "beyond a third of it (a step that lifts the whole footprint by a third gives a force 14 % too large, by "
            'all of it 56 %); take motion.kind = "large", a lower road, or a longer road.run_in or road.longest_wave'
            + (', or a wheel that moves (axle.kind = "corner")' if held else "")
        )


class Watch:
    """Whether to stop, and whether a checkpoint is due; the same answer on every process.

    `every` (s, wall-clock time): interval between checkpoints.
    """

    def __init__(self, comm: MPI.Comm, every: float) -> None:
        self._comm, self._every = comm, every
        self._last = time.monotonic()

    def __call__(self, asked: str) -> tuple[str, bool]:
        """Stop signal ("" if none), and whether a checkpoint is due. Collective."""
        due = time.monotonic() - self._last > self._every
        if self._comm.size > 1:
            answers = self._comm.allgather((asked, due))
            asked = max(name for name, _ in answers)
            due = answers[0][1]
        if due:
            self._last = time.monotonic()
        return asked, due


@dataclass(frozen=True)
class Works:
    """Work (J) of the contact's force changes and of the prescribed forces, if any.

    `lead`: additional work of the forces that the scheme applies during the steps; `begun`: energy (J) in the tire before;
    `nonlinear`: energy (J) that large motions have stored in the nonlinear force; `turned`: work (J) of a free wheel's inertia on the tire.
    """

    contact: float
    driven: float | None
    lead: float
    begun: float = 0.0
    nonlinear: float | None = None
    turned: float | None = None

    @property
    def total(self) -> float:
        """Work of all forces as if they were linear over the step, less what the nonlinear force stores."""
        return self.contact + (self.driven or 0.0) + (self.turned or 0.0) - (self.nonlinear or 0.0)


def works(
    contact: Work,
    driven: DrivenTire | None,
    large: LargeTire | None = None,
    wheel: FreeWheel | None = None,
) -> Works:
    """The works of a completed loop."""
    lead = contact.lead + sum(part.lead for part in (driven, large, wheel) if part)
    own = driven.work if driven else None
    stored, turned = large.stored if large else None, wheel.work if wheel else None
    return Works(contact.total, own, lead, contact.begun, stored, turned)


class Losses:
    """Energy losses of a rolling tire from its states at each step; empty if not known."""

    def __init__(self, chosen: Integration, response: Response, rolling: RollingModes) -> None:
        tire = chosen.tire
        self._motion: StateMotion | None = None
        if isinstance(tire, Recursion) and StateMotion.known(rolling, response):
            self._motion = StateMotion(rolling, response.slow(chosen.step), chosen.step)
            resolved = response.resolved(chosen.step)
            self._forces = resolved.residual.shape[1]  # without the spin of a free wheel
            left_out = resolved.residual[: self._forces]
            self._circulation = Circulation(left_out * (not response.pulse), chosen.scheme)
            self._modes = resolved.of_modes.stop
            rate = -resolved.eigenvalue[self._modes :].real
            self._relaxed = Relaxed(rate, chosen.step, chosen.scheme)
            self._tire = tire
            tire.keep_samples()

    @property
    def found(self) -> tuple[float, float, float, float] | None:
        """Losses of the run, J; None if they are not known.

        Energy lost in the material; work of the drive; loss in the truncated modes less the drive's
        work on them; work of forces ahead of their mean on those modes beyond what they store.
        """
        if self._motion is None:
            return None
        losses, beyond = self._motion.losses, self._circulation
        return losses.lost + self._relaxed.lost, losses.drive, beyond.work, beyond.lead

    @property
    def slow(self) -> float:
        """Energy (J) lost in slow rubber, a part of that lost in the material; of a run whose losses are known."""
        return self._relaxed.lost

    def begin(self, kept: dict[str, np.ndarray]) -> None:
        """Begin at the forces and states that the tire has at t = 0, `kept` in its snapshot."""
        if self._motion is not None:
            self._circulation.begin(self._tire.force[: self._forces])
            state, push = (kept[name][self._modes :].real for name in ("state", "push"))
            self._relaxed.begin(state, push)

    def flush(self) -> None:
        """Account for the steps since the last call. Collective."""
        if self._motion is None or not (samples := self._tire.samples()):
            return
        states, pushes, acting, block = map(list, zip(*samples, strict=True))
        forces, tire = np.array(acting)[:, : self._forces], self._tire
        every, pushed = tire.everywhere(states), tire.everywhere(pushes)
        count = self._modes
        self._motion.add(every[:, :count], pushed[:, :count], tire.block_everywhere(block))
        self._relaxed.add(every[:, count:].real, pushed[:, count:].real)
        self._circulation.add(forces)

    def state(self) -> dict[str, np.ndarray]:
        """State for a checkpoint."""
        if self._motion is None:
            return {}
        return self._motion.losses.state() | self._circulation.state() | self._relaxed.state()

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a `state`."""
        if self._motion is not None:
            self._motion.losses.set_state(state)
            self._circulation.set_state(state)
            self._relaxed.set_state(state)


def negligible(pressed: float) -> float:
    """Energy (J) below which no error matters, for load times deflection `pressed` (J) at rest."""
    return max(_LEAST, _SLIGHT * pressed)


def describe_energy(
    record: Record,
    rolling: RollingModes,
    response: Response,
    state: dict[str, np.ndarray],
    work: Works,
    losses: Losses,
    step: float,
    pressed: float = 0.0,
) -> None:
    """Record work of forces and drive, energy in the tire, energy lost, and the imbalance.

    `state`: the tire's snapshot; `pressed`: load times deflection of the static state, J.
    """
    slight = negligible(pressed)
    total = work.total
    record.indicators["work of contact on the tire"] = (work.contact, "J")
    if work.driven is not None:
        record.indicators["work of the prescribed forces"] = (work.driven, "J")
    if work.turned is not None:
        record.indicators["work of the free wheel's inertia on the tire"] = (work.turned, "J")
    energies = energies_in(rolling, response, state, step)
    if energies is None:
        console.say(f"  energy: contact and forces put {total:.4g} J into the tire")
        return
    record.indicators |= {
        "energy left in the modes": (energies[0], "J"),
        "energy left in the residual flexibility": (energies[1], "J"),
        "energy left in slow rubber": (energies[2], "J"),
    }
    if work.nonlinear is not None:
        record.indicators["energy left in the nonlinear force"] = (work.nonlinear, "J")
        console.say(
            f"  energy: of the contact's {work.contact:.4g} J the nonlinear force holds {work.nonlinear:.4g} J; the rest goes on"
        )
    if work.begun:
        record.indicators["energy in both as the run begins"] = (work.begun, "J")
    left = sum(energies) - work.begun
    if losses.found is None:
        _standing(record, rolling, total, left, slight)
    else:
        lost, drive, beyond, springs_lead = losses.found
        record.indicators["energy lost in slow rubber, part of that in the material"] = (
            losses.slow,
            "J",
        )
        by_springs = springs_lead - work.lead
        _rolling(record, total, left, lost, drive, beyond, by_springs, slight)


def energies_in(
    rolling: RollingModes,
    response: Response,
    state: dict[str, np.ndarray],
    step: float,
) -> tuple[float, float, float] | None:
    """Energy (J) in modes, residual flexibility and slow rubber by a tire's snapshot; None where they are not known."""
    own = own_states(response, rolling) and len(state["block_state"]) == len(rolling.states.block)
    if not own:
        return None
    resolved = response.resolved(step)
    left = energy_left(rolling, state, response.slow(step))
    relaxed = Relaxed.held(state["state"][resolved.of_modes.stop :].real)
    return left, springs(resolved, state["push_force"]), relaxed


def _standing(
    record: Record, rolling: RollingModes, work: float, left: float, slight: float
) -> None:
    """Energy lost, by difference; it must not be negative for a tire at rest beyond `slight` J."""
    turns = rolling.turning.speed > 0
    record.indicators["lost, less the work of the drive" if turns else "lost"] = (work - left, "J")
    console.say(
        f"  energy: {work:.4g} J came into the tire, {left:.4g} J are left in it, "
        f"{work - left:.4g} J were lost{' less what the drive put in' if turns else ''}"
    )
    if not turns and left > work + 1e-3 * abs(work) + slight:
        record.warnings.append(
            "the standing tire holds more energy than was put in: take a smaller time.step, or "
            'time.scheme = "constant"'
        )


def _rolling(
    record: Record,
    work: float,
    left: float,
    lost: float,
    drive: float,
    beyond: float,
    by_contact: float,
    slight: float,
) -> None:
    """All terms are known: the imbalance is the error of the time steps; `slight` J are none."""
    off = work + drive - left - lost - beyond - by_contact
    moved = max(abs(work), abs(drive), abs(left), abs(lost))
    record.indicators |= {
        "work of the drive against the damping": (drive, "J"),
        "energy lost in the material": (lost, "J"),
        "energy lost in the modes left out, less their drive": (beyond, "J"),
        "energy that the scheme takes": (by_contact, "J"),
        "energy that does not add up": (off, "J"),
    }
    console.say(
        f"  energy: contact {work:.4g} J + drive {drive:.4g} J = in the tire {left:.4g} J + lost "
        f"{lost:.4g} J + lost in truncated modes, less what the drive puts into them, {beyond:.2g} J + dissipated by the scheme {by_contact:.2g} J; "
        f"imbalance {off:.2g} J"
    )
    if abs(off) > _UNBALANCED * moved + slight:
        record.warnings.append(
            f"the energy of the rolling tire does not add up by {100 * abs(off) / moved:.2g} %: take a "
            "smaller time.step"
        )
    if abs(by_contact) > _TAKEN * moved + slight:
        record.warnings.append(
            f"the scheme took {100 * abs(by_contact) / moved:.2g} % of the energy that moved: what bounces on the "
            "tread is damped by it; take a smaller time.step to see it"
        )


@dataclass(frozen=True, kw_only=True)
class ContactStage(Stage[ContactHistory]):
    """The time loop. Its file is written as it proceeds, from the last checkpoint if any."""

    name: ClassVar[str] = "contact"
    static: Result[StaticState]
    rotating: Result[RollingModes]
    greens: Result[Responses]
    setup: Result[ContactSetup]
    wheel: Result[Wheel]
    fields: Result[ModalBasis]
    restoring: Result[RestoringForce]
    nonlinear: Result[TrainedMotion] | None = None

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        scene = self.job.scene
        from tireroad.contact.solver.conditions import TOLERANCE

        assert scene.contact is not None, "the stage runs with [contact] only"
        parts = [f"{scene.contact.solver}, complementarity to {TOLERANCE:g} of the scale"]
        kind = SOLVERS.get(scene.contact.solver)
        if kind and kind.about:
            parts.append(kind.about)
        if scene.contact.has_friction:
            from tireroad.contact.solver.grid_newton import GAP_TOLERANCE
            from tireroad.contact.solver.stick_slip import TOLERANCE as change
            from tireroad.contact.solver.stick_slip import TURNS

            parts.append(
                f"friction to {change:g} of the largest force in at most {TURNS} iterations, together with gaps to "
                f"{GAP_TOLERANCE:g} where more than {MOST_ALTERNATING} points of a fine grid touch at rest"
            )
        return "; ".join([*parts, f"scheme {scene.time.scheme}"])

    def inputs(self) -> dict:
        """The Green's functions, the contact, the road (a file by its content) and the time."""
        trained = {"nonlinear": self.nonlinear.key} if self.nonlinear else {}
        loop = stages_setup.loop_inputs(self.job, self.setup.product)
        return {"greens": self.greens.key, **loop, **trained}

    def produce(self, key: str, record: Record) -> ContactHistory:
        """Run the time loop and read the history back. Collective."""
        beside = None if self.nonlinear else self.job.beside_loop
        if beside is None or self.job.comm.size == 1 or not (plan := self._held_by_one()):
            self._roll(key, record)
            return self.stored()
        console.say(
            "  the first process computes the loop, which is too small to distribute, the others its error bars"
        )
        products = {name: getattr(self, name) for name in ("static", "rotating", "greens", "setup")}
        for part in products.values():  # reading one is collective
            _ = part.product
        if self.job.scene.force:
            _ = self.job.tire  # as is making its mesh, on which the forces have their places
        alone = replace(self, job=self.job.alone())

        def meanwhile(ended: Callable[[], bool]) -> None:
            beside(self.job, products, alone._foreseen(plan), ended)

        on_root_beside(self.job.comm, lambda: alone._roll(key, record), meanwhile)
        return self.stored()

    def _held_by_one(self) -> Planned | None:
        """The planned steps of a loop that each process would compute whole; None of one that they share. Collective."""
        with console.quiet():
            shortest = shortest_excitation(self.job.scene, self.setup.product)
            plan = planned(self.job, Record(), self.greens.product.contact, shortest)
        return (
            plan
            if loop_communicator(plan.response, self.job.comm).size < self.job.comm.size
            else None
        )

    def _foreseen(self, plan: Planned) -> ContactHistory:
        """Steps and scheme of the loop, before it has any forces. Not collective."""
        with console.quiet():
            force = self.static.product.normal_force
            setup, _ = self.setup.product.equilibrated(
                self.greens.product.contact, force, self.job.scene.contact
            )
            scheme = chosen_scheme(self.job, Record(), setup, plan, None, False).scheme
        time = plan.step * np.arange(1, plan.steps + 1)
        return ContactHistory(
            step=plan.step, scheme=scheme, time=time, total_force=np.zeros((0, 3))
        )

    def _roll(self, key: str, record: Record) -> None:
        """Run the time loop with the scheme that suits the contact; the other one if it chatters.

        Collective.
        """
        response, setup = self.greens.product.contact, self.setup.product
        shortest = shortest_excitation(self.job.scene, self.setup.product)
        plan = planned(self.job, record, response, shortest)
        with record.timing("tread and solver"):
            setup, rise = setup.equilibrated(
                response, self.static.product.normal_force, self.job.scene.contact
            )
            if rise:
                record.indicators["rise of the tire as it settles on the grid"] = (rise, "m")
            begun = begun_with(self.job, key)
            chosen = chosen_scheme(self.job, record, setup, plan, begun, self.nonlinear is not None)
            setup = self._rolling_steadily(record, setup, plan.step)
        spec, patch = self.job.scene.contact, setup.patch
        count = f"{len(patch.points)} contact points on {len(patch.index)} nodes"
        console.say(f"  {count}, tread {spec.tread}, solver {solver_name(spec, patch)}")
        if spec.points == "nodes" and spec.law.compliant and self.job.speed:
            console.say(
                '  points are nodes: contact.points = "auto" takes as many as the footprint needs'
            )
        while True:
            try:
                return self._attempt(key, record, setup, plan, chosen)
            except Chatter as chatter:
                chosen = reported(record, chosen.next_scheme(chatter))
                forget_checkpoint(self.job)

    def _rolling_steadily(self, record: Record, setup: ContactSetup, step: float) -> ContactSetup:
        """The setup that begins with steady rolling, where it can: recorded, or why not."""
        asked = bool(self.job.scene.rotation and self.job.scene.rotation.free_rolling)
        try:
            setup = rolling_steadily(
                self.job.scene.contact, setup, self.greens.product.contact, step
            )
        except ConvergenceError as error:
            if asked:
                raise
            record.warnings.append(
                f"the run begins at rest, without the slip of free rolling: {error}"
            )
            return replace(setup, free=False, at_rest=True)
        if setup.free_slip is not None:
            record.headline["slip of free rolling"] = (100 * setup.free_slip, "%")
        if (steady := setup.steady) is not None:
            for axis, name in enumerate("xy"):
                record.indicators[f"force {name} of steady rolling, as the run begins"] = (
                    float(steady.horizontal[:, axis].sum()),
                    "N",
                )
        return setup

    def _attempt(
        self,
        key: str,
        record: Record,
        setup: ContactSetup,
        plan: Planned,
        scheme: Chosen,
    ) -> None:
        """Run the loop, writing by blocks; raises Chatter beyond the scheme's limit. Collective."""
        large = self._large()
        response = large.response if large else self.greens.product.contact
        if large:
            plan = replace(plan, response=response.resolved(plan.step))
        turns = corner.turns_freely(self.job.scene)
        if turns:
            plan = replace(plan, response=with_spin(response, self._states).resolved(plan.step))
        chosen = integration(self.job, plan, scheme.scheme)
        if keeps_history(chosen.scheme):
            setup = replace(setup, steady=None)  # its history begins at t = 0
        with record.timing("tread and solver"):
            moved = self._moved(large, chosen)
            wheel = free_wheel(self.job, chosen) if turns else None
            driven = driven_tire(self.job, chosen, setup.patch, moved or wheel)
            loop = self._loop(record, setup, driven or moved or chosen.tire, chosen.step)
        totals = Totals(setup.patch, setup.reach, scheme.limit, work=Work(scheme.scheme))
        losses = Losses(chosen, response, self._states)
        instants = Greatest(moved, chosen.tire, loop.contact)
        with ExitStack() as stack, record.timing("time loop"):
            attributes = {"step": chosen.step, "scheme": chosen.scheme, "road_relief": setup.relief}
            attributes |= {"free_slip": setup.free_slip or 0.0, "scheme_reason": scheme.reason}
            attributes["scheme_limit"] = scheme.limit
            attributes["friction"] = self._coefficient
            attributes["steady"] = not setup.at_rest
            file = ContactFile(self.job, key, setup, attributes)
            written = file.open(stack, self.job.path(self.name))
            if written is None:
                self._begin(loop, totals, losses, response, chosen.step)
            else:
                loop.restore(written)
                totals.set_state(written)
                losses.set_state(written)
                instants.set_state(written)
                reached = totals.figures.steps * chosen.step
                console.say(f"  continues from the checkpoint at t = {reached:.6g} s")
            done, began = totals.figures.steps, time.thread_time()
            self._steps(setup, loop, file, totals, losses, instants, chosen)
            # CPU time of this process's own thread: the cost of a step when no other process needs
            # the cores.
            busy = (time.thread_time() - began) / max(chosen.steps - done, 1)
            record.indicators["processor time a step"] = (1e6 * busy, "us")
            file.finish()
        describe(record, totals, loop.contact.factorisations, chosen, chosen.steps - done)
        rubbing(
            record,
            self._coefficient,
            self.job.scene,
            loop.contact.lagging,
            totals.figures.steps,
        )
        meeting(record, loop.contact, totals.figures.steps)
        alternation(record, totals.alternation.worst, scheme)
        points(record, setup.patch, self.static.product.footprint(), setup.relief)
        highest = self.rotating.product.highest / (2 * np.pi)
        edges(record, self.job.scene.road, setup.patch, abs(setup.rolled.speed), highest)
        if large and moved:
            felt = large.felt(instants, chosen.step) if len(instants) else None
            large.factors.destroy()
            describe_large(record, moved, felt, totals.figures.steps, totals.figures.excursion)
        else:
            deflection, held = self.static.product.deflection, self.job.scene.axle.kind == "fixed"
            excursion(record, totals.figures.excursion, deflection, held=held)
        stages_setup.describe(record, setup)
        contact_file.describe(record, setup, self.job.scene.road)
        if not keeps_history(chosen.scheme):
            pushed = driven if self.job.scene.force else None
            work = works(totals.work, pushed, moved, wheel)
            given = self._states, response, loop.tire.snapshot(), work
            state = self.static.product
            pressed = float(state.normal_force.sum()) * (state.deflection or 0.0)
            describe_energy(record, *given, losses, chosen.step, pressed)

    def _begin(
        self, loop: Loop, totals: Totals, losses: Losses, response: Response, step: float
    ) -> None:
        """Count work and losses from the state in which the loop begins, if that is not the static one. Collective."""
        if loop.begun is None:
            return
        change, moved = loop.begun
        snapshot = loop.tire.snapshot()
        losses.begin(snapshot)
        energies = energies_in(self._states, response, snapshot, step)
        totals.work.begin(change[: len(moved)], moved, sum(energies or (0.0,)))

    def _large(self) -> LargeMotion | None:
        """The parts of large motions; None where the motion is linear. Collective."""
        if self.nonlinear is None:
            return None
        motion, trained = linear_motion(self), self.nonlinear.product
        return replace(
            motion,
            force=trained.stored.force(motion.restoring),
            vectors=trained.stored.on_unknowns(motion.restoring),
            response=trained.response,
        )

    def _moved(self, large: LargeMotion | None, chosen: Integration) -> LargeTire | None:
        """The tire of large motions, if any. Collective."""
        if large is None:
            return None
        assert isinstance(chosen.tire, Recursion), "the scene's rules refuse a convolution"
        return large.tire(chosen.tire, chosen.scheme)

    @property
    def _coefficient(self) -> float:
        """The coefficient of friction of the loop: 0 without, infinite for bristles that never slip."""
        contact = self.job.scene.contact
        if not contact.has_friction:
            return 0.0
        return np.inf if contact.friction is None else contact.friction

    @property
    def _states(self) -> RollingModes:
        """The modes, with the attachment modes where there are any, whose states the loop has."""
        return self.greens.product.states(self.rotating.product)

    def _loop(self, record: Record, setup: ContactSetup, tire, step: float) -> Loop:
        """The loop of tire, normal solver and friction at the patch's points; recorded."""
        spec = self.job.scene.contact
        loop = make_loop(spec, setup, tire, step)
        limit = loop.contact.largest_unique
        if limit is not None:
            record.indicators["friction up to which a step is known to have one solution"] = (
                limit,
                "-",
            )
        return loop

    def _steps(
        self, setup, loop: Loop, file: ContactFile, totals, losses, instants: Greatest, chosen
    ) -> None:
        """Take the remaining steps; stops between two blocks of them when requested. Collective."""
        done, steps = totals.figures.steps, chosen.steps
        blocks = loop.roll(setup.drive, chosen.step, steps, done=done, at_once=instants.apart)
        watch = Watch(self.job.comm, self.job.scene.time.checkpoint)
        with (
            Deferred() as deferred,
            console.ProgressBar("contact", steps, begun=done) as bar,
            # One core reads a step's matrices, a megabyte, as fast as two; threads that wait for
            # each other in every product took ten times as long where cores are shared.
            threadpool_limits(1, "blas"),
        ):
            for block in blocks:
                file.write(block, totals.add)
                losses.flush()
                instants.see(float(block.time[-1]))
                bar.advance(len(block.time))
                stop, due = watch(deferred.asked)
                if stop or due:
                    state = totals.state() | losses.state() | instants.state()
                    file.checkpoint(loop.snapshot() | state)
                if stop:
                    raise Stopped(stop)
            totals.finish()

    def read(self, file) -> ContactHistory:
        """The totals over time, without the single points."""
        return ContactHistory.of(file)
