"""Local compliance, between the nodes of the mesh, of the rubber under a scene's contact."""

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

_WHOLE = 0.9  # share of the wall from which a compound counts as all of it


@dataclass(frozen=True, kw_only=True)
class Normal:
    """The attributes of [contact] that the loop needs if all forces are normal to the road."""

    law: TreadLaw
    solver: str
    sheared: bool = False
    rubs: bool = False


class Backing(NamedTuple):
    """Replacements for the run's own contact, setup (not settled) and response."""

    contact: Normal
    setup: ContactSetup
    response: Response


def backed(job: Job, static: StaticState, setup: ContactSetup, response: Response) -> Backing:
    """Contact, setup (not settled) and response with the outer rubber's local compliance.

    The tread is backed by all of that rubber; the nodes' residual loses the part that the mesh
    already has. Raises InputError where this is not known: points at nodes, a road that is not a
    plane, horizontal forces, a tread that creeps.
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
    """Influence of the crown's compound: a half-space if it is the whole wall, else a layer."""
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
