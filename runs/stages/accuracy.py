"""Stage accuracy: error estimates of a run's forces from cheap companion runs of known orders."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import h5py
import numpy as np
from mpi4py import MPI

from tireroad.contact.grid_patch import MOST, finer_touching, halved, ratio, thinned
from tireroad.contact.model import TreadContact
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.error_bars import (
    CAUSES,
    Bars,
    Measured,
    Relation,
    measured,
    orders,
    random_share,
    share,
    total,
)
from tireroad.contact.results.spectra import Limit, limits, lowest, pitch, wide_enough
from tireroad.contact.rolling import bristles, rolling_steadily, usual_steps
from tireroad.contact.setup import ContactSetup, on_shape
from tireroad.contact.tread.between_nodes import (
    OuterRubber,
    before_equilibrium,
    on_nodes,
    over_rectangles,
    rastered,
)
from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.laws.elastic import ElasticLayer, HalfSpace
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.sections.mesh2d import Ring, crown_layer
from tireroad.fem.static.load_error import carried_over
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.material import CONSTANT, Spectrum, kinds
from tireroad.greens.basis import Basis
from tireroad.greens.fewer_modes import of_fewer_modes
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.disk import Refused
from tireroad.runs.files.folder import make_folder
from tireroad.runs.files.store import put
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.results.datasets import ABSENT
from tireroad.runs.scene.estimate import AT_ONCE, estimate
from tireroad.runs.scene.physics import compounds
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.cavity import AirColumn
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.greens import GreensStage, Responses, as_read
from tireroad.runs.stages.modes import Fields, ModesStage, Motions
from tireroad.runs.stages.replay import PatchForces, Vibrating, driven_loads, on_other_mesh
from tireroad.runs.stages.rolling import ContactForces, first_step, forces, recursive
from tireroad.runs.stages.rotating import FullMatrices, RotatingStage
from tireroad.runs.stages.setup import Probes, Setup, points_of, probes, tread_surface
from tireroad.runs.stages.stage import UNKNOWN, Computed, Job, PipelinePart, Record, Result
from tireroad.runs.stages.static import StaticStage
from tireroad.runs.stages.training import TrainedMotion

_WHOLE = 0.9  # share of the wall from which a compound counts as all of it

STATIC_TO_GREENS: tuple[type[PipelinePart], ...] = (
    Motions,
    Setup,
    ModesStage,
    AirColumn,
    Fields,
    FullMatrices,
    RotatingStage,
    GreensStage,
)
COARSER = "coarser"  # folder, in the run's own, of the coarser companion's stages
LEAST = (8, 4)  # fewest elements around and along of a companion's mesh
SHARE = 0.5  # of the run's own cost: budget of all companion runs together
# Of the run's loop: no more of them. On two processes one repeats loops while the other computes the run's own, then both: they
# end half a loop's time after it.
LOOPS = 1.75
_FEWEST = 64  # steps after the run-in that companions repeat at least
# Periods of `up_to` after the run-in that they repeat at least and at most, as many as lines of their spectra up to there: the
# relative difference of two records by so many random lines is 0.8 to 1.25 times that of long ones in eight cases of ten; by
# 4 lines, 0.6 to 1.6 times. Twice as many lines make a few per cent more of the bars good (docs/verification/error-bars.md).
_PERIODS = 16, 32
# Cost of five companion runs in time loops per repeated step, by the spacing of that of the points.
_LOOPS = {2.0: 3.5, 0.5: 6.0}
_COARSE = 0.14  # cost on elements of twice the size, as a share of the run's cost before the loop
# s a step of a tire that begins to roll steadily and pair of loads, beside those of its points: 100 of 140 ms of noise.toml.
_FLEXIBLE = 1.5e-8
FEWER = 1 / np.sqrt(2)  # share of the highest mode up to which the companion keeps states
# Loops of each cause, about: twice as many points take longer than all others.
_LONGEST_FIRST = {"points": 8.0, "mesh": 2.0, "modes": 1.0, "step": 0.5}
_AHEAD = (
    "points",
    "step",
    "modes",
)  # that need no other process: elements of twice the size take all
FORCES = ("contact_force", "axle_force")
_VIBRATION = "vibration"
_UNITS = {"mean": "N", "deviation": "N", "level": "dB", "history": "-"}


class Backing(NamedTuple):
    """Replacements for the run's own contact, setup (not settled) and response."""

    contact: TreadContact
    setup: ContactSetup
    response: Response


def backed(job: Job, static: StaticState, setup: ContactSetup, response: Response) -> Backing:
    """Contact, setup (not settled) and response with the outer rubber's local compliance.

    The tread is backed by all of that rubber; the nodes' residual loses the part that the mesh
    already has. Raises InputError where this is not known: points at nodes, a road that is not a
    plane, bristles, a tread that creeps.
    """
    contact, patch = job.scene.contact, setup.patch
    if not contact.in_series:
        raise InputError("the run's own tread is what its mesh does not resolve")
    if (
        setup.surface is None
        or patch.frames is not None
        or contact.has_bristles
        or contact.law.creep
    ):
        raise InputError(
            "the compliance of the wall between nodes is known only for a grid of points on a plane road without bristles"
        )
    wall = over_rectangles(_outer(job.scene, job.tire.section))
    known = on_nodes(rastered(setup.surface, patch), wall)
    count = len(patch.index)
    residual = response.residual.copy()
    residual[:count, :count] -= known
    patch = before_equilibrium(patch, known, static.normal_force[patch.index])
    spec = TreadContact(law=OuterRubber(law=contact.law, wall=wall), solver=contact.solver)
    return Backing(spec, replace(setup, patch=patch), replace(response, residual=residual))


