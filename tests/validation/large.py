"""Slow large motions: the linear tire and the reduced nonlinear one against Newton's method on the elements."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import solve_all
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.quasi_static import Elements, Linear, Reduced, Standing, climb
from tireroad.fem.nonlinear.reduced import at_nodes
from tireroad.fem.nonlinear.road import Feature, contact_points
from tireroad.fem.nonlinear.training import Settings, Training, train
from tireroad.fem.static.press import press
from tireroad.runs.library import radial
from tireroad.runs.process import console
from tireroad.runs.validation.full_elements import digits, percent
from tireroad.runs.validation.tables import Table

ABOUT = "slow rises, bars and holes of centimetres: linear and reduced nonlinear tire against the elements"

INFLATION, BED = 2.2e5, 1e9  # Pa; N/m3 of the tread's springs: 10 MPa over 10 mm
SEGMENTS, ACROSS, FINER = 16, 8, 12  # elements around; across; across the finer mesh
LOADS = (4000.0, 2000.0, 6000.0)  # N

NAMES = "linear, place at rest", "linear, moved place", "reduced"
_TIMES, _RISES, _NONE = 100, (5e-3, 15e-3), 1e-3


def bar(height: float, length: float, position: float, ramp: float) -> Feature:
    """A bar across the road, mm."""
    return Feature(
        height=1e-3 * height, length=1e-3 * length, position=1e-3 * position, ramp=1e-3 * ramp
    )


def edge(position: float) -> Feature:
    """The edge of a hole 30 mm deep and 300 mm long, which begins at a place in mm."""
    return bar(-30, 300, position + 150, 20)


TRAINED = (
    Feature(rise=25e-3),
    Feature(rise=-12e-3),
    *(bar(10, 20, place, 10) for place in (0, 20, 40, 60, 80, 100)),
    *(bar(25, 50, place, 25) for place in (0, 30, 60, 90)),
    *(bar(15, 50, place, 15) for place in (15, 45, 75)),
    *(edge(place) for place in (-60, -30, 0, 30, 60)),
)
# Other heights and places than those trained, on either side.
TESTED = (
    *(Feature(rise=1e-3 * rise) for rise in (1, 5, 15, 25, -5)),
    *(bar(10, 20, place, 10) for place in (0, 10, 50, -70)),
    *(bar(15, 50, place, 15) for place in (0, 30, -80)),
    *(bar(25, 50, place, 25) for place in (15, -45)),
    *(edge(place) for place in (-45, 15)),
)


class Study:
    """The built-in tire pressed on the road, and its points on springs."""

    def __init__(self, load: float, across: int = ACROSS) -> None:
        tire = radial(segments=SEGMENTS, elements_arc=across, comm=MPI.COMM_SELF)
        state = press(tire, inflation=INFLATION, load=load)
        self.deflection = state.deflection or 0.0
        self.force = RestoringForce(Operators(tire.body, INFLATION), INFLATION)
        self.points = contact_points(tire.lattice, state, BED)
        self.elements = Elements(self.force, self.points)

    def respond(self) -> None:
        """Form the linear tire's response to forces at the points."""
        self.shapes = solve_all(self.force.operators.stiffness, self.elements.columns)
        self.compliance = self.elements.seen(self.shapes)

    def reduced(self, training: Training) -> Reduced:
        """The tire with the trained force, over its kept cells."""
        force = training.force
        kept = at_nodes(self.force, self.shapes, force.nodes)
        return Reduced(
            self.points,
            self.compliance,
            self.elements.seen(training.vectors),
            lambda load, s: force.evaluate(kept @ load - force.vectors @ s),
        )

    def exact(self, road: Feature, near: np.ndarray | None) -> Standing:
        """The elements' state, from a motion near it or in steps of 2 mm."""
        if near is not None:
            with suppress(ConvergenceError):
                return self.elements.standing(self.elements.solve(road, near, 15), road)
        steps = max(round(max(abs(road.rise), abs(road.height)) / 2e-3), 1)
        motion = climb(self.elements, road, np.zeros(len(self.force.at_rest)), steps)
        return self.elements.standing(motion, road)


@dataclass(frozen=True)
class Found:
    """A road with the elements' state, and by name those of the other tires; None where one was not found."""

    road: Feature
    exact: Standing | None
    others: dict[str, Standing | None]


def compared(study: Study, training: Training, roads: Sequence[Feature]) -> Iterator[Found]:
    """The roads under all tires."""
    reduced = study.reduced(training)
    linear = (Linear(study.points, study.compliance, moved) for moved in (False, True))
    tires: list[Linear | Reduced] = [*linear, reduced]
    for road in roads:
        found = {name: _climbed(tire, road) for name, tire in zip(NAMES, tires, strict=True)}
        best, near, exact = found["reduced"], None, None
        if best is not None:
            near = study.shapes @ best.load - training.vectors @ best.s
        with suppress(ConvergenceError):
            exact = study.exact(road, near)
        yield Found(road, exact, found)


