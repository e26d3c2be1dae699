"""Figure 5.5: an elastic half-space under roughness peaks; the thesis's formula and solution."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import half_space_compliance, rectangle_potential
from tireroad.tests.reference import closed_forms
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes

Array = NDArray[np.float64]
YOUNGS_MODULUS, POISSON_RATIO = 20e6, 0.49  # Pa, -: caption of figure 5.5
MODULUS = closed_forms.contact_modulus(YOUNGS_MODULUS, POISSON_RATIO)
# The thesis shows its peaks only as a picture; these have the size of coarse asphalt.
PITCH, POINTS = 1.0e-3, 33  # m, points per side
PEAKS = ((-12e-3, 1.0e-3), (0.0, 0.55e-3), (12e-3, 1.0e-3))  # x m, height m
RADIUS, PRESSED = 8e-3, 0.5e-3  # m: radius of peaks and sphere; indentation from the highest peak


def printed(x: Array, y: float, a: float, b: float, put_right: bool = False) -> Array:
    """Right-hand side of (5.4), m; third factor (x + a) as printed, or (x - a) if `put_right`."""

    def log(p: Array, q: float, r: Array, s: float) -> Array:
        return np.log((q + np.hypot(q, p)) / (s + np.hypot(s, r)))

    left, right, up, down = x + a, x - a, y + b, y - b
    first = left * log(left, up, left, down)
    second = up * np.log((left + np.hypot(up, left)) / (right + np.hypot(up, right)))
    third = (right if put_right else left) * log(right, down, right, up)
    fourth = down * np.log((right + np.hypot(down, right)) / (left + np.hypot(down, left)))
    return first + second + third + fourth


def _grid() -> Array:
    """Points (n, 2) m."""
    along = PITCH * (np.arange(POINTS) - POINTS // 2)
    return np.stack(np.meshgrid(along, along, indexing="ij"), -1).reshape(-1, 2)


def _compliance(points: Array) -> Array:
    half = np.full_like(points, PITCH / 2)
    return half_space_compliance(points, half, YOUNGS_MODULUS, POISSON_RATIO)


def as_thesis(compliance: Array, overlap: Array) -> Array:
    """Forces (n,) N by section 5.3.2: push overlapping points back, negative forces set to 0."""
    touching, force = overlap > 0, np.zeros(len(overlap))
    force[touching] = np.linalg.solve(compliance[np.ix_(touching, touching)], overlap[touching])
    return np.maximum(force, 0.0)


def _spheres(points: Array, peaks: tuple[tuple[float, float], ...]) -> Array:
    """Height (n,) m of overlapping spherical peaks."""
    heights = [
        top - ((points[:, 0] - x) ** 2 + points[:, 1] ** 2) / (2 * RADIUS) for x, top in peaks
    ]
    return np.max(heights, axis=0)


@figure(
    "figure-5.5",
    "Elastic half-space pressed by roughness peaks",
    "With E = 20 MPa and ν = 0.49 the half-space yields under the peaks and beside them: points that do not touch "
    "are displaced as well. Formula (5.4); forces that come out negative are set to zero.",
)
def half_space(scenes: Scenes) -> Reproduced:
    """On a grid of 1 mm. Not collective."""
    points = _grid()
    compliance = _compliance(points)
    road = _spheres(points, PEAKS)
    overlap = road - road.max() + PRESSED
    force = ActiveSet(compliance).solve(-overlap)
    surface, theirs = compliance @ force, compliance @ as_thesis(compliance, overlap)
    middle = int(np.flatnonzero((points == 0).all(axis=1))[0])
    row = points[:, 1] == 0
    x = 1e3 * points[row, 0]
    around = np.linspace(-4.0, 4.0, 400)  # not at the corners, where (5.4) has ln 0
    love = rectangle_potential(around, 0.0, 1.0, 1.0)
    curves = {
        "road": Curve(x, 1e3 * np.maximum(overlap, -1e-3)[row], 1, ":"),
        "half-space": Curve(x, 1e3 * surface[row]),
        "the thesis's way, negative forces made zero": Curve(x, 1e3 * theirs[row], 2, "--"),
    }
    kernels = {"(5.4) put right": Curve(around, love), "as printed": Curve(around, printed(around, 0.0, 1.0, 1.0), 2, "--")}  # fmt: skip
    return Reproduced(
        shows=f"The point between two peaks is displaced by {1e3 * surface[middle]:.3g} mm under {force[middle]:.2g} N. (5.4) as printed has a "
        f"wrong factor in its third term: half the displacement at the centre, and no symmetry.",
        claims=(*_formula(), *_points(compliance, surface, force, middle), *_hertz(points, compliance)),
        picture=lambda: lines(
            [
                Panel(title="middle row", x="x in mm", y="upwards in mm", curves=curves),
                Panel(title="uniform pressure on |x|, |y| ≤ 1", x="x", y="πE u / ((1 − ν²) p)", curves=kernels),
            ]
        ),
        caption="Left: half-space and peaks. Right: displacement by a pressed square, along its middle line.",
    )  # fmt: skip


def _formula() -> tuple[Claim, ...]:
    because = "the third term of (5.4) has the factor (x − a), not (x + a)"
    at = np.array([-2.0, 0.0, 2.0])
    theirs, ours = printed(at, 0.0, 1.0, 1.0), rectangle_potential(at, 0.0, 1.0, 1.0)
    given: dict[str, Any] = {"source": "(5.4) evaluated", "tolerance": 1e-6, "because": because}
    return (
        Claim(what="πE u/((1 − ν²) p) at the centre of a square of half side 1", unit="m", thesis=float(theirs[1]),
              found=float(ours[1]), right=closed_forms.LOVE_SQUARE_CENTRE, by="8 ln(1 + √2)", **given),
        Claim(what="displacement at x = 2 over that at x = −2", unit="-", thesis=float(theirs[2] / theirs[0]),
              found=float(ours[2] / ours[0]), right=1.0, by="symmetry", **given),
    )  # fmt: skip


def _points(compliance: Array, surface: Array, force: Array, middle: int) -> tuple[Claim, ...]:
    source = "section 5.3.3, figures 5.3 and 5.5"
    return (
        Claim(what="displacement of the neighbour of a pressed node, over its own", unit="-", thesis=0.0, source=source,
              relation="above", found=float(compliance[middle, middle + 1] / compliance[middle, middle])),
        Claim(what="force on the low peak in the middle", unit="N", thesis=0.0, source=source, found=float(force[middle])),
        Claim(what="its displacement", unit="m", thesis=0.0, source=source, relation="above", found=float(surface[middle])),
    )  # fmt: skip


def _hertz(points: Array, compliance: Array) -> tuple[Claim, ...]:
    """The load on one sphere by both methods, against Hertz."""
    overlap = _spheres(points, ((0.0, 0.0),)) + PRESSED
    exact = closed_forms.hertz_sphere_load(PRESSED, RADIUS, MODULUS)
    return (
        Claim(what="load on a sphere of 8 mm pressed in by 0.5 mm", unit="N", source="section 5.3.2, its way computed here",
              thesis=float(as_thesis(compliance, overlap).sum()), found=float(ActiveSet(compliance).solve(-overlap).sum()),
              tolerance=0.02, right=exact, by="Hertz",
              because="points whose force comes out negative do not touch: the others carry less, which zeroing leaves out"),
    )  # fmt: skip
