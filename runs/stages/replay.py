"""The whole tire under the forces of a loop, which its states take once more."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace

import h5py
import numpy as np
from scipy import linalg, sparse

from tireroad.contact.results.spectra import low_part
from tireroad.contact.setup import ContactSetup
from tireroad.fem.matrices.probe import between
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.mesh import NodeGrid
from tireroad.greens.basis import Basis
from tireroad.greens.recursion import marched
from tireroad.greens.response import couple
from tireroad.modal.corner import BODY, SEEN
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import opened
from tireroad.runs.stages.contact_file import INITIAL, ContactHistory
from tireroad.runs.stages.rolling import histories, of_given_forces, recursive
from tireroad.runs.stages.setup import components, probes
from tireroad.runs.stages.stage import Job

Array = np.ndarray
_ROWS = 1024  # steps taken at a time
_ROUNDING = 1e-10  # of squares: coordinates that move the face by less are those of the air


def driven_loads(job: Job, state: StaticState, setup: ContactSetup | None) -> sparse.csr_matrix:
    """The driven points (k, 3 s): the patch's nodes in all components, then prescribed forces."""
    loads = probes(job, state, setup).loads
    if setup is None:
        return loads
    patch = len(components(job)) * len(setup.patch.index)
    return loads[: patch + len(job.scene.force)]


@dataclass(frozen=True, kw_only=True)
class PatchForces:
    """The forces of the steps ending at `time` (n,) s, `step` s apart, integrated by `scheme`.

    They count from the static state, as the loop's do. `seen` (k, m) kg^-1/2: the coordinates'
    displacements at the driven points.
    """

    job: Job
    setup: ContactSetup | None
    time: np.ndarray
    step: float
    scheme: str
    seen: np.ndarray

    @staticmethod
    def of(
        job: Job, setup: ContactSetup | None, history: ContactHistory | None, seen: np.ndarray
    ) -> PatchForces:
        """From the file of the contact, or of the response to given forces. Root process only."""
        if history is not None:
            time, step, scheme = history.time, history.step, history.scheme
        else:
            with opened(job.path("response")) as file:
                time = file["time"][1:]  # the ends of the steps
            step, scheme = float(time[0]), of_given_forces(job.scene)
        return PatchForces(job=job, setup=setup, time=time, step=step, scheme=scheme, seen=seen)

    @property
    def always(self) -> np.ndarray:
        """Modal forces (m,) N kg^-1/2 of the state in which the loop begins: they have always been there."""
        if self.setup is None:
            return np.zeros(self.seen.shape[1])
        names = INITIAL, "initial_horizontal_force"
        with h5py.File(self.job.path("contact")) as file:
            if names[0] not in file:
                return np.zeros(self.seen.shape[1])
            columns = np.hstack(self._on_nodes(file, *(file[name][:][None] for name in names)))[0]
        return columns @ self.seen[: len(columns)]

    @property
    def sudden(self) -> np.ndarray:
        """Modal forces (m,) N kg^-1/2 that come at t = 0: the prescribed ones alone."""
        force = self.job.scene.force
        return histories(force, np.zeros(1))[0] @ self.seen[len(self.seen) - len(force) :]

    def pushes(self, start: int = 0) -> Iterator[np.ndarray]:
        """Modal forces (n, m) N kg^-1/2 from step `start` on, block by block. Root process only."""
        for first in range(start, count := len(self.time), _ROWS):
            yield self._force(slice(first, min(first + _ROWS, count))) @ self.seen

    def first(self, steps: int) -> PatchForces:
        """The forces of the first `steps` steps only."""
        return replace(self, time=self.time[:steps])

    def _force(self, some: slice) -> np.ndarray:
        """Forces (n, k) N in the order of the driven points."""
        prescribed = histories(self.job.scene.force, self.time[some])
        if self.setup is None:
            return prescribed
        with h5py.File(self.job.path("contact")) as file:
            horizontal = self.job.scene.horizontal_forces
            arguments = (
                file["normal_force"][some],
                file["horizontal_force"][some] if horizontal else None,
            )
            return np.hstack([*self._on_nodes(file, *arguments), prescribed])

    def _on_nodes(
        self, file: h5py.File, normal: np.ndarray, horizontal: np.ndarray | None
    ) -> list[np.ndarray]:
        """Changes (n, p) N of the forces on the nodes from the static state, in z and, if given, x and y.

        A static state with friction has horizontal forces of its own.
        """
        parts = [normal - file["static_force"][:]]
        if horizontal is not None:
            held = file.get("static_horizontal_force")
            begun = np.zeros(2) if held is None else held[:]
            parts += [(horizontal - begun)[:, :, k] for k in (0, 1)]
        weights = self.setup.patch.weights if self.setup else None
        return parts if weights is None else [(weights.T @ part.T).T for part in parts]


