"""What outputs can read of a run: responses and forces of the driven points, contact history."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tireroad.fem.model import SmallMotions
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel, wheel_of
from tireroad.greens.outputs import by_free_rim
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.basis import ModalBasis
from tireroad.modal.standing import standing_modes
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.rolling import Integration, directions, histories, recursive
from tireroad.runs.stages.setup import driven_points
from tireroad.runs.stages.stage import Done, Job
from tireroad.runs.stages.turning import turning_of

Array = np.ndarray


@dataclass(frozen=True, kw_only=True)
class Driven:
    """The k points of the scene's [[force]] tables, and the contact, as outputs see them.

    `time` (nt,) s, None without [time]; `integration`: how prescribed forces were integrated, None
    with contact or without time integration; `history` of the contact, None without contact.
    """

    job: Job
    static: StaticState
    modes: Done[ModalBasis]
    wheel: Done[Wheel]
    greens: Done[Responses]
    time: Array | None = None
    integration: Integration | None = None
    history: ContactHistory | None = None

    @property
    def response(self) -> Response:
        """Displacement (3 k) per force (k) of the rotating tire, without the road."""
        return self.whole.between(slice(3 * len(self.job.scene.force)), slice(None))

    @property
    def whole(self) -> Response:
        """`response`, then the moments (3) on the axle: of a wheel that moves without contact only."""
        return self.greens.product.force

    def moments(self, frequency: Array) -> Array | None:
        """Moment (f, 3, k) m on the held axle per force at `frequency` (f,) Hz; None if unknown."""
        read = self.whole.between(slice(3 * len(self.job.scene.force), None), slice(None))
        return read.receptance(frequency) if len(read.residual) else None

    def of_contact(self, name: str) -> Array:
        """An array of contact.h5, e.g. "normal_force" (nt, c) N, on every process. Collective."""
        return self.job.read(self.job.path("contact"), lambda file: file[name][:])

    def points(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Loads (k, 3 s) of unit forces as directed, and readings (3 k, 3 s) of their points."""
        return driven_points(self.job)

    def by_free_rim(self, count: int, frequency: Array) -> tuple[Array, float]:
        """Force and moment (f, 6, k) of the tire on the held axle per unit force, by the free rim.

        From `count` modes of the same static state with its rim released; also returns the highest
        of them, Hz. Collective.
        """
        turning = turning_of(self.job)
        motions = SmallMotions(
            self.job.tire, self.static, rim="free", road=self.job.scene.modes.road
        )
        basis = standing_modes(motions, count=count, rotation=turning.speed != 0)
        wheel = wheel_of(motions, turning, projection=basis.projection)
        held = SmallMotions(self.job.tire, self.static)
        motion = held.rim_motion(turning.speed != 0)
        found = by_free_rim(wheel, basis.modes, self.points()[0], frequency, motion)
        return found, float(basis.frequency[-1])

    @property
    def drifts(self) -> bool:
        """Whether a constant force makes the tire drift: there is then no receptance at 0 Hz."""
        return self.job.scene.modes.rim == "free" or self.response.rigid > 0

    def force(self, order: int = 0) -> Array:
        """The prescribed forces (nt, k) N, or their time derivative of that order."""
        return histories(self.job.scene.force, self.time, order)

    def along(self, full: Array) -> Array:
        """Motion of each point along its own force, (n, k, k), from its components (n, 3 k, k)."""
        forces = self.job.scene.force
        components = full.reshape(len(full), len(forces), 3, len(forces))
        return np.einsum("frdk,rd->frk", components, directions(forces))

    def march(self, response: Response) -> Array:
        """Readings (nt, 3 k) of another response to prescribed forces, from rest. Collective."""
        taken = self.integration
        scheme = recursive(taken.scheme)
        tire = Recursion(response=response, step=taken.step, scheme=scheme, comm=self.job.comm)
        force = self.force()
        tire.start(force[0])
        out = [response.residual @ force[0]]
        for new in force[1:]:
            free = tire.predict()
            tire.advance(new)
            out.append(free + tire.same_step @ new)
        return np.stack(out)
