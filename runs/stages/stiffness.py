"""stiffness: load over deflection with the footprint at each, and the stiffness of the standing tire."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.scene.stiffness_table import deflections
from tireroad.runs.stages.session import Session

_CURVE = {
    "deflection": "m",
    "load": "N",
    "tangent": "N/m",
    "points": "-",
    "rolling_radius": "m",
    "pressure": "Pa",
}


def inputs(session: Session) -> dict:
    """The static state and its table."""
    return {
        "static": session.hashes["static"],
        "stiffness": asdict(session.scene.stiffness),
    }


def compute(session: Session, path: Path) -> None:
    """Find and store; the body is put back to the static state. Collective."""
    body = session.body
    kept = body.u.x.array.copy()
    matrix = None
    if _sticks(session):
        with session.record.timing("stuck footprint"):
            matrix = _at_the_load(session)
    try:
        curve, force = _curve(session)
        if matrix is None and session.scene.stiffness.which == "all":
            with session.record.timing("stuck footprint"):
                matrix = _at_last(session, curve[-1].load, force)
    finally:
        body.u.x.array[:] = kept
    _describe(session, curve, matrix)
    session.write(path, "stiffness", lambda file: _fill(file, session, curve, matrix))


def _sticks(session: Session) -> bool:
    """Whether the tangential stiffness is that of the scene's own state."""
    return session.scene.stiffness.which == "all" and session.static.road_height is not None


def _at_the_load(session: Session):
    """Stiffness of the footprint of the scene's static state. Collective."""
    face, force = session.body.surface, session.static.force
    nodes = face.local[force[face.place] > 0]
    return _stuck(session, nodes, force @ session.static.positions / force.sum())


def _at_last(session: Session, load: float, force: np.ndarray):
    """The same of the curve's last state, which the body is in, `force` N of its own nodes. Collective."""
    body = session.body
    places = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    moment = session.comm.allreduce(force @ places)
    return _stuck(session, np.flatnonzero(force > 0), moment / load)


def _stuck(session: Session, nodes: np.ndarray, centre: np.ndarray):
    from tireroad.fem.matrices.road_stiffness import road_stiffness
    from tireroad.fem.static.virtual_work import Rolling

    inflation = session.scene.static.inflation
    return road_stiffness(session.body, inflation, nodes, centre, Rolling(*session.rolling))


def _curve(session: Session):
    """The load-deflection curve, from the undeformed tire on, and the last forces. Collective."""
    from tireroad.fem.static.equilibrium import Equilibrium
    from tireroad.fem.static.load_curve import load_curve
    from tireroad.fem.static.loading import Loader
    from tireroad.fem.static.virtual_work import Rolling

    body, state, record = session.body, session.static, session.record
    body.u.x.array[:] = 0.0
    with record.timing("mesh and forms"):
        equilibrium = Equilibrium(body, Rolling(*session.rolling))
    loader = Loader(equilibrium, lambda progress: None)
    own = None if state.road_height is None else state.road_height - state.touch_height
    try:
        loader.inflate(session.scene.static.inflation)
        curve = load_curve(loader, deflections(session.scene.stiffness, own))
    except ConvergenceError as error:
        raise ConvergenceError(
            f"{error} It is the load-deflection curve that stops: give smaller stiffness.deflections, "
            "or a smaller stiffness.up_to (m)."
        ) from None
    record.cost |= equilibrium.cost
    record.indicators["Newton steps"] = (loader.newton_steps, "-")
    for point in curve:
        observe.say(
            f"  {1e3 * point.deflection:.4g} mm: {point.load:.5g} N, footprint "
            f" {1e3 * point.footprint.length:.3g} x {1e3 * point.footprint.width:.3g} mm"
        )
    return curve, equilibrium.contact_force()


def _slopes(curve) -> np.ndarray:
    """Slope of the curve at its points (k,), N/m."""
    from tireroad.fem.static.load_curve import slopes

    deflection = np.array([point.deflection for point in curve])
    return slopes(deflection, np.array([point.load for point in curve]), deflection)


def _vertical(session: Session, curve) -> tuple[float, float]:
    """(load, slope) at the scene's own state, a point of the curve too, or at the curve's last."""
    from tireroad.fem.static.load_curve import slopes

    state = session.static
    if state.road_height is None:
        return curve[-1].load, float(_slopes(curve)[-1])
    own = state.road_height - state.touch_height
    known = {point.deflection: point.load for point in curve} | {own: state.load}
    # Points closer than the curve's own steps would make waves of rounding.
    least = 0.05 * own
    apart = [d for d in sorted(known) if d == own or abs(d - own) > least]
    load = np.array([known[d] for d in apart])
    return state.load, float(slopes(np.array(apart), load, np.array([own]))[0])


def _describe(session: Session, curve, matrix) -> None:
    record = session.record
    load, vertical = _vertical(session, curve)
    record.headline |= {
        "deflections": (len(curve), "-"),
        "up to": (curve[-1].deflection, "m"),
        "load there": (curve[-1].load, "N"),
        f"vertical stiffness at {load:.4g} N": (vertical, "N/m"),
    }
    if matrix is None:
        return
    record.headline |= {
        "longitudinal": (matrix.longitudinal, "N/m"),
        "lateral": (matrix.lateral, "N/m"),
        "torsional": (matrix.torsional, "N m/rad"),
    }
    record.indicators["departure of the stiffness from symmetry"] = (matrix.asymmetry, "-")
    tilt = np.diag(matrix.matrix)[3:5]
    if tilt.min() < 1e-6 * tilt.max():
        record.warnings.append(
            "all nodes in contact lie on one line: the stiffness of the stuck footprint is that of a "
            "mesh too coarse for it; refine tire.elements_arc, tire.segments or tire.footprint_size"
        )


def _fill(file, session: Session, curve, matrix) -> None:
    for name, unit in _CURVE.items():
        put(file, f"curve/{name}", np.array([getattr(point, name) for point in curve]), unit)
    put(file, "curve/stiffness", _slopes(curve), "N/m")
    for name, unit in (("length", "m"), ("width", "m"), ("area", "m2")):
        values = np.array([getattr(point.footprint, name) for point in curve])
        put(file, f"curve/footprint_{name}", values, unit)
    load, vertical = _vertical(session, curve)
    put(file, "load", np.array(load), "N")
    put(file, "vertical", np.array(vertical), "N/m")
    if matrix is None:
        return
    put(file, "longitudinal", np.array(matrix.longitudinal), "N/m")
    put(file, "lateral", np.array(matrix.lateral), "N/m")
    put(file, "torsional", np.array(matrix.torsional), "N m/rad")
    put(file, "vertical_tangent", np.array(matrix.frictionless), "N/m")
    put(file, "vertical_stuck", np.array(matrix.matrix[2, 2]), "N/m")
    put(file, "matrix", matrix.matrix, "N/m, N/rad, N m/m, N m/rad")


def reuse(session: Session, path: Path) -> None:
    """No later stage needs it."""
