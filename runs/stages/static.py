"""Stage static: inflates the tire and presses it on the road."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import h5py
import numpy as np

from tireroad.fem.collective import collect
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.operators import begin_forms
from tireroad.fem.model import TireModel
from tireroad.fem.static.equilibrium import Equilibrium, SolutionHistory
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.load_error import UNKNOWN, load_error
from tireroad.fem.static.load_steps import LoadStepper, with_cause
from tireroad.fem.static.press import InitialState, place
from tireroad.fem.static.state import CordForce, StaticState, static_state
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.timing import Timing
from tireroad.runs.files.store import file_hash, put
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.physics import (
    friction_of,
    road_shape,
    rolling_shape,
    turning_of,
    wheel_slip,
)
from tireroad.runs.stages.checkpoint import checkpointed, forget_checkpoint
from tireroad.runs.stages.matrices import forget_matrices
from tireroad.runs.stages.stage import MUMPS, Computed, Job, Record

_UNITS = {"points": "m", "force": "N", "area": "m2"}
_SMALL = 1e-6  # of mu f: tolerance for a node that slips
_SPEEDS, _SAME_SPEED = 6, 1e-6  # most solutions at a travel speed, and when two speeds agree
_EXTENT = "length", "width", "area"
COARSE = 0.02  # estimated relative error of the load above which the user is warned


def fill_cords(file: h5py.File, state: StaticState) -> None:
    """Write `cords/<name>/...`: grids (ring, along), force in N per cord."""
    for name, cords in state.cords.items():
        for part, unit in _UNITS.items():
            put(file, f"cords/{name}/{part}", getattr(cords, part), unit)
    file.attrs["mass"] = state.mass


def read_cords(file: h5py.File) -> dict:
    """The fields of a static state that `fill` wrote."""
    cords = {
        name: CordForce(*(group[part][:] for part in _UNITS))
        for name, group in file.get("cords", {}).items()
    }
    return {"cords": cords, "mass": float(file.attrs["mass"])}


def cord_headline(state: StaticState) -> dict[str, tuple[float, str]]:
    """Mass, largest cord force, and the share of the ply area whose cords are in compression."""
    figures = {"mass": (state.mass, "kg")}
    if not state.cords:
        return figures
    plies = state.cords.values()
    slack = sum(cords.area[cords.force < 0].sum() for cords in plies)
    return figures | {
        "largest cord force": (float(max(cords.force.max() for cords in plies)), "N"),
        "compressed cords": (
            float(np.round(100 * slack / sum(cords.area.sum() for cords in plies), 6)),
            "%",
        ),
    }


def fill_friction(file: h5py.File, state: StaticState) -> None:
    """Write `surface/pull` (s, 2) N and the travel per radian; nothing without friction."""
    if state.pull is None:
        return
    put(file, "surface/pull", state.pull, "N")
    file.attrs["horizontal_force"] = state.pull.sum(axis=0)
    file.attrs["moment"] = state.moment
    if state.travel is not None:
        file.attrs["travel"] = state.travel


def read_friction(file: h5py.File) -> dict:
    """The fields of a static state that `fill` wrote."""
    if "pull" not in file["surface"]:
        return {}
    travel = file.attrs.get("travel")
    return {
        "pull": file["surface/pull"][:],
        "travel": None if travel is None else float(travel),
    }


def friction_headline(state: StaticState, friction: float | None) -> dict[str, tuple[float, str]]:
    """Horizontal force, axle torque, moment about the vertical, share of the load that sticks."""
    if state.pull is None or friction is None:
        return {}
    force, size = state.pull.sum(axis=0), np.linalg.norm(state.pull, axis=1)
    sticks = size < (1 - _SMALL) * friction * state.normal_force
    share = state.force[sticks].sum() / state.force.sum()
    forward, left, torque, upright = np.round([*force, *state.moment[1:]], 6)
    return {
        "horizontal force, forward": (float(forward), "N"),
        "horizontal force, left": (float(left), "N"),
        "torque on the axle": (float(torque), "N m"),
        "moment about the vertical": (float(upright), "N m"),
        "share of the load that sticks": (float(100 * share), "%"),
    }


def fill(file: h5py.File, state: StaticState, tire: TireModel) -> None:
    """Mesh, displacement, the outer face, the footprint."""
    lattice = tire.lattice
    put(file, "mesh/points", lattice.points(np.arange(lattice.size)), "m")
    put(file, "mesh/cells", lattice.cells(), "-")
    put(file, "displacement", state.displacement, "m")
    put(file, "surface/points", state.points, "m")
    put(file, "surface/displacement", state.moved, "m")
    put(file, "surface/quads", lattice.quads(), "-")
    put(file, "surface/force", state.force, "N")
    put(file, "surface/area", state.area, "m2")
    put(file, "surface/half_sizes", state.half_sizes, "m")
    put(file, "surface/ring_rate", state.ring_rate, "m/rad")
    fill_cords(file, state)
    fill_friction(file, state)
    file.attrs["touch_height"] = state.touch_height
    file.attrs["inflation"] = state.inflation
    file.attrs["load"] = state.load
    file.attrs["rolling_speed"] = state.rolling.speed
    file.attrs["rolling_inertia"] = state.rolling.inertia
    file.attrs["rolling_radius"] = state.rolling_radius()
    if state.road_height is None:
        return
    file.attrs["camber"] = float(np.degrees(state.road.camber))
    if state.road.drum_radius is not None:
        file.attrs["drum_radius"] = state.road.drum_radius
    near = np.flatnonzero(state.gap < tire.section.thickness)
    put(file, "contact/index", near, "-")
    put(file, "contact/points", state.positions[near], "m")
    put(file, "contact/force", state.push[near], "N")
    put(file, "contact/gap", state.gap[near], "m")
    put(file, "contact/area", state.area[near], "m2")
    put(file, "contact/pressure", state.pressure[near], "Pa")
    file.attrs["road_height"] = state.road_height
    file.attrs["deflection"] = state.deflection
    for name, value in asdict(state.footprint()).items():
        file.attrs[f"footprint_{name}"] = value
    if (even := state.evenness()) is not None:
        file.attrs["footprint_shape_factor"] = even.shape_factor
        file.attrs["footprint_shoulder"] = even.shoulder


def steady_rolling(job: Job, speed: float | None = None) -> Rolling:
    """Steady rolling in statics, at `speed` (rad/s) or the job's; at rest if the scene says so."""
    scene = job.scene
    speed = job.speed if speed is None else speed
    if not scene.static.steady_rolling or speed == 0:
        return AT_REST
    return rolling_shape(replace(turning_of(job.scene, job.speed), speed=speed))


