"""Record of the solutions on a load path, so that an interrupted path is retraced without solving.

The path is a function of the outcomes and states of its solutions. It is retraced from its start,
and each recorded solution is put in place. The solution after the last recorded one may use its
tangent, which is not stored; the last solution of each problem is therefore solved again, from
where it began.
"""

from __future__ import annotations

import hashlib
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.static.path.journal import Entry, Journal
from tireroad.fem.static.path.step import Step

if TYPE_CHECKING:
    from tireroad.fem.static.equilibrium import Equilibrium

_ROAD = "active", "force", "height"


class History:
    """Solutions of the equilibrium problems of one stage, in order; none without a `journal`."""

    def __init__(self, journal: Journal | None) -> None:
        self._journal = journal
        self._problems: list[weakref.ref[Equilibrium]] = []  # a past one may be freed
        self._predicted: list[bool] = []
        found = journal.found if journal else []
        last = {int(entry["problem"]): k for k, entry in enumerate(found)}
        self._again = set(last.values())

    def solve(self, problem: Equilibrium, solve: Callable[[], Step]) -> Step:
        """Result of `solve()`, with body and road left as it leaves them. Collective."""
        if self._journal is None:
            return solve()
        number, comm = self._number(problem), problem.body.comm
        place = self._journal.done
        entry = self._journal.next(comm, lambda one: _same_mesh(problem, one))
        predicted, self._predicted = self._predicted, []
        if entry is None:
            began = _state(problem, "begin")
            step = solve()
            found = began | _state(problem, "end") | _step(step)
            found |= {"problem": np.array(number), "mesh": _mesh(problem)}
            self._journal.add(found | {"predicted": np.array(predicted, dtype=bool)})
            return step
        if place in self._again:
            _put(problem, entry, "begin")
            return solve()
        _put(problem, entry, "end")
        return problem.solved(_read(entry))

    def predict(self, predict: Callable[[], bool]) -> bool:
        """Result of `predict()`, or the recorded one if the next solution is known. Collective."""
        if self._journal is None:
            return predict()
        if self._journal.done < len(self._journal.found):
            known = self._journal.found[self._journal.done]["predicted"]
            answer = bool(known[len(self._predicted)])
        else:
            answer = predict()
        self._predicted.append(answer)
        return answer

    def _number(self, problem: Equilibrium) -> int:
        for k, one in enumerate(self._problems):
            if one() is problem:
                return k
        self._problems.append(weakref.ref(problem))
        return len(self._problems) - 1


def _mesh(problem: Equilibrium) -> np.ndarray:
    """Hash of the lattice ids of this process's own nodes."""
    return np.frombuffer(hashlib.sha256(problem.body.ids.tobytes()).digest(), np.uint8)


def _same_mesh(problem: Equilibrium, entry: Entry) -> bool:
    return np.array_equal(_mesh(problem), entry["mesh"])


def _state(problem: Equilibrium, when: str) -> dict[str, np.ndarray]:
    kept = {name: np.array(one) for name, one in zip(_ROAD, problem.road.kept(), strict=True)}
    kept["field"] = problem.body.u.x.array.copy()
    return {f"{when}/{name}": value for name, value in kept.items()}


def _put(problem: Equilibrium, entry: Entry, when: str) -> None:
    problem.body.u.x.array[:] = entry[f"{when}/field"]
    active, force, height = (entry[f"{when}/{name}"] for name in _ROAD)
    problem.road.put_back((active.copy(), force.copy(), float(height)))


def _step(step: Step) -> dict[str, np.ndarray]:
    counted = np.array([step.converged, step.iterations, step.residual], dtype=float)
    return {"step": counted, "reason": np.frombuffer(step.reason.encode(), np.uint8)}


def _read(entry: Entry) -> Step:
    converged, iterations, residual = entry["step"]
    reason = bytes(entry["reason"]).decode()
    return Step(bool(converged), int(iterations), float(residual), reason)