def replayed(basis: Basis, forces: PatchForces, numbers: Collection[int]) -> np.ndarray:
    """The coordinates (g, m) m kg^1/2 at the ends of the steps `numbers`, by the run's own scheme.

    The states are integrated once more under the forces of the run, which are known by now. Root
    process only.
    """
    values = np.empty((len(numbers), basis.coordinates))
    given = forces.pushes(), forces.always, forces.sudden, forces.step, forces.scheme
    number = filled = 0
    for moved in _taken(basis, *given):
        some = [k for k in range(len(moved)) if number + k in numbers]
        values[filled : filled + len(some)] = moved[some]
        filled, number = filled + len(some), number + len(moved)
    return values


def _taken(
    basis: Basis, pushes: Iterable[Array], always: Array, sudden: Array, step: float, scheme: str
) -> Iterator[Array]:
    """The coordinates (n, m) m kg^1/2 after each step under modal forces (n, m), block by block, of a tire on which `always`
    (m,) has acted and `sudden` (m,) acts from t = 0 on."""
    unit = np.eye(basis.coordinates)
    response = couple(basis.states, unit, unit, np.zeros((3, len(unit))))
    return marched(response, step, recursive(scheme), always + sudden, pushes, always)


@dataclass(frozen=True, kw_only=True)
class Vibrating:
    """A tire in a loop that error bars repeat, whose vibration is told in the coordinates of the run.

    `basis` of its states; `seen` (k, m) kg^-1/2: displacements at the nodes of its patch in all components, and at the job's
    prescribed forces; `since` s: from where on; `up_to` Hz: up to which lines; `into` (m', m): what of the m' coordinates of the run are
    its own, None if they are the same.
    """

    job: Job
    basis: Basis
    seen: Array
    since: float
    up_to: float
    into: Array | None = None

    def lines(self, change: Array, begun: Array, step: float, scheme: str) -> Array:
        """Fourier coefficients (f, m') m kg^1/2 of the coordinates of the run from 0 Hz on, as of contact.results.spectra.low_part.

        `change` (n, c) N of the forces on the nodes from the static state, after each step of `step` s; `begun` (c,) N: those that
        have always been there.
        """
        forced = len(self.job.scene.force)
        nodes, given = self.seen[: change.shape[1]], self.seen[len(self.seen) - forced :]
        time = step * np.arange(len(change) + 1)
        prescribed = histories(self.job.scene.force, time) @ given
        pushes = (
            change[first : first + _ROWS] @ nodes + prescribed[1:][first : first + _ROWS]
            for first in range(0, len(change), _ROWS)
        )
        return self._lines(
            _taken(self.basis, pushes, begun @ nodes, prescribed[0], step, scheme), step
        )

    def lines_of(self, forces: PatchForces, steps: int) -> Array:
        """The same of the first `steps` of the run itself. Root process only."""
        moved = replayed(self.basis, forces.first(steps), range(steps))
        return self._lines([moved], forces.step)

    def keeping_where(self, wanted: Callable[[Array], Array]) -> Vibrating:
        """The same of the states alone whose eigenvalues (1/s) are `wanted`."""
        states = self.basis.states
        few = states.among(wanted(states.eigenvalue))
        return replace(self, basis=replace(self.basis, states=few))

    def of_combinations(
        self, rolling: RollingModes, turn: Array, loads: sparse.csr_matrix
    ) -> Vibrating:
        """The same of `rolling` modes that are combinations (m, m') of its own and perhaps more, and read the `loads` alone."""
        own, part = self.basis.projection, rolling.basis.projection
        seen = part.seen(rolling.basis.shape, loads)[: len(self.seen)]
        into = own.containing(part, turn[: own.own])
        return replace(self, basis=Basis.of(rolling), seen=seen, into=into)

    def _lines(self, moved: Iterable[Array], step: float) -> Array:
        after = np.concatenate(list(moved))[round(self.since / step) :]
        lines = low_part(after - after.mean(axis=0), len(after) * step, self.up_to)
        return lines if self.into is None else lines @ self.into.T


def wheel_motion(basis: Basis) -> Array:
    """Motion (6, m) of the wheel in m and rad per coordinate, (0, m) of a wheel that is held."""
    if not basis.projection.moves:
        return np.zeros((0, basis.coordinates))
    beside = sparse.identity(SEEN, format="csr")[:BODY]
    face = sparse.csr_matrix((BODY, len(basis.shape)))
    return basis.seen(sparse.hstack([face, beside], format="csr"))


def on_other_mesh(basis: Basis, lattice: NodeGrid, other: Basis, coarser: NodeGrid) -> Array:
    """Coordinates (m', m) of a basis per coordinate of an `other` one on another mesh: what moves the outer face, and a wheel
    that moves, most alike in the least squares."""
    weights, nodes = between(coarser, lattice), len(lattice.face)
    moved = other.face(weights.shape[1]).reshape(weights.shape[1], -1)
    carried = np.vstack([(weights @ moved).reshape(3 * nodes, -1), wheel_motion(other)])
    own = np.vstack([basis.face(nodes), wheel_motion(basis)])
    found: Array = linalg.lstsq(own.T @ own, own.T @ carried, _ROUNDING, lapack_driver="gelsy")[0]
    return found