@dataclass(frozen=True, kw_only=True)
class StaticStage(Computed[StaticState]):
    """The tire inflated and, if the scene has a road, pressed on it."""

    name: ClassVar[str] = "static"
    forgets: ClassVar[bool] = True
    """Whether matrices kept from a family's earlier run are discarded: they are another state's."""

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        from tireroad.fem.static.equilibrium import MOST_STEPS, TOLERANCE
        from tireroad.fem.static.load_steps import LOAD_TOLERANCE

        return (
            f"Newton's method, residual at most {TOLERANCE:g} of the force scale, at most {MOST_STEPS} "
            f"tangents a load step; load to {LOAD_TOLERANCE:g}; tangents factorised by {MUMPS}, options -static_…"
        )

    def inputs(self) -> dict:
        """The tire without its air, the static loads, and the rolling terms if they act."""
        scene, rotation = self.job.scene, self.job.scene.rotation
        return {
            "tire": {k: v for k, v in asdict(scene.tire).items() if k != "cavity"},
            "file": scene.tire.shape.fingerprint(scene.tire),
            "static": asdict(scene.static),
            "temperature": scene.temperature,
            "curves": [file_hash(file) for file in scene.tire.curves],
            "road": asdict(road_shape(scene)),
            "rolling": asdict(steady_rolling(self.job, rotation.speed if rotation else None)),
            "slip": wheel_slip(scene) if scene.static.friction is not None else None,
            "travel": [rotation.travel_speed, rotation.rolling_radius] if rotation else None,
        }

    def compute(self, record: Record) -> StaticState:
        """The scene's static state. Collective.

        At a travel speed it is solved again until the wheel's speed matches its rolling radius.
        """
        speed, initial, steps, turns = self.job.speed, None, 0, 0
        with checkpointed(self, "solution(s)") as journal:
            journal.agreed(self.job.comm)
            history = SolutionHistory(journal)
            while True:
                state, loader, initial = self._solved(record, speed, history, initial)
                steps, turns = steps + loader.newton_steps, turns + 1
                before, speed = speed, self.job.free_speed(state)
                same = abs(speed - before) <= _SAME_SPEED * speed or not state.rolling.speed
                if same or turns == _SPEEDS:
                    loader.newton_steps = steps
                    return self._concluded(record, state, loader)
                radius = state.rolling_radius()
                console.say(f"  rolling radius {radius:.6g} m: again at {speed:.6g} rad/s")
                del loader  # its matrices and factors, before the next ones are formed
                collect(self.job.comm)

    def _concluded(self, record: Record, state: StaticState, loader: LoadStepper) -> StaticState:
        """Add error estimate and the finer elements' footprint; record the figures. Collective."""
        if self.job.scene.static.error_estimate and state.load:
            with record.timing("error estimate"):
                state = _estimate(record, state, loader)
        _describe(record, state, loader, self.job.scene.tire.shape.land)
        record.headline |= friction_headline(state, self.job.scene.static.friction)
        record.notes += self._from_file()
        self._warn_at_rest(record)
        console.say(f"  {record.shares}")
        return state

    def _solved(
        self, record: Record, speed: float, history: SolutionHistory, initial: InitialState | None
    ) -> tuple[StaticState, LoadStepper, InitialState]:
        """Solve up to the state at `speed` rad/s: in load steps, or from a state `near`, that of
        another speed. Collective."""
        rolling = steady_rolling(self.job, speed)
        with record.timing("mesh and forms"):
            if self.job.scene.modal:
                begin_forms(self.job.tire.body)
            equilibrium = Equilibrium(self.job.tire.body, rolling, road_shape(self.job.scene))
        equilibrium.history = history
        loader = LoadStepper(equilibrium, _show)
        began = Timing.clock()
        try:
            pressed = self._press(loader, rolling, initial)
        except ConvergenceError as error:
            journal = self._keep_last(loader)
            cause = with_cause(error, loader, rolling, lambda other: self._press(other, rolling))
            raise ConvergenceError(f"{cause}{journal}") from None
        if pressed is not loader:
            equilibrium.cost.take(pressed.equilibrium.cost)
            loader.newton_steps = pressed.newton_steps
        spent = equilibrium.cost
        spent["other"] = Timing.clock() - began - sum(spent.values())
        record.cost.take(spent)  # at a travel speed that of each solution
        state = static_state(pressed.equilibrium, loader.touch)
        return state, loader, InitialState.of(loader, pressed)

    def _press(
        self, loader: LoadStepper, rolling: Rolling, initial: InitialState | None = None
    ) -> LoadStepper:
        """Inflate the tire and press it on the road; returns the final loader. Collective."""
        static = self.job.scene.static
        loader.inflate(self.job.scene.inflation, None if initial is None else initial.inflated)
        placed = static.load, static.deflection, static.road_height
        return place(loader, *placed, friction_of(self.job.scene, rolling), initial)

    def _keep_last(self, loader: LoadStepper) -> str:
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

    def begin(self) -> None:
        """Discard the matrices of an earlier state."""
        if self.forgets:
            forget_matrices()

    def end(self, key: str, product: StaticState) -> None:
        """Remove the last state of an earlier, failed run, and what resumes it. Collective."""
        on_root(self.job.comm, lambda: self.job.path("static_last").unlink(missing_ok=True))
        forget_checkpoint(self.job, self.name)

    def write(self, file, product: StaticState) -> None:
        """Mesh, displacement, outer face and footprint."""
        fill(file, product, self.job.tire)
        tire = self.job.scene.tire
        if tire.shape.fingerprint(tire) and (taken := self._from_file()):
            file.attrs["from_file"] = "\n".join(taken)

    def _from_file(self) -> list[str]:
        """The construction of the tire, of a file also the parts that are used and those that are not, as `check`
        prints it."""
        tire = self.job.scene.tire
        return tire.shape.described(tire)

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
            **read_cords(file),
            **read_friction(file),
        )