def _outer(scene: Scene, ring: Ring) -> Influence:
    """Influence of the crown's compound, as warm as the tire: a half-space if it is the whole wall, else a layer."""
    tire, (region, thickness) = scene.tire, crown_layer(ring.section)
    material = compounds(tire, scene.temperature)[ring.section.regions[region]]
    modulus = material.dynamic * material.law.youngs
    rubber = {"youngs_modulus": modulus, "poisson_ratio": material.law.poisson}
    law = (
        HalfSpace(**rubber)
        if thickness > _WHOLE * ring.thickness
        else ElasticLayer(**rubber, thickness=thickness)
    )
    return law.influence(np.inf)


@dataclass(frozen=True, kw_only=True)
class ReferenceRun:
    """The run that companions repeat in part.

    Its `job`, static state, patch and road (`setup`, not settled), response and rolling modes; the
    first `steps` of `step` s of its loop, integrated by `scheme`. `most`: touching points that a companion may
    have (contact.grid_patch.ratio). `comm`: the processes that repeat a loop together, by default those of the job.
    `attached`: the modes with their attachment modes, if any (runs.stages.greens.Responses). `steady`: whether its loop began
    with steady rolling, as its companions then do. The vibration of the whole tire is told from `since` s on and `up_to` Hz.
    """

    job: Job
    static: Result[StaticState]
    setup: ContactSetup
    response: Response
    rolling: RollingModes
    step: float
    steps: int
    scheme: str = "linear"
    most: float = MOST
    comm: MPI.Comm | None = None
    large: bool = False
    attached: RollingModes | None = None
    steady: bool = True
    since: float = 0.0
    up_to: float = 0.0

    @property
    def points_ratio(self) -> float:
        """Spacing of the points of their companion over the run's."""
        return ratio(self.equilibrated.patch, self.most)

    @property
    def strides(self) -> bool:
        """Whether a companion on points half as far apart passes more than one of them in a step."""
        way = 2 * self.step * self.setup.rolled.speed
        return way > pitch(self.equilibrated.patch) / 2

    @property
    def begun(self) -> float:
        """Steps until a companion on points half as far apart rolls steadily, about; 0 where none does."""
        patch, speed = self.equilibrated.patch, self.setup.rolled.speed
        rolls = self.steady and self.job.scene.contact.has_friction and speed > 0.0
        return usual_steps(patch, 2 * self.step * speed, 2.0) if rolls else 0.0

    @property
    def flexible(self) -> float:
        """Cost (s) of the tire in one of these steps, beside that of its points."""
        return float(_FLEXIBLE * self.response.residual.shape[1] ** 2)

    @cached_property
    def equilibrated(self) -> ContactSetup:
        """The setup with its patch in the static state."""
        return equilibrated(self.job, self.setup, self.response, self.static.product.normal_force)

    @cached_property
    def rolled(self) -> ContactSetup:
        """The setup in which loops of twice the step begin."""
        spec, setup = self.job.scene.contact, self.equilibrated
        if not self.steady:
            return setup
        return rolling_steadily(spec, setup, self.response, 2 * self.step)

    @property
    def states(self) -> RollingModes:
        """The modes, with the attachment modes where there are any, whose states the response has."""
        return self.attached or self.rolling

    @property
    def probes(self) -> Probes:
        """The points between which the response is."""
        return probes(self.job, self.static.product, self.setup)

    @cached_property
    def whole(self) -> Vibrating:
        """The tire whose vibration under the forces of a loop is told."""
        loads = driven_loads(self.job, self.static.product, self.setup)
        basis = Basis.of(self.rolling)
        return Vibrating(
            job=self.job,
            basis=basis,
            seen=basis.seen(loads),
            since=self.since,
            up_to=self.up_to,
        )

    @cached_property
    def on_coarser_mesh(self) -> CoarserMesh:
        """The tire with elements of twice the size. Collective on the job's processes."""
        with console.quiet():
            job, done = coarser(self.job, self.static)
        greens, state = done["greens"].product, done["static"].product
        setup = equilibrated(job, done["setup"].product, greens.contact, state.normal_force)
        rolling = done["rotating"].product
        loads = driven_loads(job, state, done["setup"].product)
        basis = Basis.of(rolling)
        into = on_other_mesh(self.whole.basis, self.job.tire.lattice, basis, job.tire.lattice)
        whole = replace(self.whole, basis=basis, seen=basis.seen(loads), into=into)
        return CoarserMesh(setup, greens.contact, greens.states(rolling), whole)

    @cached_property
    def longer(self) -> ContactForces:
        """The run repeated with twice its time step. Collective on `comm`."""
        return self.repeated(self.rolled, self.response, coarser=2)

    @cached_property
    def own(self) -> ContactForces | None:
        """The run with its own step where it is no reference of its companions itself. Collective on `comm`."""
        return self.repeated(self.equilibrated, self.response, coarser=1) if self.large else None

    @cached_property
    def base(self) -> ContactForces | None:
        """Reference for the companions of points, modes and mesh: the run with twice the step.

        It halves their cost. None if the longer step drops a state or does not resolve the
        contact's oscillation although the run's own step does; the run itself is then the
        reference. Collective on `comm`.
        """
        step, spec = 2 * self.step, self.job.scene.contact
        resolved = self.response.resolved(step)
        if len(resolved.every) < len(self.response.resolved(self.step).every):
            return self.own
        setup = self.equilibrated
        rubbed = bristles(spec, setup.patch)
        steps = oscillation(spec, setup.patch, resolved, step, rubbed, setup.resolved)
        if self.scheme == "linear" and choose(steps).scheme != "linear":
            return self.own
        try:
            return self.longer
        except (ConvergenceError, InputError):
            return self.own

    def first(self, steps: int, since: float, up_to: float) -> ReferenceRun:
        """The same for fewer steps, whose vibrations are told from `since` s on and `up_to` Hz."""
        known = (name for name in ("equilibrated", "rolled") if name in self.__dict__)
        return self._keeping(*known, steps=steps, since=since, up_to=up_to)

    def with_points(self, most: float) -> ReferenceRun:
        """The same with so many touching points of a companion at `most`."""
        return self._keeping("equilibrated", most=most)

    def of(self, job: Job) -> ReferenceRun:
        """The same with another job; `base` stays that of the run."""
        return self._keeping("base", "own", job=job)

    def alone(self) -> ReferenceRun:
        """The same for this process by itself, with what all processes have found."""
        names = ("equilibrated", "rolled", "whole", "on_coarser_mesh", "longer", "own", "base")
        known = (name for name in names if name in self.__dict__)
        return self._keeping(*known, comm=MPI.COMM_SELF)

    def same_loop(self, other: ReferenceRun) -> bool:
        """Whether both repeat as many steps of the same size by the same scheme, begun alike."""
        names = ("step", "steps", "scheme", "steady")
        return all(getattr(self, name) == getattr(other, name) for name in names)

    def keeping_what(self, other: ReferenceRun) -> ReferenceRun:
        """The same with what another has found for the same loop."""
        names = ("equilibrated", "rolled", "whole", "longer", "own", "base")
        narrowed = replace(self)
        narrowed.__dict__.update({name: vars(other)[name] for name in names if name in vars(other)})
        return narrowed

    def _keeping(self, *names: str, **changes: Any) -> ReferenceRun:
        """The same with `changes`, and the cached properties `names` as here."""
        other = replace(self, **changes)
        other.__dict__.update({name: getattr(self, name) for name in names})
        return other

    def repeated(
        self,
        setup: ContactSetup,
        response: Response,
        coarser: int | None = None,
        contact: TreadContact | None = None,
        states: RollingModes | None = None,
        whole: Vibrating | None = None,
    ) -> ContactForces:
        """Repeat the loop with another setup (settled), response or `contact`.

        `coarser`: factor on the time step, by default that of `base`; `states` of the response, by default the run's, for
        a wheel that turns freely; `whole`: of the tire that vibrates, by default the run's. Collective on `comm`.
        """
        times = coarser or (1 if self.base is self.own else 2)
        step, steps = times * self.step, self.steps // times
        comm = self.comm or self.job.comm
        given = self.job, setup, response, step, steps, self.scheme, comm, contact
        return forces(*given, self.steady, states or self.states, whole or self.whole)


