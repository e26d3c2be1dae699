"""The table [accuracy]: error estimates, and the target of a search for settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import choice, flag, integer, number

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]


@dataclass(frozen=True)
class Accuracy:
    estimate: bool = flag(
        True,
        "error bars of contact and axle force by cheaper companion runs: elements of twice the size, fewer modes, twice "
        "the step, another spacing of points",
    )
    target: float | None = number(
        None,
        "-",
        "largest estimated error of the vertical force named by of: relative L2 norm of the error of its varying part up "
        "to up_to, and relative error of its mean; mesh, modes, residual, points and step are then searched for",
        least=1e-3,
        most=1,
    )
    target_db: float | None = number(
        None,
        "dB",
        "largest estimated error of every third octave below up_to; together with target both must be met",
        least=0.05,
        most=20,
    )
    of: str = choice(
        "axle_force", ("axle_force", "contact_force"), "force to which the target applies"
    )
    up_to: float = number(
        400.0,
        "Hz",
        'highest frequency of interest: of the error, and of the waves by which contact.points = "auto" is chosen',
        least=1,
        most=1e5,
    )
    search: bool = flag(
        True,
        "with a target: search for settings that meet it; false: keep those of the scene, as in the scene that a "
        "search writes",
    )
    trials: int = integer(12, "number of settings that a search tries at most", least=1, most=100)
    budget: float | None = number(
        None,
        "s",
        "duration of the finished trials of a search, also of those before an interruption, after which no further settings "
        "are tried",
        least=1,
        most=1e8,
    )

    @property
    def aimed(self) -> bool:
        """Whether a target error is given."""
        return self.target is not None or self.target_db is not None

    @property
    def searches(self) -> bool:
        """Whether settings are searched for."""
        return self.aimed and self.search


def check_accuracy(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Check what a target requires of the other tables."""
    wanted = scene.accuracy
    if not wanted.aimed:
        return
    key = ("accuracy", "target" if wanted.target is not None else "target_db")
    if not wanted.estimate:
        raise error(key, "is met by the estimated error: it needs accuracy.estimate = true")
    if not scene.in_contact or scene.road is None or scene.time is None:
        raise error(
            key,
            "is of the forces of a tire on a road: add [contact], [road], [time], and load (N) to [static]",
        )
    if wanted.of == "axle_force" and not scene.output.axle_force:
        raise error(("accuracy", "of"), '= "axle_force" needs output.axle_force = true')
    if scene.road.kind == "flat" and scene.road.motion.kind == "none" and not scene.force:
        raise error(key, "is of what varies, and nothing drives the tire: take another road")
    if wanted.up_to * scene.time.duration < 4:
        raise error(
            ("accuracy", "up_to"),
            f"= {wanted.up_to:g} Hz is not seen in {scene.time.duration:g} s: four periods at least",
        )
    if wanted.searches:
        _check_points(scene, error)


def _check_points(scene: Scene, error: Where) -> None:
    """Raise an error for contact that does not exist, or is another, on grids of a search."""
    assert scene.contact is not None
    if scene.contact.brush_stiffness is not None:
        raise error(
            ("contact", "brush_stiffness"),
            "is that of a point: a search for accuracy chooses grids of points, and would change the tread with them; take "
            "brush_stiffness_per_area (N/m³), or accuracy.search = false and your own contact.points",
        )
    if not scene.contact.law.compliant:
        raise error(
            ("contact", "tread"),
            f'= "{scene.contact.tread}" has no compliance of its own, so it works on the nodes of the mesh only, and a '
            'search for accuracy chooses grids of points: take another, e.g. "half-space", or accuracy.search = false',
        )
