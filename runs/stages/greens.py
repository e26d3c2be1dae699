"""greens: responses between the driven points, and between the points of the contact patch."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
from scipy import sparse

from tireroad.contact.grid_patch import make_grid_patch
from tireroad.contact.patch import Patch, make_patch
from tireroad.contact.roads.motion import make_motion
from tireroad.contact.roads.road import make_road
from tireroad.greens.response import Response
from tireroad.modal.rotating import standing
from tireroad.runs.files.store import put
from tireroad.runs.scene.cavity_table import has_air
from tireroad.runs.stages import cavity
from tireroad.runs.stages.responses import chosen, fill_response, judge, make, read_responses
from tireroad.runs.stages.session import Session
from tireroad.runs.stages.stepping import run_time

# What the tire may give way beyond the road's own height, m: the smallest reach of the patch.
_MARGIN = 5e-3


def inputs(session: Session) -> dict:
    """The state modes and what is driven; the road only through the reach of the patch."""
    scene = session.scene
    prepare(session)
    return {
        "modes": session.hashes.get("rotating", session.hashes["modes"]),
        "damping": repr(session.damping),
        "greens": asdict(scene.greens),
        "forces": [asdict(force) for force in scene.force],
        "points": session.patch.index.tolist() if scene.contact else [],
        "pitch": scene.contact.points if scene.contact else None,
        "components": _components(session) if scene.contact else (),
    }


def _components(session: Session) -> tuple[int, ...]:
    """Directions of the contact forces: z, and with a brush x and y after it."""
    return (2,) if session.scene.contact.brush_stiffness is None else (2, 0, 1)


def prepare(session: Session) -> None:
    """The road, the patch and the probes: cheap, and made in every run."""
    scene = session.scene
    if session.speed == 0 and not has_air(scene):
        session.state_modes = standing(session.modal.projection, session.damping)
    if scene.contact:
        _prepare_contact(session)
    if scene.force:
        _prepare_forces(session)


def _prepare_contact(session: Session) -> None:
    scene, state = session.scene, session.static
    given = scene.rotation.rolling_radius if scene.rotation else None
    session.road_speed = session.speed * (given or state.rolling_radius())
    motion = scene.road.motion
    session.motion = make_motion(motion.kind, motion.amplitude, motion.frequency, motion.duration)
    session.travel = session.road_speed * run_time(scene.time)
    road = make_road(scene.road)
    session.reach = scene.contact.reach or _reach(session, road)
    session.patch = _points(session)
    session.road = _under(session, road, session.patch)


def _patch(session: Session, reach: float) -> Patch:
    state = session.static
    return make_patch(state.positions, state.half_sizes, state.force, state.gap, state.shape, reach)


def _points(session: Session) -> Patch:
    """The patch of the scene's points: the nodes, or a grid among them."""
    nodes, wanted = _patch(session, session.reach), session.scene.contact.points
    if wanted == "nodes":
        return nodes
    from tireroad.fem.static.tread_surface import TreadSurface

    state = session.static
    surface = TreadSurface(session.lattice, state.positions)
    spacing = wanted.dx, wanted.dy
    return make_grid_patch(surface, state.road_height, nodes, spacing, session.reach)


def _under(session: Session, road, patch: Patch):
    """The strip of road that the patch drives over in this run."""
    x0, x1, y0, y1 = patch.extent
    return road.prepare(x1, x1 + session.travel, y0, y1)


def _reach(session: Session, road) -> float:
    """Static gap up to which a point can touch: the road's highest spot, its motion, a margin.

    The highest spot depends on the strip, the strip on the patch: two rounds settle it.
    """
    motion = session.scene.road.motion
    lift = abs(motion.amplitude) if motion.kind != "none" else 0.0
    reach = lift + _MARGIN
    for _ in range(2):
        patch = _patch(session, reach)
        strip = _under(session, road, patch)
        x0, x1, y0, y1 = patch.extent
        highest = max(strip.highest(x0, x1 + session.travel, y0, y1), 0.0)
        reach = 1.5 * (highest + lift) + _MARGIN
    return reach


