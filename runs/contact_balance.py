"""The energy balance of a run, an indicator of how well its steps resolve it."""

from __future__ import annotations

from contact.energy import Work, stored
from contact.rolling import Loop
from modal.rotating import matrices
from runs import observe
from runs.session import Session


def balance(session: Session, loop: Loop, work: Work, step: float) -> None:
    """Work of contact, energy left in the tire, and the rest: lost, less what the drive put in.

    Collective.
    """
    modes, kept = session.state_modes, loop.tire.snapshot()
    state, push = kept["state"], kept["push"]
    slow = session.contact_response.slow(step)
    right = modes.right[:, slow]
    coordinates = (right @ state).real + modes.block_right @ kept["block_state"]
    rates = (right @ (modes.eigenvalue[slow] * state + push)).real
    rates += modes.block_right @ (modes.block @ kept["block_state"])
    inertia = session.scene.rotation.inertia if session.speed else "full"
    projection = session.modal.projection
    _, stiffness = matrices(projection, session.speed, session.damping, inertia)
    left = stored(coordinates, rates, stiffness)
    session.record.indicators |= {
        "work of contact on the tire": (work.total, "J"),
        "energy left in the modes": (left, "J"),
        "lost, less the work of the drive": (work.total - left, "J"),
    }
    observe.say(
        f"  energy: contact put {work.total:.4g} J into the tire, {left:.4g} J are left in its modes"
    )
    if session.speed == 0 and left > work.total + 1e-3 * abs(work.total) + 1e-9:
        session.record.warnings.append(
            "the standing tire holds more energy than contact put in: take a smaller time.step, or "
            'time.scheme = "constant"'
        )
