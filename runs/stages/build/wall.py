"""The rubber that a scene's contact presses on: what it gives way to between the nodes of the mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tireroad.contact.setup import ContactSetup
from tireroad.contact.tread.between_nodes import Backed, on_nodes, over_rectangles, unsettled
from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.law import TreadLaw
from tireroad.contact.tread.laws.elastic import HalfSpace, Layer
from tireroad.fem.errors import InputError
from tireroad.fem.sections.ring import Ring
from tireroad.fem.static.state import StaticState
from tireroad.greens.response import Response
from tireroad.runs.scene.tables.tire import Tire
from tireroad.runs.stages.base.job import Job

_WHOLE = 0.9  # of the wall: a compound as thick as that is all of it


@dataclass(frozen=True, kw_only=True)
class Normal:
    """What the loop asks of [contact] where all forces are normal to the road."""

    law: TreadLaw
    solver: str
    sheared: bool = False
    rubs: bool = False


class Backing(NamedTuple):
    """What the loop takes in place of a run's own; the setup not settled."""

    contact: Normal
    setup: ContactSetup
    response: Response


def backed(job: Job, static: StaticState, setup: ContactSetup, response: Response) -> Backing:
    """Setup (not settled) and response with what the outer rubber gives way to between the nodes: the tread lies on all
    of it, and the nodes give way by less what they have of it already.

    InputError where that is not known: points that are nodes, a road that is no plane, horizontal forces, a tread that
    creeps.
    """
    contact, patch = job.scene.contact, setup.patch
    if patch.weights is None or patch.frames is not None or contact.rubs or contact.law.creep:
        raise InputError(
            "the compliance of the wall between nodes is known only for a grid of points on a plane road and normal forces"
        )
    wall = over_rectangles(_outer(job.scene.tire, job.tire.section))
    known = on_nodes(patch, static.area, wall)
    count = len(patch.index)
    residual = response.residual.copy()
    residual[:count, :count] -= known
    patch = unsettled(patch, known, static.normal_force[patch.index])
    spec = Normal(law=Backed(law=contact.law, wall=wall), solver=contact.solver)
    return Backing(spec, replace(setup, patch=patch), replace(response, residual=residual))


def _outer(tire: Tire, ring: Ring) -> Influence:
    """Of the compound at the crown, for small motions: a half-space where the wall is of nothing else, else a layer."""
    section = ring.section
    cell = section.outer[len(section.outer) // 2, 0]
    material = tire.shape.rubbers(tire)[section.regions[section.region[cell]]]
    modulus = material.dynamic * material.law.youngs
    middle = section.nodes[section.cells].mean(axis=1)
    low, high = np.sort(section.nodes[section.cells[cell], 1])[[0, -1]]
    under = (section.region == section.region[cell]) & (middle[:, 1] > low) & (middle[:, 1] < high)
    thickness = float(np.ptp(section.nodes[section.cells[under], 0]))
    rubber = {"youngs_modulus": modulus, "poisson_ratio": material.law.poisson}
    law = (
        HalfSpace(**rubber)
        if thickness > _WHOLE * ring.thickness
        else Layer(**rubber, thickness=thickness)
    )
    return law.influence(np.inf)
