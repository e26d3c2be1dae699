"""What companion runs have in common: the run that they repeat in part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tireroad.contact.grid_patch import MOST, ratio
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.setup import ContactSetup
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.static.state import StaticState
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.stage import Done
from tireroad.runs.stages.build.rolling.loop import Forces, bristles, forces
from tireroad.runs.stages.build.wall import Normal


@dataclass(frozen=True, kw_only=True)
class Given:
    """The run that companions repeat in part.

    Its `job`, static state, patch and road (`setup`, not settled), response and rolling modes; the
    first `steps` of `step` s of its loop, integrated by `scheme`. `free_slip`: the slip of free
    rolling, already in `setup`; another setup of the scene needs it too. `most`: touching points
    that a companion may have (contact.grid_patch.ratio).
    """

    job: Job
    static: Done[StaticState]
    setup: ContactSetup
    response: Response
    rolling: RollingModes
    step: float
    steps: int
    scheme: str = "linear"
    free_slip: float = 0.0
    most: float = MOST

    @property
    def points_ratio(self) -> float:
        """Spacing of the points of their companion over the run's."""
        return ratio(self.settled.patch, self.most)

    @cached_property
    def settled(self) -> ContactSetup:
        """The setup with its patch in the static state."""
        return settled(self.job, self.setup, self.response, self.static.product.normal_force)

    @cached_property
    def longer(self) -> Forces:
        """The run repeated with twice its time step. Collective."""
        return self.repeated(self.settled, self.response, coarser=2)

    @cached_property
    def base(self) -> Forces | None:
        """Reference for the companions of points, modes and mesh: the run with twice the step.

        It halves their cost. None if the longer step drops a state or does not resolve the
        contact's oscillation although the run's own step does; the run itself is then the
        reference. Collective.
        """
        step, spec = 2 * self.step, self.job.scene.contact
        kept = self.response.resolved(step)
        if len(kept.every) < len(self.response.resolved(self.step).every):
            return None
        patch = self.settled.patch
        steps = oscillation(spec, patch, kept, step, bristles(spec, patch))
        if self.scheme == "linear" and choose(steps).scheme != "linear":
            return None
        try:
            return self.longer
        except (ConvergenceError, InputError):
            return None

    def first(self, steps: int) -> Given:
        """The same for fewer steps."""
        return self._keeping("settled", steps=steps)

    def of(self, job: Job) -> Given:
        """The same with another job; `base` stays that of the run."""
        return self._keeping("base", job=job)

    def _keeping(self, name: str, **changes: Any) -> Given:
        """The same with `changes`, and the cached property `name` as here."""
        other = replace(self, **changes)
        other.__dict__[name] = getattr(self, name)
        return other

    def repeated(
        self,
        setup: ContactSetup,
        response: Response,
        coarser: int | None = None,
        contact: Normal | None = None,
    ) -> Forces:
        """Repeat the loop with another setup (settled), response or `contact`.

        `coarser`: factor on the time step, by default that of `base`. Collective.
        """
        times = coarser or (1 if self.base is None else 2)
        step, steps = times * self.step, self.steps // times
        return forces(self.job, setup, response, step, steps, self.scheme, contact)


def settled(job: Job, setup: ContactSetup, response: Response, force: np.ndarray) -> ContactSetup:
    """The setup with its patch in the static state under the nodal forces (s,) N."""
    return setup.settled(response, force, job.scene.contact)[0]
