"""Parts of the program against closed forms."""

from __future__ import annotations

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.validation.parts import closed_contact, closed_tire, shear, static_friction

ABOUT = "tube, rings, oscillator, Hertz, punch, friction, creep of rolling, static friction and brush against closed forms"


def run() -> list[Table]:
    """One table."""
    rows = [
        [case, found, exact, unit, 100 * abs(found / exact - 1)]
        for package in (closed_tire, closed_contact, shear, static_friction)
        for case, unit, found, exact in package.rows()
    ]
    columns = [("case", ""), ("computed", "-"), ("exact", "-"), ("unit", ""), ("error", "%")]
    notes = [
        "Errors are those of the discretisation: they fall with the mesh or the number of points."
    ]
    return [Table("Closed forms", columns, rows, notes)]
