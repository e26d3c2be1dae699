"""The integration scheme: as the scene says, or as the contact's oscillation requires."""

from __future__ import annotations

import math

from tireroad.contact.results.chatter import Chosen, choose, oscillation
from tireroad.contact.setup import ContactSetup
from tireroad.runs.process import observe
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.build.rolling.loop import bristles
from tireroad.runs.stages.build.rolling.stepping import Planned


def chosen_scheme(
    job: Job, record: Record, setup: ContactSetup, plan: Planned, begun: Chosen | None
) -> Chosen:
    """The scheme and the reason for it; both are reported.

    `begun`: the choice stored in the checkpoint that the loop continues from, or None.
    """
    wanted = job.scene.time.scheme
    spec, patch = job.scene.contact, setup.patch
    steps = oscillation(spec, patch, plan.response, plan.step, bristles(spec, patch))
    if math.isfinite(steps):
        record.indicators["steps in the fastest oscillation of the contact"] = (steps, "-")
    given = Chosen(wanted, f'time.scheme = "{wanted}"')
    return reported(record, begun or (choose(steps) if wanted == "auto" else given))


def reported(record: Record, chosen: Chosen) -> Chosen:
    """Report the choice in the terminal and the record; returns it."""
    observe.say(f"  scheme {chosen.scheme}: {chosen.reason}")
    record.indicators["reason for the scheme"] = (chosen.reason, "-")
    return chosen


def recursive(scheme: str) -> str:
    """The scheme of a recursion that repeats a run: a convolution approximates linear forces."""
    return "linear" if scheme == "convolution" else scheme


def of_given_forces(scene: Scene) -> str:
    """The scheme for prescribed forces without contact.

    They cannot chatter, and linear over the step has the higher order.
    """
    return "linear" if scene.time.scheme == "auto" else scene.time.scheme