class CoarserMesh(NamedTuple):
    """The tire with elements of twice the size: setup (settled), response, its states, and what tells the vibration of the whole tire."""

    setup: ContactSetup
    response: Response
    states: RollingModes
    whole: Vibrating


def equilibrated(
    job: Job, setup: ContactSetup, response: Response, force: np.ndarray
) -> ContactSetup:
    """The setup with its patch in the static state under the nodal forces (s,) N."""
    return setup.equilibrated(response, force, job.scene.contact)[0]


@dataclass(frozen=True, kw_only=True)
class CoarserStatic(StaticStage):
    """The static state on the coarser mesh, reached in a few steps from that of the `run`.

    It is computed from the undeformed tire if the scene prescribes a deflection, which counts from
    this mesh's own first contact, or if those steps do not converge.
    """

    forgets: ClassVar[bool] = False  # the run's own matrices are kept for the next member
    run: Job
    near: Result[StaticState]

    def inputs(self) -> dict:
        """Those of any static state, and the state it starts from."""
        return super().inputs() | {"near": self.near.key}

    def compute(self, record: Record) -> StaticState:
        """The static state. Collective."""
        static = self.job.scene.static
        if static.deflection is None:
            arguments = self.near.product, self.run.tire, self.job.tire, static.load
            if (carried := carried_over(*arguments)) is not None:
                return carried
        return super().compute(record)


def coarser(run: Job, static: Result[StaticState]) -> tuple[Job, dict[str, Result]]:
    """The coarser job, and its parts from the static state to the Green's functions. Collective."""
    job, done = coarser_job(run), dict[str, Result]()
    if (contact := job.scene.contact) is not None:
        # Contact points as in the run, not those its own footprint would ask for.
        contact = replace(contact, points=points_of(run, static.product))
        job = replace(job, scene=replace(job.scene, contact=contact))
    on_root(job.comm, lambda: make_folder(job.directory))
    chain: tuple[type[PipelinePart], ...] = (StaticStage, *STATIC_TO_GREENS)
    for kind in chain:
        part = (
            CoarserStatic(job=job, run=run, near=static)
            if kind is StaticStage
            else kind.with_inputs(job, done)
        )
        if (result := _made(job, kind, part, done)) is not None:
            done[kind.name] = result
    return job, done


