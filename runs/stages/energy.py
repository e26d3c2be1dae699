"""What the contact stage says of energy."""

from __future__ import annotations

from tireroad.contact.balance import energy_left, own_states
from tireroad.contact.energy import Work
from tireroad.contact.rolling import Loop
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process import observe
from tireroad.runs.stages.record import Record


def describe_energy(
    record: Record,
    rolling: RollingModes,
    response: Response,
    loop: Loop,
    contact: Work,
    driven: float | None,
    step: float,
) -> None:
    """Work of contact, energy left in the tire, and the rest: lost, less what the drive put in.

    `contact`, `driven` (J): the work of the contact's changes and of the prescribed forces. Collective.
    """
    kept = loop.tire.snapshot()
    work = contact.total + (driven or 0.0)
    record.indicators["work of contact on the tire"] = (contact.total, "J")
    if driven is not None:
        record.indicators["work of the prescribed forces"] = (driven, "J")
    if not own_states(response, rolling) or len(kept["block_state"]) != len(rolling.states.block):
        observe.say(f"  energy: contact and forces put {work:.4g} J into the tire")
        return
    turns = rolling.turning.speed > 0
    left = energy_left(rolling, kept, response.slow(step))
    record.indicators |= {
        "energy left in the modes": (left, "J"),
        "lost, less the work of the drive": (work - left, "J"),
    }
    observe.say(
        f"  energy: {work:.4g} J came into the tire, {left:.4g} J are left in its modes, "
        f"{work - left:.4g} J were lost{' less what the drive put in' if turns else ''}"
    )
    if not turns and left > work + 1e-3 * abs(work) + 1e-9:
        record.warnings.append(
            "the standing tire holds more energy than was put in: take a smaller time.step, or "
            'time.scheme = "constant"'
        )
