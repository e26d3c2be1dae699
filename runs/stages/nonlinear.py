"""Stage nonlinear: the reduced nonlinear force of the tire, trained on the road of the run.

`nonlinear.h5` is written once and read by whatever moves far.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.setup import ContactSetup
from tireroad.contact.training_roads import ERROR_PER_METRE, TrainingRoads, expected
from tireroad.fem.model import SmallMotions
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import ReducedForce, extra_loads, reduced_force
from tireroad.fem.nonlinear.road import contact_points
from tireroad.fem.nonlinear.training import Settings, Training, train_along
from tireroad.fem.static.state import StaticState
from tireroad.runs.files.store import attribute, dataset
from tireroad.runs.process import console
from tireroad.runs.stages.stage import MUMPS, Computed, Record, Result, Shared

BED = 1e9  # N/m3: springs of the tread while training, 10 MPa over 10 mm
SETTINGS = Settings()
# Error of the forces of a linear tire from which on motion.kind = "auto" takes large motions.
LIMIT = 0.03


@dataclass(frozen=True)
class Nonlinear:
    """A training as it is stored; arrays over all nodes n of the lattice, k vectors and c cells.

    `shape` V and `load` K V (n, 3, k): the tire is the linear one with the loads -K V s. `weight` (c,) of the
    `cells`, by their numbers in the mesh; `road` (r,) trained, the shares that V `lacked` and `left` (r,)
    of its states, and `how` (r,) they were found. `states`, half-turned copies included; largest share `outside` V of
    them; relative `error` of the weighted cells.
    """

    shape: np.ndarray = dataset("m J^-1/2")
    load: np.ndarray = dataset("N J^-1/2")
    cells: np.ndarray = dataset("-")
    weight: np.ndarray = dataset("-")
    singular: np.ndarray = dataset("-")
    road: np.ndarray = dataset("-")
    how: np.ndarray = dataset("-")
    lacked: np.ndarray = dataset("-")
    left: np.ndarray = dataset("-")
    states: int = attribute()
    outside: float = attribute()
    error: float = attribute()

    def force(self, restoring: RestoringForce) -> ReducedForce:
        """The reduced force of the tire that was trained, on any number of processes. Collective."""
        return reduced_force(restoring, self.on_unknowns(restoring), self.cells, self.weight)

    def on_unknowns(self, restoring: RestoringForce) -> np.ndarray:
        """V (n, k) on this process's own unknowns."""
        return restoring.operators.restrict(self.shape[restoring.body.ids])


def stored(training: Training, restoring: RestoringForce) -> Nonlinear:
    """The stored part of a training, on every process. Collective."""
    everywhere, spread = restoring.body.everywhere, restoring.operators.spread
    record = training.record
    return Nonlinear(
        shape=everywhere(spread(training.vectors)),
        load=everywhere(spread(extra_loads(restoring, training.vectors))),
        cells=training.force.cells,
        weight=training.force.weights,
        singular=training.singular,
        road=np.array([one.road for one in record], dtype=object),
        how=np.array([one.how for one in record], dtype=object),
        lacked=np.array([one.lacked for one in record]),
        left=np.array([one.left for one in record]),
        states=training.states,
        outside=training.left,
        error=training.error,
    )


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


@dataclass(frozen=True, kw_only=True)
class NonlinearStage(Computed[Nonlinear]):
    """The training, on rises and on what the road has under the footprint."""

    name: ClassVar[str] = "nonlinear"
    kind: ClassVar[type] = Nonlinear
    static: Result[StaticState]
    setup: Result[ContactSetup]
    restoring: Result[RestoringForce]

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        return (
            f"Newton and Broyden on the reduced force, {MUMPS}; vectors lack at most {SETTINGS.kept:g}, weights of cells "
            f"off by at most {SETTINGS.tolerance:g}"
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
        console.say(f'nonlinear motion.kind = "auto" takes large motions: {told}')
        return None

    def inputs(self) -> dict[str, Any]:
        """Also the roads, by their heights."""
        roads = TrainingRoads.of(self.setup.product).smooth()
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(z).tobytes() for z in roads.trained))
        settings = asdict(SETTINGS) | {"bed": BED}
        road = [digest.hexdigest(), *roads.reach, len(roads.ways())]
        return super().inputs() | {"road": road, "settings": settings}

    def compute(self, record: Record) -> Nonlinear:
        """Train. Collective."""
        roads, restoring = TrainingRoads.of(self.setup.product).smooth(), self.restoring.product
        lattice, state = restoring.body.lattice, self.static.product
        length, width = roads.reach
        points = contact_points(
            lattice, state, BED, half_length=length, half_width=_within(lattice, width)
        )
        ways = roads.ways()
        console.say(f"  {len(roads.rises())} rises and up to {len(ways)} places of the road")
        given = restoring, points, roads.rises(), ways, roads.under
        with (
            record.timing("training"),
            console.ProgressBar(self.name, unit="roads") as bar,
            threadpool_limits(1, "blas"),
        ):

            def told(line: str) -> None:
                console.log(f"  {line}")
                bar.advance()

            training = train_along(*given, SETTINGS, told)
        _describe(record, training)
        return stored(training, restoring)


def _within(lattice: Any, width: float) -> float:
    """At most the half width (m) of the outer face."""
    return min(width, float(np.abs(lattice.points(lattice.face)[:, 1]).max()))


def _describe(record: Record, training: Training) -> None:
    """Record what was trained, what it leaves, and the roads that were not climbed to their height."""
    record.headline |= {
        "roads": (len(training.record), "-"),
        "trained states, half-turned copies too": (training.states, "-"),
        "vectors": (training.vectors.shape[1], "-"),
        "cells of the mesh": (len(training.force.cells), "-"),
        "largest motion of a state left out": (100 * training.left, "%"),
    }
    record.indicators |= {
        "error of the weighted cells": (100 * training.error, "%"),
        "tangents of Newton's method": (training.tangents, "-"),
        "evaluations of all cells": (training.evaluations, "-"),
    }
    short = [one for one in training.record if one.how.startswith("to ")]
    if short:
        record.warnings.append(
            f"{len(short)} of {len(training.record)} roads of the training were not climbed to their height (the first, "
            f"{short[0].road}, {short[0].how.split(':')[0]}): on flanks so steep points jump without inertia"
        )