def _prepare_forces(session: Session) -> None:
    from tireroad.fem.matrices import probe

    lattice = session.lattice
    loads, readings = [], []
    for force in session.scene.force:
        angles = np.radians([force.angle, force.arc])
        spread = tuple(np.radians(force.spread))
        loads.append(probe.directed(probe.spot(lattice, *angles, spread), force.direction))
        here = probe.spot(lattice, *angles)
        readings += [probe.directed(here, axis) for axis in np.eye(3)]
    session.loads = sparse.csr_matrix(np.stack(loads))
    session.readings = sparse.csr_matrix(np.stack(readings))


def compute(session: Session, path: Path) -> None:
    """Responses with their residual, the choice of dynamic states, and their file. Collective."""
    if _stands_with_air(session):
        with session.record.timing("states with air"):
            projection = session.modal.projection
            session.state_modes = session.wheel.decouple(projection, session.comm)
        cavity.describe(session)
    name, outputs, loads = probes(session)
    whole = make(session, outputs, loads)
    responses = {name: chosen(session, whole)}
    judge(session, name, whole, responses[name])
    if name == "contact" and session.scene.force:
        responses |= _apart(session, responses[name])
    _take(session, responses)
    _describe(session, responses)

    def fill(file) -> None:
        for name, response in responses.items():
            fill_response(file, name, response)
        if _stands_with_air(session):
            cavity.fill_states(file, session)
        if session.scene.contact:
            put(file, "contact/index", session.patch.index, "-")

    session.write(path, "greens", fill)


def _stands_with_air(session: Session) -> bool:
    """Whether the states are found here: those of a standing tire alone have a closed formula."""
    return session.speed == 0 and has_air(session.scene)


def probes(session: Session) -> tuple:
    """(name, outputs, loads) on the outer face: of the contact patch with what prescribed forces add
    to it, or of the prescribed forces alone."""
    from tireroad.fem.matrices.probe import nodes

    if not session.scene.contact:
        return "force", session.readings, session.loads
    count = len(session.static.points)
    parts = [nodes(session.patch.index, count, part) for part in _components(session)]
    if session.scene.force:
        parts += [session.loads, session.readings]
    points = sparse.vstack(parts, format="csr")
    return "contact", points, points


def _apart(session: Session, whole: Response) -> dict[str, Response]:
    """The contact's response, the prescribed forces among its inputs (contact.driven), and theirs."""
    count = len(_components(session)) * len(session.patch.index)
    inputs = count + len(session.scene.force)
    return {
        "contact": whole.between(slice(None), slice(inputs)),
        "force": whole.between(slice(inputs, None), slice(count, inputs)),
    }


def _take(session: Session, responses: dict[str, Response]) -> None:
    if "contact" in responses:
        session.contact_response = responses["contact"]
    if "force" in responses:
        session.force_response = responses["force"]


def _describe(session: Session, responses: dict[str, Response]) -> None:
    record = session.record
    record.headline["residual flexibility"] = (session.scene.greens.residual, "-")
    if session.scene.contact:
        response = session.contact_response
        record.headline |= {
            "contact points": (len(session.patch.points), "-"),
            "nodes that carry them": (len(session.patch.index), "-"),
            "reach of the patch": (session.reach, "m"),
            "rolling speed": (session.road_speed, "m/s"),
        }
        _share_of_residual(record, "contact points", response)
    if session.scene.force:
        record.headline["driven points"] = (len(session.scene.force), "-")
    for name, response in responses.items():
        states = len(response.eigenvalue) + len(response.block)
        record.headline[f"states, {name}"] = (states, "-")


def _share_of_residual(record, where: str, response: Response) -> None:
    """How much of the static flexibility the modes lack: the truncation, were it not for the residual."""
    diagonal = np.diag(response.residual)
    total = diagonal + np.diag(response.static())
    record.indicators[f"share of the residual in the static flexibility of the {where}"] = (
        float((diagonal / total).max()),
        "-",
    )


def reuse(session: Session, path: Path) -> None:
    """Read the responses back. Collective."""
    if _stands_with_air(session):
        session.state_modes = session.read(path, cavity.read_states)
    pulse = session.scene.greens.residual == "dirac"
    _take(session, session.read(path, lambda file: read_responses(file, pulse)))