def _climbed(tire: Linear | Reduced, road: Feature) -> Standing | None:
    steps = max(round(max(abs(road.rise), abs(road.height)) / 3e-3), 1)
    with suppress(ConvergenceError):
        return climb(tire, road, tire.rest(), steps)
    return None


def rows(load: float, all_found: Sequence[Found]) -> list[list]:
    """Forces of the elements, and errors of each tire in % of the largest force of that kind of road."""
    largest: dict[str, np.ndarray] = {}
    for one in all_found:
        if one.exact is not None:
            kind, size = _kind(one.road), np.abs(one.exact.total())
            largest[kind] = np.maximum(largest.get(kind, 0.0), size)
    out = []
    for one in all_found:
        row = [load, str(one.road)]
        if one.exact is None:
            out.append([*row, *[""] * (2 + 3 * len(NAMES))])
            continue
        true, top = one.exact.total(), largest[_kind(one.road)]
        row += [digits(true[2]), digits(true[0])]
        for name in NAMES:
            other = one.others[name]
            if other is None:
                row += [""] * 3
                continue
            off = other.total() - true
            along = percent(off[0] / top[0]) if top[0] > _NONE * top[2] else ""
            change = float(np.linalg.norm(one.exact.load))
            row += [percent(off[2] / top[2]), along]
            row.append(percent(float(np.linalg.norm(other.load - one.exact.load)) / change))
        out.append(row)
    return out


def _kind(road: Feature) -> str:
    """Roads whose largest force errors are related to: the same bar at all places, one rise."""
    return f"{road.height}, {road.length}" if road.height else f"{road.rise}"


def run() -> list[Table]:
    """Tables of all loads, of the trainings, and of two meshes."""
    found, trainings = [], []
    with threadpool_limits(1, "blas"):
        for load in LOADS:
            study = Study(load)
            began = time.process_time()
            training = train(study.force, study.points, TRAINED, Settings(), console.say)
            seconds = time.process_time() - began
            study.respond()
            found += rows(load, list(compared(study, training, TESTED)))
            force = training.force
            began = time.process_time()
            for _ in range(_TIMES):
                force.evaluate(np.zeros(len(force.vectors)))
            evaluation = 1e3 * (time.process_time() - began) / _TIMES
            trainings.append([
                load, 1e3 * study.deflection, len(training.record), training.states, training.tangents,
                training.vectors.shape[1], len(force.cells), percent(training.left), percent(training.error),
                digits(evaluation), digits(seconds),
            ])  # fmt: skip
    columns = [
        ("load", "N"),
        ("road", ""),
        ("vertical force, elements", "N"),
        ("longitudinal", "N"),
    ]
    for name in NAMES:
        columns += [
            (f"{name}: vertical off", "%"), ("longitudinal off", "%"), ("forces of the points off", "%")
        ]  # fmt: skip
    notes = [
        f"205/60 R15 on {SEGMENTS} x {ACROSS} elements, 2.2 bar, standing, no friction; forces: change "
        "since the static state. All tires have the dynamic moduli, the same points (8 x 15 mm) and the same springs of "
        "1e9 N/m3. Off: of the force, in % of the rise's force, or of the largest force of the elements over this bar or hole; of the "
        "points, L2 over that of their change. Empty: no state found.",
    ]
    about = [("load", "N"), ("deflection", "mm"), ("roads", "-"), ("states, with copies", "-"), ("tangents", "-"),
             ("vectors", "-"), ("cells", "-"), ("largest share outside", "%"), ("error of the weights", "%"),
             ("evaluation", "ms"), ("training", "CPU s")]  # fmt: skip
    return [
        Table("Slow large motions", columns, found, notes),
        Table("Trainings of the reduced force", about, trainings, []),
        _meshes(),
    ]


def _meshes() -> Table:
    """The elements' own error: rises on two meshes, beside the linear tire's error."""
    values = []
    for across in (ACROSS, FINER):
        study = Study(LOADS[0], across)
        values.append([study.exact(Feature(rise=rise), None).total()[2] for rise in _RISES])
    lines = [
        [1e3 * rise, digits(coarse), digits(fine), percent(coarse / fine - 1)]
        for rise, coarse, fine in zip(_RISES, *values, strict=True)
    ]
    columns = [
        ("rise", "mm"),
        ("8 elements across", "N"),
        ("12 elements across", "N"),
        ("off", "%"),
    ]
    return Table("Rises on two meshes", columns, lines, [f"Newton's method, {LOADS[0]:g} N."])
