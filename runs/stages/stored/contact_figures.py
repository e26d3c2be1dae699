"""Figures and warnings of a contact loop."""

from __future__ import annotations

import numpy as np

from tireroad.contact.patch import Patch
from tireroad.contact.results.chatter import LIMIT, ROAD, Chosen, warning
from tireroad.contact.results.totals import Totals
from tireroad.fem.static.footprint import Footprint
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.build.rolling.stepping import Integration

# Fewest point spacings per footprint width. Measured on cobblestones on two tires: deviation 23 %
# too large at 1.8, 2 % at 2.4 (torus.toml), 5 % too small at 2.5, 3 % at 3.6. Only on a mesh
# whose nodes are as far apart as the footprint is wide was it 35 % at 2.4: its error bars tell.
FEW = 2.2
# Share of the static deflection: motion of the contact up to which a linear tire is trusted.
LINEAR = 1 / 3


def describe(record: Record, counted: Totals, solver, chosen: Integration, taken: int) -> None:
    """Record loads, the step, its cost and accuracy; `taken`: steps since the checkpoint."""
    totals, chattering = counted.figures, counted.alternation.worst
    record.headline |= {
        "mean load": (float(totals.sum / totals.steps), "N"),
        "least load": (float(totals.least), "N"),
        "largest load": (float(totals.most), "N"),
        "points touching at most": (totals.most_active, "-"),
        "step": (chosen.step, "s"),
        "scheme": (chosen.scheme, "-"),
        "time a step": (record.cost["time loop"] / max(taken, 1) * 1e6, "us"),
    }
    record.indicators |= {
        "worst complementarity residual": (float(totals.residual), "-"),
        "largest penetration": (float(totals.penetration), "m"),
        "factorisations": (solver.factorisations, "-"),
        "points that change back from step to step, at worst": (chattering, "-"),
    }
    if totals.least == 0:
        record.warnings.append("the tire lost contact with the road for a while")


def alternation(record: Record, worst: float, scheme: Chosen) -> None:
    """Warn if points open and close from step to step, unless the road is the known cause."""
    if worst > LIMIT and scheme.reason != ROAD:
        record.warnings.append(warning(worst))


def points(record: Record, patch: Patch, extent: Footprint, relief: float) -> None:
    """Record the static footprint's size in point spacings; warn if too few on a rough road.

    That of the finite elements, or the distance of the outermost points that touch, which is longer
    where the tread is the softer part.
    """
    spacing = patch.spacing
    if not spacing.all():
        return
    size = np.maximum([extent.length, extent.width], (patch.touching - 1) * spacing)
    long, wide = size / spacing
    record.indicators["length of the footprint over the points' spacing"] = (float(long), "-")
    record.indicators["width of the footprint over the points' spacing"] = (float(wide), "-")
    if relief and 0 < min(long, wide) < FEW:
        record.warnings.append(
            f"contact points are {1e3 * spacing[0]:.3g} × {1e3 * spacing[1]:.3g} mm apart on a footprint of {1e3 * size[0]:.3g} × "
            f"{1e3 * size[1]:.3g} mm: on a rough road forces of so few may vary by a third too much; take a quarter "
            "of its width and length or less (contact.points)"
        )


def excursion(record: Record, most: float, deflection: float | None, *, held: bool) -> None:
    """Record how far the contact moved from the state about which the tire is linearised.

    `held`: whether the axle is.
    """
    record.indicators["largest motion of the contact beyond the static state"] = (most, "m")
    if not deflection:
        return
    share = most / deflection
    record.indicators["that, of the static deflection"] = (share, "-")
    if share > LINEAR:
        record.warnings.append(
            f"the contact moved by up to {1e3 * most:.3g} mm beyond the static state, {share:.2g} of the static "
            f"deflection of {1e3 * deflection:.3g} mm: the tire is linear about that state, so forces are doubtful "
            "beyond a third of it; take a lower road, or a longer road.run_in or road.longest_wave"
            + (', or a wheel that moves (axle.kind = "corner")' if held else "")
        )
