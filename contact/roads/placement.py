"""Where a road lies under the tire, and where a run begins on it."""

from dataclasses import dataclass

from tireroad.fem.parameters import Parameters, choice, number


@dataclass(frozen=True, kw_only=True)
class Placement(Parameters):
    """Where a road lies under the tire."""

    owner = "road"

    run_in: float = number(
        0.1,
        "m",
        "length over which the heights grow from flat: the run starts at rest",
        least=0,
        most=1e4,
    )
    lateral: float = number(
        0.0,
        "m",
        "y of the road under the tire's middle, positive to the left",
        least=-1e4,
        most=1e4,
    )
    start: float | None = number(
        None,
        "m",
        "x of the road under the axle at t = 0, in the file's own x for a measured road; absent: 0, or the "
        "first x of a file that does not contain 0",
        least=-1e6,
        most=1e6,
    )
    offset: float = number(
        0.0, "m", "height added to the whole road, positive up", least=-10, most=10
    )
    drum_radius: float | None = number(
        None,
        "m",
        "the road lies on a drum of this radius, and repeats after its circumference; absent: a plane",
        least=0.1,
        most=1e4,
    )
    drum: str = choice("outside", ("outside", "inside"), "side of the drum that the tire runs on")


def begun_at(road: object, start: float | None) -> float:
    """x (m) of the road under the axle at t = 0: `start`, or by default 0.

    A road from a file has `measured`, its first and last x (m): one that does not contain 0 is
    driven from its first x.
    """
    if start is not None:
        return start
    first, last = getattr(road, "measured", (0.0, 0.0))
    return 0.0 if first <= 0.0 <= last else first


def moved_start(first: float) -> str:
    """What is said of a run that begins at the first x (m) of its file by default."""
    return (
        f"the axle starts at x = {shown(first)} m, the first of the file, which does not contain 0; "
        "road.start sets another x"
    )


def shown(x: float) -> str:
    """A position along the road (m) to the millimetre, as messages show it."""
    return f"{round(float(x), 3) + 0.0:.12g}"
