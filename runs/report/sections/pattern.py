"""Report section part about the tread pattern."""

from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report import figures
from tireroad.runs.report.quantities import quantity

_SHOWN = 0.6  # m of tread drawn


def tread(results: Results, section: Section) -> None:
    """Add the pattern, and the part of it under the footprint at the beginning (contact.h5)."""
    depth = results.optional("contact.h5", "pattern/depth")
    if depth is None:
        return
    s, y = results.array("contact.h5", "pattern/s"), results.array("contact.h5", "pattern/y")
    points = results.array("contact.h5", "points")
    begun = results.array("contact.h5", "pattern/begun")
    land = float((depth <= 0).mean())
    section.facts += [
        ("deepest groove", quantity(float(depth.max()), "m")),
        ("land of the pattern across the patch", f"{100 * land:.3g} %"),
    ]
    section.show(
        _drawn(s, y, depth, points, begun),
        f"Tread pattern: depth over the first {1e3 * min(_SHOWN, s[-1]):.0f} mm around the tire, and at the "
        "contact points when the run begins.",
    )  # fmt: skip


@figures.styled
def _drawn(s: NDArray, y: NDArray, depth: NDArray, points: NDArray, begun: NDArray) -> str:
    figure, axes = figures.canvas(figures.WIDE, 3.0, 1, 2)
    around, patch = axes[0]
    part = s <= _SHOWN
    around.pcolormesh(1e3 * s[part], 1e3 * y, 1e3 * depth[part].T, cmap="Greys", shading="nearest")
    around.set(xlabel="around the tire in mm", ylabel="y in mm")
    shown = patch.scatter(
        *(1e3 * points[:, :2].T), c=1e3 * begun, cmap="Greys", s=6, vmin=0.0, edgecolors="none"
    )
    patch.set(xlabel="x in mm", title="under the footprint", aspect="equal")
    figure.colorbar(shown, ax=patch, label="depth in mm")
    return figures.encode(figure)
