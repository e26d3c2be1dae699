"""The trained nonlinear force of a tire, `nonlinear.h5`: written once, read by whatever moves far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import ReducedForce, extra_loads, reduced_force
from tireroad.fem.nonlinear.training import Training
from tireroad.runs.files.store import attribute, dataset


@dataclass(frozen=True)
class Nonlinear:
    """A training as it is stored; arrays over all nodes n of the lattice, k vectors and c cells.

    `shape` V and `load` K V (n, 3, k): the tire is the linear one with the loads -K V s. `weight` (c,) of the
    `cells`, by their numbers in the mesh; `road` (r,) trained, or run of the loop, the shares that V
    `lacked` and `left` (r,) of its states, and `how` (r,) they were found. `states`, half-turned copies included; largest share `outside` V of
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
