"""Plausibility check: figures of a run far outside the usual range of tires.

The ranges are wide: motorcycle to truck, slick to winter tire. A figure within them may still be
wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.sections.radial import size
from tireroad.runs.report.read import Absent, Results, digits, quantity

_LOWEST = 6  # modes whose damping is checked
_OVERLOAD = 1.1  # times the rated load, which the size gives within 4 %
_PEAK = 2.5  # largest contact pressure over the mean, with some room for coarse elements
_DIFFERS = 0.05  # relative to the static load; above it the mean force while rolling is explained
_OBSTACLES = ("step", "cleat", "iso8608")  # roads with heights of their own
# why the load depends on the road: on a held axle, and on springs to the ground
_HELD = "the axle is held at its static height, so that the road's height decides"
_GROUNDED = (
    "the springs of the axle end at the ground (no axle.body_mass), so that the load follows the mean height of the "
    "road, in a longer run too"
)


def unusual(results: Results) -> str | None:
    """One sentence with all unusual figures; None if there are none."""
    remarks = [text for check in _CHECKS for text in _asked(check, results)]
    if not remarks:
        return None
    return "outside the usual range of tires (in brackets): " + "; ".join(remarks)


def _asked(check: Callable[[Results], Iterator[str]], results: Results) -> list[str]:
    """The result of a check; empty if a file or dataset that it needs is missing or damaged."""
    try:
        return list(check(results))
    except (Absent, InputError):
        return []


def _number(results: Results, name: str, key: str) -> float:
    """An attribute as a number; 0 if there is none."""
    value = results.attribute(name, key)
    return float(value) if isinstance(value, int | float) else 0.0


def _outside(value: float, low: float, high: float) -> bool:
    return not low <= value <= high


def mean_pressure(results: Results) -> float:
    """Load over the area of the footprint, Pa; 0 without a road."""
    force = results.array("static.h5", "contact/force")[:, 2]
    area = _number(results, "static.h5", "footprint_area")
    return float(force.sum()) / area if area > 0 else 0.0


def _pressure(results: Results) -> Iterator[str]:
    """Load over area: close to the inflation, higher for a stiff carcass and a light load."""
    mean, inflation = mean_pressure(results), _number(results, "static.h5", "inflation")
    if inflation > 0 and mean > 0 and _outside(mean / inflation, 0.6, 2.0):
        yield (
            f"mean contact pressure {quantity(mean, 'Pa')}, {digits(mean / inflation)} times the inflation "
            "(0.6 to 2 times)"
        )


def _peak(results: Results) -> Iterator[str]:
    """The largest pressure: of passenger tires up to some 1.8 times the mean."""
    mean = mean_pressure(results)
    largest = float(results.array("static.h5", "contact/pressure").max(initial=0.0))
    if mean > 0 and largest > _PEAK * mean:
        yield (
            f"largest contact pressure {quantity(largest, 'Pa')}, {digits(largest / mean)} times the mean (at most "
            f"{_PEAK:g} times)"
        )


def _footprint(results: Results) -> Iterator[str]:
    length, width = (
        _number(results, "static.h5", f"footprint_{name}") for name in ("length", "width")
    )
    if length > 0 and width > 0 and _outside(length / width, 0.3, 2.5):
        yield (
            f"footprint {digits(1e3 * length)} mm long and {digits(1e3 * width)} mm wide "
            "(length 0.3 to 2.5 times the width)"
        )


def _stiffness(results: Results) -> Iterator[str]:
    """Secant stiffness, and deflection relative to the section height."""
    load, sunk = (_number(results, "static.h5", name) for name in ("load", "deflection"))
    if load <= 0 or sunk <= 0:
        return
    if _outside(load / sunk, 5e4, 1.5e6):
        yield f"vertical stiffness {digits(1e-3 * load / sunk)} N/mm (50 to 1500 N/mm)"
    points = results.array("static.h5", "surface/points")
    radius = np.hypot(points[:, 0], points[:, 2])
    height = float(np.ptp(radius))
    if sunk > 0.35 * height:
        yield (
            f"deflection {quantity(sunk, 'm')} of a section {quantity(height, 'm')} high: the load is beyond what "
            "such a tire is rated for (10 to 20 % of the height at rated load)"
        )


def _rating(results: Results) -> Iterator[str]:
    """Load over that which the built-in tire's size is rated for at its inflation."""
    tire = results.scene.get("tire", {})
    load, inflation = (_number(results, "static.h5", name) for name in ("load", "inflation"))
    if tire.get("section") != "radial" or "size" not in tire or load <= 0 or inflation <= 0:
        return
    own = size(tire["size"])
    if load > _OVERLOAD * own.rated_load(inflation):
        most = own.rated_load()
        remedy = (
            f"{quantity(own.inflation_for(load), 'Pa')} would do"
            if load < most
            else "too much for it"
        )
        yield (
            f"load {quantity(load, 'N')} on {tire['size']} at {quantity(inflation, 'Pa')}, rated for "
            f"{quantity(own.rated_load(inflation), 'N')} there ({remedy})"
        )


