"""static: inflate the tire, press it on the road."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages import cords_file
from tireroad.runs.stages.session import Session

COARSE = 0.02  # estimated error of the load above which the user is warned


def inputs(session: Session) -> dict:
    """The tire without its air, the static loads, and the rolling terms where they take part."""
    scene = session.scene
    return {
        "tire": {k: v for k, v in asdict(scene.tire).items() if k != "cavity"},
        "static": asdict(scene.static),
        "rolling": session.rolling,
    }


def compute(session: Session, path: Path) -> None:
    """Solve and store. Collective."""
    from tireroad.fem.static.equilibrium import Equilibrium
    from tireroad.fem.static.loading import Loader
    from tireroad.fem.static.state import static_state
    from tireroad.fem.static.virtual_work import Rolling

    record, wanted = session.record, session.scene.static
    with record.timing("mesh and forms"):
        equilibrium = Equilibrium(session.body, Rolling(*session.rolling))
    loader = Loader(equilibrium, _show)
    began = time.perf_counter()
    last = path.with_name("static_last.h5")
    try:
        loader.inflate(wanted.inflation)
        _place(loader, wanted)
    except ConvergenceError as error:
        session.static = static_state(equilibrium, loader.lowest())
        session.write(last, "static", lambda file: _fill(file, session, equilibrium))
        raise ConvergenceError(f"{error} The last state that converged is in {last}.") from None
    record.cost |= equilibrium.cost
    record.cost["other"] = time.perf_counter() - began - sum(equilibrium.cost.values())
    session.static = static_state(equilibrium, loader.touch)
    _describe(session, loader)
    if wanted.error_estimate and session.static.load:
        with record.timing("error estimate"):
            _estimate(session, loader)
    observe.say(f"  {_parts(record.cost)}")
    session.write(path, "static", lambda file: _fill(file, session, equilibrium))
    on_root(session.comm, lambda: last.unlink(missing_ok=True))


def _place(loader, wanted) -> None:
    """Press the tire on the road. Collective."""
    if wanted.load is not None:
        loader.carry(wanted.load)
    elif wanted.deflection is not None:
        loader.deflect(wanted.deflection)
    elif wanted.road_height is not None:
        loader.deflect(wanted.road_height - loader.touch)


def _estimate(session: Session, loader) -> None:
    """Print and keep how far the load is from that of finer elements. Collective."""
    from tireroad.fem.static.load_error import load_error
    from tireroad.fem.static.virtual_work import Rolling

    found = load_error(loader, Rolling(*session.rolling))
    if isinstance(found, str):
        observe.say(f"  error of the load not estimated: {found}")
        return
    load = session.static.load
    session.record.indicators["estimated error of the load"] = (100 * found.relative, "%")
    observe.say(
        f"  estimated error of the load at this deflection: {100 * found.relative:.2g} %, from "
        f"{found.load:.6g} N on elements of twice the size ({found.unknowns} unknowns) against "
        f"{load:.6g} N"
    )
    if found.relative > COARSE:
        session.record.warnings.append(
            f"the load may be off by {100 * found.relative:.2g} %: take smaller elements "
            "(tire.segments, tire.elements_arc, tire.footprint_size)"
        )


def _parts(cost: dict[str, float]) -> str:
    """Seconds of each part, the largest first."""
    total = sum(cost.values()) or 1.0
    parts = sorted(cost.items(), key=lambda part: -part[1])
    return "time: " + ", ".join(f"{k} {v:.2g} s ({v / total:.0%})" for k, v in parts)


def _show(progress) -> None:
    step = progress.step
    observe.say(
        f"  {progress.what} {progress.value:.6g} {progress.unit}: load {progress.load:.6g} N on "
        f"{progress.active} points, {step.iterations} Newton steps, residual {step.residual:.1e}"
    )


def _describe(session: Session, loader) -> None:
    record, state = session.record, session.static
    free = 3 * len(state.displacement)
    record.headline["unknowns"] = (free, "-")
    record.headline |= cords_file.headline(state)
    if state.road_height is not None:
        extent = state.footprint()
        record.headline |= {
            "load": (state.load, "N"),
            "deflection": (state.road_height - state.touch_height, "m"),
            "footprint length": (extent.length, "m"),
            "footprint width": (extent.width, "m"),
            "footprint area": (extent.area, "m2"),
            "contact points": (int((state.force > 0).sum()), "-"),
        }
        record.indicators["least contact force"] = (float(state.force.min()), "N")
        record.indicators["largest penetration"] = (state.penetration, "m")
    record.headline["rolling radius"] = (state.rolling_radius(), "m")
    record.indicators["Newton steps"] = (loader.newton_steps, "-")
    if session.speed and not session.scene.static.steady_rolling:
        record.warnings.append(
            "the tire rolls on its state at rest (static.steady_rolling = false): centrifugal and "
            "damping forces of the rolling shape are left out of it"
        )


def _fill(file, session: Session, equilibrium) -> None:
    state, lattice = session.static, session.body.lattice
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
    cords_file.fill(file, state)
    file.attrs["touch_height"] = state.touch_height
    file.attrs["inflation"] = float(equilibrium.pressure.value)
    file.attrs["load"] = state.load
    file.attrs["rolling_radius"] = state.rolling_radius()
    if state.road_height is None:
        return
    near = np.flatnonzero(state.gap < session.section.thickness)
    force = np.zeros((len(near), 3))
    force[:, 2] = state.force[near]
    put(file, "contact/index", near, "-")
    put(file, "contact/points", state.positions[near], "m")
    put(file, "contact/force", force, "N")
    put(file, "contact/gap", state.gap[near], "m")
    put(file, "contact/area", state.area[near], "m2")
    put(file, "contact/pressure", state.pressure[near], "Pa")
    file.attrs["road_height"] = state.road_height
    file.attrs["deflection"] = state.road_height - state.touch_height
    for name, value in asdict(state.footprint()).items():
        file.attrs[f"footprint_{name}"] = value


def reuse(session: Session, path: Path) -> None:
    """Read the state back. Collective."""
    from tireroad.fem.static.state import StaticState

    def pick(file):
        surface = file["surface"]
        return StaticState(
            file["displacement"][:],
            surface["points"][:],
            surface["displacement"][:],
            surface["force"][:],
            surface["area"][:],
            surface["half_sizes"][:],
            surface["ring_rate"][:],
            shape=session.lattice.face_shape,
            touch_height=float(file.attrs["touch_height"]),
            road_height=float(file.attrs["road_height"]) if "road_height" in file.attrs else None,
            **cords_file.read(file),
        )

    session.static = session.read(path, pick)