def coarser_job(job: Job) -> Job:
    """The same scene with half the elements around and, where given, from bead to bead.

    Its stages are cached like those of any run, in a subfolder of the run's. Raises InputError if
    the mesh is too coarse to be halved.
    """
    tire, static = job.scene.tire, job.scene.static
    coarse, segments = tire, tire.segments // 2
    if segments >= LEAST[0]:
        coarse = replace(tire, segments=segments, shape=tire.shape.coarser(tire))
    if coarse is tire or coarse.proportions().along < LEAST[1]:
        around, along = (2 * least for least in LEAST)
        raise InputError(
            f"the mesh is too coarse to be halved: that needs {around} elements around and {along} along"
        )
    rotation = job.scene.rotation
    if rotation is not None:  # the speed of the run's own wheel, whatever the travel speed
        rotation = replace(rotation, speed=job.speed, travel_speed=None)
    scene = replace(
        job.scene,
        rotation=rotation,
        tire=coarse,
        static=replace(static, error_estimate=False),
    )
    return replace(job, scene=scene, directory=job.directory / COARSER, found={})


def _made(
    job: Job, kind: type[PipelinePart], part: PipelinePart | None, done: dict[str, Result]
) -> Result | None:
    """The result of one part of the chain; None if it has none. Collective."""
    if kind is RotatingStage and not job.speed:
        return RotatingStage.if_skipped(job, done)
    return part.result() if part else None


def records(step: float, up_to: float) -> tuple[int, int]:
    """Fewest and most steps of `step` s after the run-in, for histories compared up to `up_to` Hz."""
    least, most = (max(_FEWEST, int(np.ceil(periods / (up_to * step)))) for periods in _PERIODS)
    return least, most


@dataclass(frozen=True)
class Budget:
    """Cost of a run in operations (scene.extent.estimate): `before` its loop, and per step of it.

    `steps`: of its loop.
    """

    before: float
    loop: float
    steps: int

    @classmethod
    def of(cls, scene: Scene, steps: int) -> Budget:
        """The budget of a scene that takes so many steps."""
        work = estimate(scene).work
        loop = work["contact loop"]
        return cls(sum(work.values()) - loop, loop / steps, steps)

    @property
    def _whole(self) -> float:
        loop = self.loop * self.steps
        return min(SHARE * (self.before + loop), LOOPS * loop)

    def most_touching(self, least: int, reference: ReferenceRun) -> float:
        """Touching points that the companion of the points may have, repeating `least` steps of which one takes two.

        As many as take half the budget of all companions, the steps until it rolls steadily included. None more than a factor
        solves where a step passes more than a point: noise.toml then took 3.1 s for each, in place of 0.4.
        """
        if reference.strides:
            return MOST
        begun = reference.begun
        left = self._whole / 2 - begun * reference.flexible
        return max(MOST, left / (AT_ONCE * (least / 2 + begun)))

    def window(self, least: int, most: int, reference: ReferenceRun) -> int:
        """Last step of companion runs: `least`, more up to `most` as far as the budget goes; even."""
        spacing, left = reference.points_ratio, self._whole - _COARSE * self.before
        each = _LOOPS[spacing] * self.loop
        if spacing < 1 and (finer := finer_touching(reference.equilibrated.patch)) > MOST:
            each += AT_ONCE * finer / 2
            left -= reference.begun * (AT_ONCE * finer + reference.flexible)
        count = round(left / each)
        count = int(np.clip(count, min(least, self.steps), min(most, self.steps)))
        return count - count % 2


def longer_step(reference: ReferenceRun) -> ContactForces:
    """Twice the time step. Collective."""
    return reference.longer


def other_points(reference: ReferenceRun) -> ContactForces:
    """Every other point of the grid both ways or, where affordable, twice as many. Collective."""
    job, patch = reference.job, reference.setup.patch
    if patch.places is None:
        raise InputError(
            "the points are nodes of the mesh: take a grid, contact.points = { dx, dy }"
        )
    coarser = reference.points_ratio > 1
    brush = job.scene.contact.brush_stiffness
    if brush is not None:  # stiffness of a point that stands for four, or for a quarter
        contact = replace(job.scene.contact, brush_stiffness=brush * (4 if coarser else 0.25))
        job = replace(job, scene=replace(job.scene, contact=contact))
    if coarser:
        patch = thinned(patch)
    else:
        surface = tread_surface(job, reference.static.product, reference.static.key)
        height = reference.static.product.road_height
        assert height is not None
        patch = halved(patch, surface, height, reference.setup.reach)
        patch = on_shape(patch, reference.static.product.road)
    setup = replace(reference.setup, patch=patch)
    setup = equilibrated(job, setup, reference.response, reference.static.product.normal_force)
    return reference.of(job).repeated(setup, reference.response)


