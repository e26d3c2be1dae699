"""What a run shows to its outputs: responses and forces of the driven points, and the history of the contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tireroad.fem.model import SmallMotions
from tireroad.fem.static.state import StaticState
from tireroad.greens.axle import by_free_rim
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.small_motions import wheel_of
from tireroad.modal.basis import ModalBasis
from tireroad.modal.standing import standing_modes
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.stage import Done
from tireroad.runs.stages.build.point_forces import directions, histories
from tireroad.runs.stages.build.rolling.stepping import Integration
from tireroad.runs.stages.build.setup import driven_points
from tireroad.runs.stages.build.turning import turning_of
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.stored.contact_file import ContactHistory

Array = np.ndarray


@dataclass(frozen=True, kw_only=True)
class Driven:
    """The points of the scene's [[force]]s, k of them, and the contact, as every kind of output sees them.

    `time` (nt,) s, None of a scene without [time]; `integration`: how given forces were integrated, None where
    contact or nothing was; `history` of the contact, None of a scene without.
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
        """Displacement (3 k) per force (k) of the tire as it turns, without the road."""
        return self.whole.between(slice(3 * len(self.job.scene.force)), slice(None))

    @property
    def whole(self) -> Response:
        """The same, and where the axle is held and its force wanted, the moments (3) on it after the displacements."""
        return self.greens.product.force

    def moments(self, frequency: Array) -> Array | None:
        """Moment (f, 3, k) m on the held axle per given force, at `frequency` (f,) Hz; None where it is not known."""
        read = self.whole.between(slice(3 * len(self.job.scene.force), None), slice(None))
        return read.receptance(frequency) if len(read.residual) else None

    def of_contact(self, name: str) -> Array:
        """An array of contact.h5 by its name, e.g. "normal_force" (nt, c) N, on every process. Collective."""
        return self.job.read(self.job.path("contact"), lambda file: file[name][:])

    def points(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Loads (k, 3 s) of unit forces along the given ones, and readings (3 k, 3 s) of their points."""
        return driven_points(self.job)

    def by_free_rim(self, count: int, frequency: Array) -> tuple[Array, float]:
        """Force and moment (f, 6, k) of the tire on the held axle per given force, by `count` modes of the same static
        state with its rim let go; the highest of them, Hz. Collective."""
        turning = turning_of(self.job)
        motions = SmallMotions(
            self.job.tire, self.static, rim="free", road=self.job.scene.modal.road
        )
        basis = standing_modes(motions, count=count, rotation=turning.speed != 0)
        wheel = wheel_of(motions, turning, projection=basis.projection)
        held = SmallMotions(self.job.tire, self.static)
        motion = held.rim_motion(turning.speed != 0)
        found = by_free_rim(wheel, basis.modes, self.points()[0], frequency, motion)
        return found, float(basis.frequency[-1])

    @property
    def drifts(self) -> bool:
        """Whether a constant force moves the tire ever further: it has no receptance at 0 Hz then."""
        return self.job.scene.modal.rim == "free" or self.response.rigid > 0

    def force(self, order: int = 0) -> Array:
        """The given forces (nt, k) N, or their derivative in time of that order."""
        return histories(self.job.scene.force, self.time, order)

    def along(self, full: Array) -> Array:
        """Each point's motion along its own force, (n, k, k), from its components (n, 3 k, k)."""
        forces = self.job.scene.force
        components = full.reshape(len(full), len(forces), 3, len(forces))
        return np.einsum("frdk,rd->frk", components, directions(forces))

    def march(self, response: Response) -> Array:
        """Readings (nt, 3 k) of another response under the given forces, from rest. Collective."""
        taken = self.integration
        scheme = "linear" if taken.scheme == "convolution" else taken.scheme
        tire = Recursion(response=response, step=taken.step, scheme=scheme, comm=self.job.comm)
        force = self.force()
        tire.start(force[0])
        out = [response.residual @ force[0]]
        for new in force[1:]:
            free = tire.predict()
            tire.advance(new)
            out.append(free + tire.same_step @ new)
        return np.stack(out)
