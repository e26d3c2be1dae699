"""Parts of the program against closed forms."""

from __future__ import annotations

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.validation.parts import (
    closed_contact,
    closed_tire,
    creeping,
    golden_car,
    grooved,
    shear,
    static_friction,
)

ABOUT = "tube, rings, oscillator, Hertz, punch, friction, creep of rolling, static friction, brush, creeping rubber, pattern and golden car against closed forms"


def run() -> list[Table]:
    """One table of all cases."""
    rows = [
        [case, found, exact, unit, 100 * abs(found / exact - 1)]
        for package in (
            closed_tire,
            golden_car,
            closed_contact,
            shear,
            creeping,
            grooved,
            static_friction,
        )
        for case, unit, found, exact in package.rows()
    ]
    columns = [("case", ""), ("computed", "-"), ("exact", "-"), ("unit", ""), ("error", "%")]
    notes = [
        "Errors are those of the discretisation: they fall with the mesh or the number of points."
    ]
    return [Table("Closed forms", columns, rows, notes)]