def _extent(attributes) -> Footprint:
    return Footprint(*(float(attributes[f"footprint_{name}"]) for name in _EXTENT))


def _estimate(record: Record, state: StaticState, loader: LoadStepper) -> StaticState:
    """Report the load error from finer elements; returns the state, their footprint. Collective."""
    if state.pull is not None:  # estimated without friction: the load's error is the same with it
        loader.equilibrium.solve(loader.equilibrium.road_height)
    error = load_error(loader, state.rolling)
    if isinstance(error, str):
        console.say(f"  error of the load unknown: {error}")
        return state
    whole = error.bulk is not None
    what = "estimated error of the load" + ("" if whole else " by the footprint's elements")
    record.indicators[what] = (100 * error.relative, "%")
    to = f"ever smaller elements: {error.load:.5g} N" if error.signed else "of unknown sign"
    rest = f"{100 * error.bulk:.2g} %" if whole else f"unknown: {UNKNOWN}"
    console.say(
        f"  {what} at this height of the road: {100 * error.relative:.2g} % ({to}); of "
        f"the footprint's elements {100 * error.footprint:.2g} %, of the rest {rest}; {error.unknowns} unknowns with finer elements there"
    )
    if error.relative > COARSE:
        record.warnings.append(
            f"the load may be off by {100 * error.relative:.2g} %: take smaller elements "
            "(tire.segments, tire.elements_arc, tire.footprint_size)"
        )
    for name in _EXTENT[:2]:
        size = getattr(state.footprint(), name)
        record.indicators[f"footprint {name} on the elements of the run"] = (size, "m")
    return state if state.pull is not None else replace(state, fine_extent=error.extent)


