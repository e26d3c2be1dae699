"""The energy balance of a run, an indicator of how well its steps resolve it."""

from __future__ import annotations

import numpy as np

from tireroad.contact.energy import stored
from tireroad.contact.rolling import Loop
from tireroad.modal.rotating import matrices
from tireroad.runs.process import observe
from tireroad.runs.stages.session import Session


def balance(session: Session, loop: Loop, contact: float, driven: float, step: float) -> None:
    """Work of contact, energy left in the tire, and the rest: lost, less what the drive put in.

    `contact`, `driven` (J): the work of the contact's changes and of the prescribed forces. Of other states than the modes' own (residual dynamics, attachment modes) only the work is told.
    Collective.
    """
    kept = loop.tire.snapshot()
    work = contact + driven
    session.record.indicators["work of contact on the tire"] = (contact, "J")
    if session.scene.force:
        session.record.indicators["work of the prescribed forces"] = (driven, "J")
    response, modes = session.contact_response, session.state_modes
    own = np.array_equal(response.eigenvalue, modes.eigenvalue)
    if not own or len(modes.block) != len(kept["block_state"]):
        observe.say(f"  energy: contact and forces put {work:.4g} J into the tire")
        return
    left = _left(session, kept, response.slow(step))
    session.record.indicators |= {
        "energy left in the modes": (left, "J"),
        "lost, less the work of the drive": (work - left, "J"),
    }
    observe.say(
        f"  energy: {work:.4g} J came into the tire, {left:.4g} J are left in its modes, "
        f"{work - left:.4g} J were lost{' less what the drive put in' if session.speed else ''}"
    )
    if session.speed == 0 and left > work + 1e-3 * abs(work) + 1e-9:
        session.record.warnings.append(
            "the standing tire holds more energy than was put in: take a smaller time.step, or "
            'time.scheme = "constant"'
        )


def _left(session: Session, kept: dict[str, np.ndarray], slow: np.ndarray) -> float:
    """Energy (J) of the states of a snapshot; `slow` (q,) marks the modes that it holds."""
    modes, state = session.state_modes, kept["state"]
    right = modes.right[:, slow]
    coordinates = (right @ state).real + modes.block_right @ kept["block_state"]
    rates = (right @ (modes.eigenvalue[slow] * state + kept["push"])).real
    rates += modes.block_right @ (modes.block @ kept["block_state"])
    inertia = session.scene.rotation.inertia if session.speed else "full"
    projection = session.modal.projection
    _, stiffness = matrices(projection, session.speed, session.damping, inertia)
    return stored(coordinates, rates, stiffness)
