"""Stress test of every package: each case must finish, or be refused with a reason."""

from __future__ import annotations

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.validation.parts import combined
from tireroad.runs.validation.stress import contact as stress_contact
from tireroad.runs.validation.stress import fem as stress_fem
from tireroad.runs.validation.stress import greens as stress_greens
from tireroad.runs.validation.stress import modal as stress_modal

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