def fewer_modes(reference: ReferenceRun) -> ContactForces:
    """Modes up to `FEWER` of the highest, with what joins modes joining these, and what replaces those left out. Collective.

    A response of the same kind (greens.fewer_modes). Of the states of a `full` problem, and of those chosen by greens.dynamic,
    the ones from there to the highest are static instead; states above the highest mode are kept.
    """
    rolling, response = reference.states, reference.response
    if rolling.full or reference.job.scene.greens.dynamic is not None:
        limits = FEWER * rolling.highest, rolling.highest

        def stays(s: np.ndarray) -> np.ndarray:
            kept: np.ndarray = (np.abs(s) <= limits[0]) | (np.abs(s) > limits[1])
            return kept

        coarse = response.keeping_where(stays)
        if len(coarse.every) == len(response.every):
            raise InputError("all states lie far below the highest mode: none can be left out")
        whole = reference.whole.keeping_where(stays)
    else:
        job, points = reference.job, reference.probes
        seen = rolling if reference.attached else as_read(rolling, points)
        arguments = seen, seen.basis.shape, points.loads[points.counted], FEWER
        residual, spectra = job.scene.greens.residual, _spectra(job)
        comm = reference.comm or job.comm
        coarse, rolling, turn = of_fewer_modes(response, *arguments, residual, spectra, comm)
        whole = reference.whole.of_combinations(rolling, turn, points.loads[points.counted])
    force = reference.static.product.normal_force
    begun = equilibrated(reference.job, reference.setup, coarse, force)
    return reference.repeated(begun, coarse, states=rolling, whole=whole)


def _spectra(job: Job) -> list[Spectrum]:
    """The spectra of the compounds' moduli that depend on frequency, in the order of the wall's kinds."""
    filling = compounds(job.scene.tire, job.scene.temperature)
    materials = [filling[name] for name in job.tire.section.section.regions]
    found = kinds([(one.spectrum, one.loss_factor, one.dynamic) for one in materials])
    return [kind.spectrum for kind in found if kind.spectrum != CONSTANT]


def coarser_mesh(reference: ReferenceRun) -> ContactForces:
    """Elements of twice the size, from the static state on. Collective."""
    setup, response, states, whole = reference.on_coarser_mesh
    return reference.repeated(setup, response, states=states, whole=whole)


def finer_wall(reference: ReferenceRun) -> tuple[ContactForces, ContactForces | None]:
    """With the local flexibility of the wall between nodes below the contact points added, and its reference.

    A coarser mesh does not show this part: halving the elements changes the far field of a point
    eight times and more, but its near field only twice. It is known for forces normal to the road: with friction,
    both runs are repeated without. Collective.
    """
    force = reference.static.product.normal_force
    wall = backed(reference.job, reference.static.product, reference.setup, reference.response)
    setup = wall.setup.equilibrated(wall.response, force, wall.contact)[0]
    forces = reference.repeated(setup, wall.response, contact=wall.contact)
    contact = reference.job.scene.contact
    if not contact.has_friction:
        return forces, reference.base
    plain = TreadContact(law=contact.law, solver=contact.solver)
    return forces, reference.repeated(reference.equilibrated, reference.response, contact=plain)


COMPANIONS: dict[str, Callable[[ReferenceRun], ContactForces]] = {
    "step": longer_step,
    "points": other_points,
    "modes": fewer_modes,
    "mesh": coarser_mesh,
}
"""By the cause of the error that each estimates (contact.results.error_bars.CAUSES)."""


def _dealt(causes: Iterable[str], count: int) -> list[list[str]]:
    """Causes, the longest first, for each of `count` processes: the next for the one with the least to do."""
    hands: list[list[str]] = [[] for _ in range(count)]
    for cause in causes:
        least = min(hands, key=lambda hand: sum(_LONGEST_FIRST[one] for one in hand))
        least.append(cause)
    return hands


class Companion(NamedTuple):
    """The `forces` of a companion run and their reference `beside` (None: the run itself).

    `share`: the fraction of their difference that is the error. `within`: of the run's band that in which they are compared, where
    the error is the run's by similarity; `random`: its errors differ from line to line at random (contact.results.error_bars).
    """

    forces: ContactForces
    beside: ContactForces | None
    share: float = 1.0
    within: float = 1.0
    random: bool = False

    def relation(self, longer: float) -> Relation:
        """How the error follows, of a record so much `longer`."""
        return Relation(self.share, self.within, longer if self.random else None)

    def bars(
        self, own: ContactForces, since: float, *limits: Any, longer: float = 1.0
    ) -> dict[str, Bars]:
        """Error bars of a run with its `own` forces after `since` s, of a record so much `longer`; `limits` as in `figures`."""
        off = figures(self.forces, since, *limits)
        run = figures(self.beside or own, since, *limits)
        relation = self.relation(longer)
        return {name: relation.bars(run[name], off[name]) for name in run}

    def vibration(self, own: ContactForces, longer: float) -> Vibrations:
        """The vibrations of the whole tire in both, of a run with its `own`."""
        beside = self.beside or own
        assert beside.lines is not None and self.forces.lines is not None, "told by each loop"
        return Vibrations(beside.lines, self.forces.lines, self.relation(longer))

    def doubt(self, bars: Mapping[str, Bars]) -> str | None:
        """Why `bars` by an order are a guess: the vertical forces of the two runs differ by more than they vary."""
        if self.random or self.within < 1.0:
            return None
        far = max(float(bar.history[2]) for bar in bars.values()) / self.share
        if not far > 1.0:
            return None
        return f"a guess, since the companion's vertical force differs by {far:.2g} times what it varies, where no order holds"


def figures(
    forces: ContactForces,
    since: float,
    limit: float,
    up_to: float,
    bands: np.ndarray | None = None,
) -> dict[str, Measured]:
    """The quantities of both forces after `since` s, by name; see contact.results.error_bars.measured."""
    first = round(since / forces.step)
    both = {"contact_force": forces.contact, "axle_force": forces.axle}
    return {
        name: measured(values[first:], forces.step, limit, up_to, bands)
        for name, values in both.items()
        if values is not None
    }


