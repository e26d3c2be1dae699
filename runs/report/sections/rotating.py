"""Report section about the modes of the rolling tire."""

from contextlib import suppress

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.modal.states import growing
from tireroad.runs.files.read import Absent, Results, Section, Table, attributes
from tireroad.runs.report import rotating_figures
from tireroad.runs.report.quantities import quantity
from tireroad.runs.report.sections import cavity
from tireroad.runs.report.sections.tire import LISTED


def rotating(results: Results) -> Section:
    """The section on eigenvalues of the rolling tire (rotating.h5)."""
    name = "rotating.h5"
    section = Section("Modes of the rolling tire", "Eigenvalues s of the rotating, damped tire.")
    value = results.array(name, "eigenvalue")
    # Including those of the near-defective block.
    block = results.optional(name, "block")
    every = value if block is None else np.concatenate([value, np.linalg.eigvals(block)])
    beyond = every[growing(every)]
    section.facts = attributes(results, name, (("speed", "rad/s"), ("basis_condition", "")))
    section.facts.append(("growing", quantity(len(beyond))))
    if len(beyond):
        worst = beyond[beyond.real.argmax()]
        section.warnings.append(
            f"The rolling tire is unstable: {len(beyond)} eigenvalues have Re s > 0, the worst "
            f"{quantity(float(worst.real), '1/s')} at "
            f"{quantity(float(abs(worst.imag) / 2 / np.pi), 'Hz')}."
        )
    rising = np.flatnonzero(value.imag > 0)
    rising = rising[np.argsort(value.imag[rising])]
    columns = {"residual": results.optional(name, "residual")}
    columns["left residual"] = results.optional(name, "left_residual")
    present = {key: column for key, column in columns.items() if column is not None}
    rows = [
        (
            quantity(float(value[q].imag / 2 / np.pi), "Hz"),
            quantity(float(value[q].real), "1/s"),
            f"{-100.0 * value[q].real / abs(value[q]):.3g} %".replace("-", "−"),
            *(quantity(float(column[q])) for column in present.values()),
        )
        for q in rising[:LISTED]
    ]
    section.table = Table(("frequency", "Re s", "of critical damping", *present), rows)
    cavity.resonances(results, section, name, "air_share", value)
    if len(rising) > LISTED:
        listed = f"The table lists {LISTED} of {len(rising)} pairs, by frequency."
        section.notes.append(listed)
    campbell(results, section)
    section.show(rotating_figures.eigenvalues(value), "Eigenvalues with Im s ≥ 0.")
    return section


def campbell(results: Results, section: Section) -> None:
    """Add the branches over speed, damped and undamped, if the run has computed them."""
    speed = results.optional("rotating.h5", "campbell/speed")
    if speed is None:
        return
    radius: float | None = None
    with suppress(Absent, InputError):  # that file's own section reports the problem
        radius = float(results.attribute("static.h5", "rolling_radius") or 0.0)
    damped = results.array("rotating.h5", "campbell/frequency")
    undamped = results.optional("rotating.h5", "campbell/undamped")
    given = speed, damped, undamped, radius
    text = "Branches followed over speed, on one static state. Solid: damped, as the tire rings"
    if undamped is not None:
        text += (
            "; dashed: the same tire without damping (what is damped beyond critical has only this)"
        )
    text += "; dotted: n Ω/2π, n = 1 to 8, at which a standing road excites."
    section.show(rotating_figures.campbell(*given), text, rotating_figures.campbell_live(*given))
