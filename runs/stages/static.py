"""Stage static: inflates the tire and presses it on the road."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np

from tireroad.fem.collective import collect
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.diagnosis import with_cause
from tireroad.fem.static.equilibrium import Equilibrium, History
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.load_error import UNKNOWN, load_error
from tireroad.fem.static.load_steps import Loader
from tireroad.fem.static.press import Near, place
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.timing import Timing
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base import kept
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Computed
from tireroad.runs.stages.build.tire import road_shape
from tireroad.runs.stages.build.turning import friction_of, rolling_shape, turning_of, wheel_slip
from tireroad.runs.stages.stored import cords_file, friction_file, static_file
from tireroad.runs.stages.stored.checkpoint import checkpointed, forget

_SPEEDS, _SAME_SPEED = 6, 1e-6  # most solutions at a travel speed, and when two speeds agree
_EXTENT = "length", "width", "area"
COARSE = 0.02  # estimated relative error of the load above which the user is warned


def steady_rolling(job: Job, speed: float | None = None) -> Rolling:
    """Steady rolling in statics, at `speed` (rad/s) or the job's; at rest if the scene says so."""
    scene = job.scene
    speed = job.speed if speed is None else speed
    if not scene.static.steady_rolling or speed == 0:
        return AT_REST
    return rolling_shape(replace(turning_of(job), speed=speed))


@dataclass(frozen=True, kw_only=True)
class StaticStage(Computed[StaticState]):
    """The tire inflated and, if the scene has a road, pressed on it."""

    name: ClassVar[str] = "static"
    forgets: ClassVar[bool] = True
    """Whether matrices kept from a family's earlier run are discarded: they are another state's."""

    def inputs(self) -> dict:
        """The tire without its air, the static loads, and the rolling terms if they act."""
        scene, rotation = self.job.scene, self.job.scene.rotation
        return {
            "tire": {k: v for k, v in asdict(scene.tire).items() if k != "cavity"},
            "file": scene.tire.shape.fingerprint(scene.tire),
            "static": asdict(scene.static),
            "road": asdict(road_shape(scene)),
            "rolling": asdict(steady_rolling(self.job, rotation.speed if rotation else None)),
            "slip": wheel_slip(scene) if scene.static.friction is not None else None,
            "travel": [rotation.travel_speed, rotation.rolling_radius] if rotation else None,
        }

    def compute(self, record: Record) -> StaticState:
        """The scene's static state. Collective.

        At a travel speed it is solved again until the wheel's speed matches its rolling radius.
        """
        with checkpointed(self, "solution(s)") as journal:
            journal.agreed(self.job.comm)
            return self._concluded(record, *self._at_speed(record, History(journal)))

    def _at_speed(self, record: Record, history: History) -> tuple[StaticState, Loader]:
        """The state at the wheel's speed. Collective."""
        speed, near, steps, turns = self.job.speed, None, 0, 0
        while True:
            state, loader, near = self._solved(record, speed, history, near)
            steps, turns = steps + loader.newton_steps, turns + 1
            before, speed = speed, self.job.free_speed(state)
            same = abs(speed - before) <= _SAME_SPEED * speed or not state.rolling.speed
            if same or turns == _SPEEDS:
                loader.newton_steps = steps
                return state, loader
            radius = state.rolling_radius()
            observe.say(f"  rolling radius {radius:.6g} m: again at {speed:.6g} rad/s")
            del loader  # its matrices and factors, before the next ones are formed
            collect(self.job.comm)

    def _concluded(self, record: Record, state: StaticState, loader: Loader) -> StaticState:
        """Add error estimate and the finer elements' footprint; record the figures. Collective."""
        if self.job.scene.static.error_estimate and state.load:
            with record.timing("error estimate"):
                state = _estimate(record, state, loader)
        _describe(record, state, loader)
        record.headline |= friction_file.headline(state, self.job.scene.static.friction)
        self._warn_at_rest(record)
        observe.say(f"  {record.shares}")
        return state

    def _solved(
        self, record: Record, speed: float, history: History, near: Near | None
    ) -> tuple[StaticState, Loader, Near]:
        """Solve up to the state at `speed` rad/s: in load steps, or from a state `near`, that of
        another speed. Collective."""
        rolling = steady_rolling(self.job, speed)
        with record.timing("mesh and forms"):
            equilibrium = Equilibrium(self.job.tire.body, rolling, road_shape(self.job.scene))
        equilibrium.history = history
        loader = Loader(equilibrium, _show)
        began = Timing.clock()
        try:
            pressed = self._press(loader, rolling, near)
        except ConvergenceError as error:
            kept = self._keep_last(loader)
            cause = with_cause(error, loader, rolling, lambda other: self._press(other, rolling))
            raise ConvergenceError(f"{cause}{kept}") from None
        if pressed is not loader:
            equilibrium.cost.take(pressed.equilibrium.cost)
            loader.newton_steps = pressed.newton_steps
        spent = equilibrium.cost
        spent["other"] = Timing.clock() - began - sum(spent.values())
        record.cost.take(spent)  # at a travel speed that of each solution
        state = static_state(pressed.equilibrium, loader.touch)
        return state, loader, Near.of(loader, pressed)

    def _press(self, loader: Loader, rolling: Rolling, near: Near | None = None) -> Loader:
        """Inflate the tire and press it on the road; returns the final loader. Collective."""
        wanted = self.job.scene.static
        loader.inflate(wanted.inflation, None if near is None else near.inflated)
        placed = wanted.load, wanted.deflection, wanted.road_height
        return place(loader, *placed, friction_of(self.job.scene, rolling), near)

    def _keep_last(self, loader: Loader) -> str:
        """Write the last converged state, if any; returns a sentence saying where. Collective."""
        if not self.job.comm.allreduce(float(np.abs(loader.body.u.x.array).sum())):
            return ""
        job, last = self.job, self.job.path("static_last")
        state = static_state(loader.equilibrium, loader.lowest())
        job.write(
            last, job.provenance("static", "unfinished"), lambda file: self.write(file, state)
        )
        return f" The last state that converged is in {last}."

    def _warn_at_rest(self, record: Record) -> None:
        if self.job.speed and not self.job.scene.static.steady_rolling:
            record.warnings.append(
                "the tire rolls on its state at rest (static.steady_rolling = false): centrifugal and "
                "damping forces of the rolling shape are left out of it"
            )

    def produce(self, key: str, record: Record) -> StaticState:
        """As any stage; also removes the last state of an earlier, failed run. Collective."""
        if self.forgets:
            kept.forget()
        product = super().produce(key, record)
        on_root(self.job.comm, lambda: self.job.path("static_last").unlink(missing_ok=True))
        forget(self.job, self.name)
        return product

    def write(self, file, product: StaticState) -> None:
        """Mesh, displacement, outer face and footprint."""
        static_file.fill(file, product, self.job.tire)

    def read(self, file) -> StaticState:
        """The state, with what it was computed for."""
        surface, attributes = file["surface"], file.attrs
        road = attributes.get("road_height")
        return StaticState(
            displacement=file["displacement"][:],
            points=surface["points"][:],
            moved=surface["displacement"][:],
            force=surface["force"][:],
            area=surface["area"][:],
            half_sizes=surface["half_sizes"][:],
            ring_rate=surface["ring_rate"][:],
            shape=self.job.tire.lattice.face_shape,
            touch_height=float(attributes["touch_height"]),
            road_height=None if road is None else float(road),
            road=road_shape(self.job.scene),
            fine_extent=None if road is None else _extent(attributes),
            inflation=float(attributes["inflation"]),
            rolling=steady_rolling(self.job, float(attributes["rolling_speed"])),
            **cords_file.read(file),
            **friction_file.read(file),
        )