def companions(cause: str, reference: ReferenceRun) -> list[Companion]:
    """Companion runs for one cause, without terminal output; their errors add as squares.

    Raises InputError or ConvergenceError if the cause has none. Collective on the processes of `reference`; where these are
    not those of its job, its coarser mesh is known before.
    """
    with console.quiet():
        beside = reference.own if cause == "step" else reference.base
        told = COMPANIONS[cause](reference)
        if cause == "modes":
            pairs = [Companion(told, beside, within=FEWER)]
        else:
            pairs = [Companion(told, beside, _share(cause, reference), random=cause == "points")]
        if cause == "mesh":
            with suppress(InputError, ConvergenceError):
                pairs.append(Companion(*finer_wall(reference)))
    return pairs


class Vibrations(NamedTuple):
    """Lines (f, m) m kg^1/2 of the tire's coordinates from 0 Hz on, of a `run` and its `companion`, and how its error follows."""

    run: np.ndarray
    companion: np.ndarray
    relation: Relation


Told = list[Companion] | ConvergenceError | InputError
"""The companions of a cause, or why it has none."""


def _attempted(record: Record, part: str, run: Callable[[], Any]) -> Any:
    """The value of `run`, timed, or the error with which it gives up."""
    try:
        with record.timing(part):
            return run()
    except Refused:
        raise  # a full disk is no property of the run: it must not be kept as one
    except (ConvergenceError, InputError) as error:
        return error


class Window(NamedTuple):
    """Part of a run that companions repeat (`reference`): its first compared step, and the `limit` and `up_to` (Hz) of the comparison."""

    reference: ReferenceRun
    start: int
    limit: float
    up_to: float


class Ahead(NamedTuple):
    """Forces that a process computed beside the loop, by cause (`found`), their inputs (`reference`), and the seconds taken."""

    reference: ReferenceRun
    found: dict[str, Told]
    cost: dict[str, float]


def _share(cause: str, reference: ReferenceRun) -> float:
    points = reference.points_ratio if cause == "points" else 2.0
    size = {"step": 2.0, "points": points, "mesh": 2.0}[cause]
    job = reference.job
    rubbing = job.scene.contact.has_friction
    section = job.tire.section
    order = orders(section.order, reference.scheme, rubbing, len(section.section.regions))[cause]
    return (random_share if cause == "points" else share)(size, order)


def all_limits(setup: ContactSetup, rolling: RollingModes, step: float) -> tuple[Limit, ...]:
    """Limits by the modes, the spacing of the contact points and the `step` (s)."""
    return limits(
        step=step,
        highest=rolling.highest / (2 * np.pi),
        pitch=pitch(setup.patch),
        speed=setup.rolled.speed,
    )


