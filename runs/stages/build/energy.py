"""The energy balance of stage contact: accumulated during the loop, then reported."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.contact.loop import Driven
from tireroad.contact.results.energy import (
    Circulation,
    Motion,
    Work,
    energy_left,
    own_states,
    springs,
)
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process import observe
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.build.rolling.stepping import Integration

# Share of the energy exchanged, beyond which the steps are too long or something is wrong.
# Measured: 0.012 at most where forces were right to 1 % up to 300 Hz, 0.024 where they were off by
# 35 %.
_UNBALANCED = 0.02
_TAKEN = 0.1  # share of the energy exchanged that the forces of a scheme may dissipate
_LEAST = 1e-9  # J: below is rounding
# Share of the energy of the static contact (load times deflection), below which no error matters:
# a run on a road of 1 um moved 1e-7 of it.
_SLIGHT = 1e-6


@dataclass(frozen=True)
class Works:
    """Work (J) of the contact's force changes and of the prescribed forces, if any.

    `lead`: additional work of the forces that the scheme applies during the steps.
    """

    contact: float
    driven: float | None
    lead: float

    @property
    def total(self) -> float:
        """Work of all forces as if they were linear over the step."""
        return self.contact + (self.driven or 0.0)


def works(contact: Work, driven: Driven | None) -> Works:
    """The works of a completed loop."""
    lead = contact.lead + (driven.lead if driven else 0.0)
    return Works(contact.total, driven.work if driven else None, lead)


class Losses:
    """Energy losses of a rolling tire from its states at each step; empty if not known."""

    def __init__(self, chosen: Integration, response: Response, rolling: RollingModes) -> None:
        tire = chosen.tire
        self._motion: Motion | None = None
        if isinstance(tire, Recursion) and Motion.known(rolling, response):
            self._motion = Motion(rolling, response.slow(chosen.step), chosen.step)
            inputs = response.residual.shape[1]
            left_out = response.resolved(chosen.step).residual[:inputs]
            self._circulation = Circulation(left_out * (not response.pulse), chosen.scheme)
            self._tire = tire
            tire.keep_samples()

    @property
    def found(self) -> tuple[float, float, float, float] | None:
        """Losses of the run, J; None if they are not known.

        Energy lost in the material; work of the drive; loss in the truncated modes less the drive's
        work on them; work of forces ahead of their mean on those modes beyond what they store.
        """
        if self._motion is None:
            return None
        losses, beyond = self._motion.losses, self._circulation
        return losses.lost, losses.drive, beyond.work, beyond.lead

    def flush(self) -> None:
        """Account for the steps since the last call. Collective."""
        if self._motion is None or not (samples := self._tire.samples()):
            return
        states, pushes, forces = map(list, zip(*samples, strict=True))
        self._motion.add(self._tire.everywhere(states), self._tire.everywhere(pushes))
        self._circulation.add(np.array(forces))

    def state(self) -> dict[str, np.ndarray]:
        """State for a checkpoint."""
        return self._motion.losses.state() | self._circulation.state() if self._motion else {}

    def set_state(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from a `state`."""
        if self._motion is not None:
            self._motion.losses.set_state(kept)
            self._circulation.set_state(kept)


def negligible(pressed: float) -> float:
    """Energy (J) below which no error matters, for load times deflection `pressed` (J) at rest."""
    return max(_LEAST, _SLIGHT * pressed)


def describe_energy(
    record: Record,
    rolling: RollingModes,
    response: Response,
    kept: dict[str, np.ndarray],
    work: Works,
    losses: Losses,
    step: float,
    pressed: float = 0.0,
) -> None:
    """Record work of forces and drive, energy in the tire, energy lost, and the imbalance.

    `kept`: the tire's snapshot; `pressed`: load times deflection of the static state, J.
    """
    slight = negligible(pressed)
    total = work.total
    record.indicators["work of contact on the tire"] = (work.contact, "J")
    if work.driven is not None:
        record.indicators["work of the prescribed forces"] = (work.driven, "J")
    own = own_states(response, rolling) and len(kept["block_state"]) == len(rolling.states.block)
    if not own:
        observe.say(f"  energy: contact and forces put {total:.4g} J into the tire")
        return
    left = energy_left(rolling, kept, response.slow(step))
    elastic = springs(response.resolved(step), kept["push_force"])
    record.indicators |= {
        "energy left in the modes": (left, "J"),
        "energy left in the residual flexibility": (elastic, "J"),
    }
    if losses.found is None:
        _standing(record, rolling, total, left + elastic, slight)
    else:
        lost, drive, beyond, springs_lead = losses.found
        taken = springs_lead - work.lead
        _rolling(record, total, left + elastic, lost, drive, beyond, taken, slight)


def _standing(
    record: Record, rolling: RollingModes, work: float, left: float, slight: float
) -> None:
    """Energy lost, by difference; it must not be negative for a tire at rest beyond `slight` J."""
    turns = rolling.turning.speed > 0
    record.indicators["lost, less the work of the drive" if turns else "lost"] = (work - left, "J")
    observe.say(
        f"  energy: {work:.4g} J came into the tire, {left:.4g} J are left in it, "
        f"{work - left:.4g} J were lost{' less what the drive put in' if turns else ''}"
    )
    if not turns and left > work + 1e-3 * abs(work) + slight:
        record.warnings.append(
            "the standing tire holds more energy than was put in: take a smaller time.step, or "
            'time.scheme = "constant"'
        )


def _rolling(
    record: Record,
    work: float,
    left: float,
    lost: float,
    drive: float,
    beyond: float,
    taken: float,
    slight: float,
) -> None:
    """All terms are known: the imbalance is the error of the time steps; `slight` J are none."""
    off = work + drive - left - lost - beyond - taken
    moved = max(abs(work), abs(drive), abs(left), abs(lost))
    record.indicators |= {
        "work of the drive against the damping": (drive, "J"),
        "energy lost in the material": (lost, "J"),
        "energy lost in the modes left out, less their drive": (beyond, "J"),
        "energy that the scheme takes": (taken, "J"),
        "energy that does not add up": (off, "J"),
    }
    observe.say(
        f"  energy: contact {work:.4g} J + drive {drive:.4g} J = in the tire {left:.4g} J + lost "
        f"{lost:.4g} J + lost in truncated modes {beyond:.2g} J + dissipated by the scheme {taken:.2g} J; "
        f"imbalance {off:.2g} J"
    )
    if abs(off) > _UNBALANCED * moved + slight:
        record.warnings.append(
            f"the energy of the rolling tire does not add up by {100 * abs(off) / moved:.2g} %: take a "
            "smaller time.step"
        )
    if abs(taken) > _TAKEN * moved + slight:
        record.warnings.append(
            f"the scheme took {100 * abs(taken) / moved:.2g} % of the energy that moved: what bounces on the "
            "tread is damped by it; take a smaller time.step to see it"
        )
