"""Every package where it could blow up: each case comes to its end, or is refused with the reason."""

from __future__ import annotations

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.validation import stress_contact, stress_fem, stress_greens, stress_modal
from tireroad.runs.validation.parts import combined

ABOUT = "finite elements, modes, Green's functions and the contact loop under stress"


def run() -> list[Table]:
    """All packages in one table, and the figures of the contact loop in another."""
    contact = stress_contact.outcomes()
    rows = [*stress_fem.rows(), *stress_modal.rows(), *stress_greens.rows()]
    rows += [ended.row for ended in contact]
    rows += combined.rows()
    columns = [("package", ""), ("case", ""), ("what happened", ""), ("how it was caught", "")]
    whole = Table("Numerical stability", columns, rows, ["No case may end in NaN or uncaught."])
    return [whole, stress_contact.table(contact)]