def model_limit(setup: ContactSetup, rolling: RollingModes, step: float) -> Limit:
    """The lowest of the limits."""
    return lowest(all_limits(setup, rolling, step))


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Error estimates of each force by cause, `by_cause[force][cause]`.

    `centre` (b,) Hz: the third octaves; `window` s: the part of the run they were estimated on,
    from its start; `up_to` Hz: upper frequency of the histories compared; `mean` (3,) N of each
    force over the window; `absent`: why a cause has no estimate. `vibrations`: of the whole tire in the companions of each cause and in what
    they are compared with, on lines `spacing` Hz apart.
    """

    centre: np.ndarray
    window: float
    up_to: float
    mean: Mapping[str, np.ndarray]
    by_cause: Mapping[str, Mapping[str, Bars]]
    absent: Mapping[str, str] = field(default_factory=dict)
    vibrations: Mapping[str, Sequence[Vibrations]] = field(default_factory=dict)
    spacing: float = 1.0

    def total(self, force: str) -> Bars | None:
        """Combined error of all causes with an estimate; None if there is none."""
        terms = self.by_cause.get(force, {})
        return total(terms) if terms else None

    def levels(self, force: str, centre: np.ndarray) -> np.ndarray | None:
        """Error estimates (b, 3) dB at other bands; NaN where unknown."""
        total = self.total(force)
        if total is None:
            return None
        level = np.full((len(centre), 3), np.nan)
        for k, band in enumerate(centre):
            same = np.flatnonzero(np.isclose(self.centre, band))
            level[k] = total.level[same[0]] if len(same) else np.nan
        return level


@dataclass(frozen=True, kw_only=True)
class AccuracyStage(Computed[Accuracy]):
    """Error bars of mean, deviation and third octaves of the contact force and the axle force."""

    name: ClassVar[str] = "accuracy"
    static: Result[StaticState]
    rotating: Result[RollingModes]
    greens: Result[Responses]
    setup: Result[ContactSetup]
    contact: Result[ContactHistory]
    nonlinear: Result[TrainedMotion] | None = None

    def inputs(self) -> dict:
        """The key of the contact forces, and the upper frequency."""
        return {"contact": self.contact.key, "up_to": self.job.scene.accuracy.up_to}

    def compute(self, record: Record) -> Accuracy:
        """Run the companions beside each other, each on a process by itself; a failed one is reported, its cause absent.
        Collective."""
        history = self.contact.product
        if self._at_rest:
            return self._none(record, "nothing excites the tire: its forces vary by rounding only")
        window = self._window()
        if window is None:
            return self._none(
                record, "the run is too short for a companion run with twice the step"
            )
        reference, start, limit, up_to = window
        steps = reference.steps
        axle = None if history.axle_force is None else history.axle_force[:steps]
        _ = reference.whole  # by all: a tire's mesh may have to be made
        lines = on_root(self.job.comm, lambda: self._own_lines(reference))
        own = ContactForces(history.total_force[:steps], axle, history.step, lines)
        since = start * history.step
        length = len(history.time) * history.step - since
        longer = length / (steps * history.step - since)
        bands = wide_enough(1 / length, limit)
        exact = figures(own, since, limit, up_to, bands)
        bars_of: dict[str, dict[str, Bars]] = {name: {} for name in exact}
        absent: dict[str, str] = {}
        vibrations: dict[str, list[Vibrations]] = {}
        for cause, told in self._companions(reference, record).items():
            if isinstance(told, Exception):
                absent[cause] = str(told)
                continue
            parts = [one.bars(own, since, limit, up_to, bands, longer=longer) for one in told]
            doubts = (one.doubt(part) for one, part in zip(told, parts, strict=True))
            record.notes += [f"error by the {cause}: {doubt}" for doubt in doubts if doubt]
            for name in exact:
                bars_of[name][cause] = total(dict(enumerate(part[name] for part in parts)))
            vibrations[cause] = [one.vibration(own, longer) for one in told]
        product = Accuracy(
            centre=exact["contact_force"].centre,
            window=steps * history.step,
            up_to=up_to,
            mean={name: one.mean for name, one in exact.items()},
            by_cause=bars_of,
            absent=absent,
            vibrations=vibrations,
            spacing=1.0 / (steps * history.step - since),
        )
        record.indicators["errors are estimated from"] = (since, "s")
        record.indicators["errors are estimated up to"] = (product.window, "s")
        _describe(record, product, exact, limit)
        if self.nonlinear is not None:
            record.notes.append(
                "the error bars are those of the linear tire: they do not contain the force left out by the nonlinear training, which the stage contact tells"
            )
        return product

    def _own_lines(self, reference: ReferenceRun) -> np.ndarray:
        """The vibration of the whole tire in the run itself. Root process only."""
        whole = reference.whole
        forces = PatchForces.of(self.job, reference.setup, self.contact.product, whole.seen)
        return whole.lines_of(forces, reference.steps)

    def _window(self) -> Window | None:
        """The window that companions repeat; None for a run too short for any. The same on every process."""
        history, setup = self.contact.product, self.setup.product
        start = first_step(setup, self.job.scene.road, history.time)
        start += start % 2  # even: where a step of the companion with twice the step begins
        limit = model_limit(setup, self.rotating.product, history.step).frequency
        up_to = min(limit, self.job.scene.accuracy.up_to)
        least, most = (start + count for count in records(history.step, up_to))
        budget = Budget.of(self.job.scene, len(history.time))
        reference = self._given(budget.steps)
        reference = reference.with_points(budget.most_touching(least, reference))
        steps = budget.window(least, most, reference)
        if steps - start < 2:
            return None
        since = start * history.step
        return Window(reference.first(steps, since, limit), start, limit, up_to)

    def ahead(self, ended: Callable[[], bool]) -> None:
        """Repeat loops while the root computes the run's own, until that has `ended`: those that need nothing of other
        processes. Not collective, and not for the root."""
        window, comm = None if self._at_rest else self._window(), self.job.comm
        if window is None:
            return
        reference, record, found = window.reference.alone(), Record(), dict[str, Told]()
        for cause in _dealt(_AHEAD, comm.size - 1)[comm.rank - 1]:
            if not ended():
                found[cause] = _attempted(record, cause, partial(companions, cause, reference))
        self.job.ahead[self.name] = Ahead(reference, found, dict(record.cost))

    def _companions(self, reference: ReferenceRun, record: Record) -> dict[str, Told]:
        """The companions of each cause, or why it has none. Collective.

        A process takes a whole loop also where the run's own is shared: those share the states of a loop, its contact is
        solved by one (greens.recursion), so that several loops at once take less time than one after the other.
        """
        comm, mine = self.job.comm, self.job.ahead.pop(self.name, None)
        if mine is not None and mine.reference.same_loop(reference):
            reference, known = reference.keeping_what(mine.reference), (mine.found, mine.cost)
        else:
            known = {}, {}
        told_by: dict[str, Told] = {}
        for part, seconds in comm.allgather(known):
            told_by |= part
            record.cost |= seconds
        if isinstance(steps := told_by.get("step"), list):
            reference.__dict__["longer"] = steps[
                0
            ].forces  # nearly every other loop is compared with it
        coarse = _attempted(record, "coarser mesh", lambda: reference.on_coarser_mesh)
        if isinstance(coarse, ConvergenceError | InputError):
            told_by["mesh"] = coarse
        left = [cause for cause in _LONGEST_FIRST if cause not in told_by]
        one, more = reference.alone(), dict[str, Told]()
        for cause in _dealt(left, comm.size)[comm.rank]:
            more[cause] = _attempted(record, cause, partial(companions, cause, one))
        for part, seconds in comm.allgather((more, dict(record.cost))):
            told_by |= part
            record.cost |= seconds
        return {cause: told_by[cause] for cause in CAUSES}

    def end(self, key: str, product: Accuracy) -> None:
        """Remove the coarser companion's folder, kept to resume. Collective."""
        folder = self.job.directory / COARSER
        on_root(self.job.comm, lambda: shutil.rmtree(folder, ignore_errors=True))

    @property
    def _at_rest(self) -> bool:
        scene = self.job.scene
        still = scene.road.kind == "flat" and scene.road.motion.kind == "none"
        return still and not scene.force

    def _none(self, record: Record, reason: str) -> Accuracy:
        console.say(f"  no error bars: {reason}")
        record.headline["numerical error"] = (f"{UNKNOWN}: {reason}", "-")
        absent = dict.fromkeys(CAUSES, reason)
        return Accuracy(
            centre=np.zeros(0), window=0.0, up_to=0.0, mean={}, by_cause={}, absent=absent
        )

    def _given(self, steps: int) -> ReferenceRun:
        return ReferenceRun(
            job=self.job,
            static=self.static,
            setup=self.setup.product,
            response=self.greens.product.contact,
            rolling=self.rotating.product,
            step=self.contact.product.step,
            steps=steps,
            scheme=recursive(self.contact.product.scheme),
            large=self.nonlinear is not None,
            attached=self.greens.product.attached,
            steady=self.contact.product.steady,
        )

    def write(self, file, product: Accuracy) -> None:
        """Bars by force and cause; totals are formed on reading."""
        put(file, "centre", product.centre, "Hz")
        file.attrs["window"], file.attrs["up_to"] = product.window, product.up_to
        for force, mean in product.mean.items():
            put(file, f"{force}_mean", mean, "N")
        for cause, reason in product.absent.items():
            file.attrs[f"{ABSENT}{cause}"] = reason
        for force, causes in product.by_cause.items():
            for cause, bar in causes.items():
                for name, unit in _UNITS.items():
                    put(file, f"{force}/{cause}/{name}", getattr(bar, name), unit)
        for cause, both in product.vibrations.items():
            for number, one in enumerate(both):
                group = file.create_group(f"{_VIBRATION}/{cause}/{number}")
                put(group, "run", one.run, "m kg^1/2")
                put(group, "companion", one.companion, "m kg^1/2")
                put(group, "relation", np.array(one.relation, float), "-")
        file.attrs["spacing"] = product.spacing

    def read(self, file) -> Accuracy:
        """The same, read back."""
        by_cause = {
            force: {
                cause: Bars(*(held[name][:] for name in _UNITS))
                for cause, held in file[force].items()
            }
            for force in FORCES
            if force in file
        }
        absent = {
            key.removeprefix(ABSENT): str(reason)
            for key, reason in file.attrs.items()
            if key.startswith(ABSENT)
        }
        return Accuracy(
            centre=file["centre"][:],
            window=float(file.attrs["window"]),
            up_to=float(file.attrs["up_to"]),
            mean={force: file[f"{force}_mean"][:] for force in FORCES if force in file},
            by_cause=by_cause,
            absent=absent,
            vibrations={
                cause: [_vibrations(one) for one in held.values()]
                for cause, held in file.get(_VIBRATION, {}).items()
            },
            spacing=float(file.attrs.get("spacing", 1.0)),  # runs of before 2026-12 have none
        )


