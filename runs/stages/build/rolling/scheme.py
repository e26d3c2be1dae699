"""The force's course within a step: as the scene says, or by what the contact's oscillation asks for."""

from __future__ import annotations

import math

from tireroad.contact.results.chatter import Chosen, choose, oscillation
from tireroad.contact.setup import ContactSetup
from tireroad.runs.process import observe
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.build.rolling.loop import bristles
from tireroad.runs.stages.build.rolling.stepping import Planned


def chosen_scheme(
    job: Job, record: Record, setup: ContactSetup, plan: Planned, begun: Chosen | None
) -> Chosen:
    """What to take, and why; shown, and kept in the record.

    `begun`: what was chosen for the checkpoint from which the loop goes on, or None.
    """
    wanted = job.scene.time.scheme
    spec, patch = job.scene.contact, setup.patch
    steps = oscillation(spec, patch, plan.response, plan.step, bristles(spec, patch))
    if math.isfinite(steps):
        record.indicators["steps in the fastest oscillation of the contact"] = (steps, "-")
    given = Chosen(wanted, f'time.scheme = "{wanted}"')
    return reported(record, begun or (choose(steps) if wanted == "auto" else given))


def reported(record: Record, chosen: Chosen) -> Chosen:
    """The choice, shown and kept in the record."""
    observe.say(f"  scheme {chosen.scheme}: {chosen.reason}")
    record.indicators["reason for the scheme"] = (chosen.reason, "-")
    return chosen