def _show(progress) -> None:
    step = progress.step
    console.say(
        f"  {progress.what} {progress.value:.6g} {progress.unit}: load {progress.load:.6g} N on "
        f"{progress.active} points, {step.iterations} Newton steps, residual {step.residual:.1e}"
        + ("" if step.reason == "converged" else f"; {step.reason}")
    )


def _describe(record: Record, state: StaticState, loader: LoadStepper, land: float) -> None:
    """Record the figures of the state; `land` is the share of the footprint that grooves leave."""
    free = 3 * len(state.displacement)
    record.headline["unknowns"] = (free, "-")
    record.headline |= cord_headline(state)
    if state.road_height is not None:
        extent = state.footprint()
        record.headline |= {
            "load": (state.load, "N"),
            "deflection": (state.deflection, "m"),
            "footprint length": (extent.length, "m"),
            "footprint width": (extent.width, "m"),
            "footprint area": (extent.area, "m2"),
            "contact points": (int((state.force > 0).sum()), "-"),
            "mean contact pressure": (extent.pressure(state.load), "Pa"),
            "largest contact pressure": (float(state.pressure.max()), "Pa"),
        }
        if land < 1:
            net = (extent.pressure(state.load) / land, "Pa")
            record.headline["mean contact pressure between grooves"] = net
        if (even := state.evenness()) is not None:
            record.headline |= {
                "footprint shape factor": (even.shape_factor, "-"),
                "pressure of the shoulders over that of the middle": (even.shoulder, "-"),
            }
        record.indicators["least contact force"] = (float(state.force.min()), "N")
        record.indicators["largest penetration"] = (state.penetration, "m")
    record.headline["rolling radius"] = (state.rolling_radius(), "m")
    record.indicators["Newton steps"] = (loader.newton_steps, "-")