def _vibrations(group: h5py.Group) -> Vibrations:
    share, within, longer = group["relation"][:]
    relation = Relation(share, within, None if np.isnan(longer) else longer)
    return Vibrations(group["run"][:], group["companion"][:], relation)


def begin_ahead(
    job: Job,
    parts: Mapping[str, Result],
    foreseen: ContactHistory,
    ended: Callable[[], bool],
) -> None:
    """Repeat loops of a run beside its own (AccuracyStage.ahead), whose steps and scheme are `foreseen`. Not collective."""
    AccuracyStage(job=job, contact=Result("", lambda: foreseen), **parts).ahead(ended)


def _describe(
    record: Record, product: Accuracy, exact: Mapping[str, Measured], limit: float
) -> None:
    """Record the vertical force's errors: mean, deviation (up to `limit` Hz), worst band."""
    record.indicators["deviations are taken up to"] = (limit, "Hz")
    nothing = np.full(3, np.nan)
    for name, figures in exact.items():
        what = name.replace("_", " ")
        bar = product.total(name) or Bars(nothing, nothing, np.full((0, 3), np.nan), nothing)
        record.tell(f"error of the mean {what}", bar.mean[2], "N")
        record.tell(f"error of the deviation of the {what}", bar.deviation[2], "N")
        record.tell(
            f"error of the {what}'s history up to {product.up_to:.4g} Hz",
            100 * bar.history[2],
            "%",
        )
        record.indicators[f"deviation of the {what} in the window of the error bars"] = (
            float(figures.deviation[2]),
            "N",
        )
        known = bar.level[np.isfinite(bar.level[:, 2]), 2]
        record.tell(
            f"largest error of a third octave of the {what}", known.max(initial=-np.inf), "dB"
        )
        if count := len(figures.centre) - len(known):
            record.headline[f"third octaves of the {what} whose error is unknown"] = (count, "-")
        for cause, part in product.by_cause[name].items():
            record.indicators[f"error of the deviation of the {what} by the {cause}"] = (
                float(part.deviation[2]),
                "N",
            )
    for cause, reason in product.absent.items():
        console.say(f"  error by the {cause} unknown: {reason}")
        record.headline[f"error by the {cause}"] = (f"{UNKNOWN}: {reason}", "-")
    console.say(f"  error bars from the first {product.window:.4g} s of the run")