def _mass(results: Results) -> Iterator[str]:
    mass = _number(results, "static.h5", "mass")
    if mass > 0 and _outside(mass, 3.0, 90.0):
        yield f"mass {digits(mass)} kg (3 to 90 kg, motorcycle to truck)"


def _tread(results: Results) -> Iterator[str]:
    contact = results.scene.get("contact", {})
    modulus = contact.get("youngs_modulus") if contact.get("tread") != "none" else None
    if modulus and _outside(modulus, 1.5e6, 4e7):
        yield f"contact.youngs_modulus {quantity(modulus, 'Pa')} of the tread (rubber: 3 to 15 MPa)"


def _damping(results: Results) -> Iterator[str]:
    """Damping of the tire's lowest modes: half critical or more is beyond that of rubber.

    From [damping] or the loss factors, not from the eigenvalues of the rolling tire: those contain
    the wheel's dampers, and rotation shifts their frequencies without damping them.
    """
    rigid = int(_number(results, "modes.h5", "rigid_modes"))
    lowest = slice(rigid, rigid + _LOWEST)
    omega = 2 * np.pi * results.array("modes.h5", "frequency")[lowest]
    table = results.scene.get("damping")
    if table is None:
        parts = {"loss_factor": results.array("modes.h5", "loss_factor")[lowest] / 2}
    else:
        mass, stiffness = table.get("mass", 0.0), table.get("stiffness", 0.0)
        parts = {"[damping] mass": mass / (2 * omega), "[damping] stiffness": stiffness * omega / 2}
    share = np.sum(list(parts.values()), axis=0)
    if len(omega) and share.max() > 0.5:
        text = (
            f"{100 * share.max():.0f} % of critical" if share.max() < 0.999 else "beyond critical"
        )
        key = max(parts, key=lambda name: parts[name][share.argmax()])
        yield f"damping of the lowest modes up to {text} (0.5 to 10 %): look at {key}"


def _road(results: Results) -> Iterator[str]:
    relief = _number(results, "contact.h5", "road_relief")
    thickness = results.scene.get("tire", {}).get("thickness")
    kind = results.scene.get("road", {}).get("kind")
    if thickness and kind not in _OBSTACLES and relief > thickness:
        yield (
            f"a road with {quantity(relief, 'm')} between its lowest and highest point under a wall "
            f"{quantity(thickness, 'm')} thick (textures: below 10 mm; is the file in millimetres?)"
        )


_CHECKS = (_pressure, _peak, _footprint, _stiffness, _rating, _mass, _tread, _damping, _road)


def mean_load(results: Results) -> str | None:
    """Why the mean force while rolling differs from the static load by 5 % or more; else None."""
    try:
        force = results.array("contact.h5", "total_force")[:, 2]
        load = _number(results, "static.h5", "load")
    except (Absent, InputError):
        return None
    if load <= 0 or len(force) < 2 or abs(force.mean() / load - 1) < _DIFFERS:
        return None
    share = force.mean() / load - 1
    text = (
        f"The mean vertical force while rolling, {quantity(float(force.mean()), 'N')}, is "
        f"{100 * abs(share):.0f} % {'above' if share > 0 else 'below'} the {quantity(load, 'N')} at rest: "
    )
    return text + _reason(results.scene)


def _reason(scene: Mapping) -> str:
    """Why the mean load differs, by the support of the wheel and the road."""
    axle = scene.get("axle", {})
    kind = "fixed" if "z" in axle.get("locked", ()) else axle.get("kind", "fixed")
    if kind == "fixed":
        return _by_road(scene, _HELD, '[axle] kind = "corner" with a body_mass keeps the load')
    if kind == "corner" and not axle.get("body_mass"):
        return _by_road(scene, _GROUNDED, "axle.body_mass keeps the load")
    what = "wheel and body have" if kind == "corner" else "the wheel has"
    return f"{what} not come to rest; a longer run, or run-in, shows the load itself."


def _by_road(scene: Mapping, reason: str, keeps: str) -> str:
    """The reason, extended by the share of the road and by what limits the load."""
    road = scene.get("road", {})
    if road.get("kind", "flat") == "flat":
        return f"{reason}; {_of_flat(scene)}."
    if reason == _HELD and road.get("datum") == "mean":
        reason += (
            "; its mean lies on the static road plane (road.datum), and as the tire rests on its highest parts, they "
            "press in more than the deep ones let go"
        )
    return f"{reason}. {keeps}; road.offset lowers the road."


def _of_flat(scene: Mapping) -> str:
    """The cause of a load that varies on a flat road."""
    road = scene.get("road", {})
    moved = {
        "its motion (road.motion)": road.get("motion", {}).get("kind", "none") != "none",
        "its height (road.offset)": bool(road.get("offset")),
        "the grooves of the tread ([pattern])": bool(scene.get("pattern")),
    }
    causes = [cause for cause, there in moved.items() if there]
    if causes:
        return f"on this flat road it comes from {' and '.join(causes)}"
    return "on a flat road what is left is the settling on the points' grid"