def _extent(attributes) -> Footprint:
    return Footprint(*(float(attributes[f"footprint_{name}"]) for name in _EXTENT))


def _estimate(record: Record, state: StaticState, loader: Loader) -> StaticState:
    """Report the load error from finer elements; returns the state, their footprint. Collective."""
    if state.pull is not None:  # estimated without friction: the load's error is the same with it
        loader.equilibrium.solve(loader.equilibrium.road_height)
    found = load_error(loader, state.rolling)
    if isinstance(found, str):
        observe.say(f"  error of the load not estimated: {found}")
        return state
    whole = found.bulk is not None
    what = "estimated error of the load" + ("" if whole else " by the footprint's elements")
    record.indicators[what] = (100 * found.relative, "%")
    to = f"ever smaller elements: {found.load:.5g} N" if found.signed else "of unknown sign"
    rest = f"{100 * found.bulk:.2g} %" if whole else f"not estimated: {UNKNOWN}"
    observe.say(
        f"  {what} at this height of the road: {100 * found.relative:.2g} % ({to}); of "
        f"the footprint's elements {100 * found.footprint:.2g} %, of the rest {rest}; {found.unknowns} unknowns with finer elements there"
    )
    if found.relative > COARSE:
        record.warnings.append(
            f"the load may be off by {100 * found.relative:.2g} %: take smaller elements "
            "(tire.segments, tire.elements_arc, tire.footprint_size)"
        )
    for name in _EXTENT[:2]:
        size = getattr(state.footprint(), name)
        record.indicators[f"footprint {name} on the elements of the run"] = (size, "m")
    return state if state.pull is not None else replace(state, fine_extent=found.extent)


def _show(progress) -> None:
    step = progress.step
    observe.say(
        f"  {progress.what} {progress.value:.6g} {progress.unit}: load {progress.load:.6g} N on "
        f"{progress.active} points, {step.iterations} Newton steps, residual {step.residual:.1e}"
        + ("" if step.reason == "converged" else f"; {step.reason}")
    )


def _describe(record: Record, state: StaticState, loader: Loader) -> None:
    free = 3 * len(state.displacement)
    record.headline["unknowns"] = (free, "-")
    record.headline |= cords_file.headline(state)
    if state.road_height is not None:
        extent = state.footprint()
        record.headline |= {
            "load": (state.load, "N"),
            "deflection": (state.deflection, "m"),
            "footprint length": (extent.length, "m"),
            "footprint width": (extent.width, "m"),
            "footprint area": (extent.area, "m2"),
            "contact points": (int((state.force > 0).sum()), "-"),
        }
        record.indicators["least contact force"] = (float(state.force.min()), "N")
        record.indicators["largest penetration"] = (state.penetration, "m")
    record.headline["rolling radius"] = (state.rolling_radius(), "m")
    record.indicators["Newton steps"] = (loader.newton_steps, "-")
