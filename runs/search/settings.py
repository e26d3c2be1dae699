"""The settings of a search: mesh, modes, residual, points, step, on ladders from coarse to fine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from tireroad.contact.results.error_bars import CAUSES
from tireroad.runs.files.trials import MARGIN, Settings
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.scene.tables.scene import Scene

FINER = 2**0.5  # factor per rung of modes; step and spacing of the points are halved
# A grid of points that is no part of the next one places their errors anew: on cobblestones a radial
# tire was 10, 14 and 10 % off with points 7.8, 5.5 and 3.9 mm apart. Halved, the next grid has all
# points of this one, and was this one's companion.
RUNGS = {"mesh": 10, "modes": 10, "points": 5, "step": 10}
MODES = 1.6  # highest mode over highest frequency of interest, lowest rung: valid to 0.8 of it
SAMPLES = 8  # steps per period of that frequency on the lowest rung
PASSING = 2.25  # contact points that pass per period of it, at least
# Of the outer radius: largest spacing of points, 8 mm. The closest at which the error bars of a
# radial tire still have a companion with half the spacing (contact.grid_patch): with 7 mm they missed
# the joints of cobblestones (25 % off, estimated as 12 %), with 10 mm a run was 44 % off there.
POINTS = 1 / 40
MARGINAL = f"estimated at {100 / MARGIN:.0f} % of that, because estimates can be too small"


@dataclass(frozen=True)
class Ladders:
    """The ladder of a `scene` for each cause of error; `speed` m/s of its wheel over the road."""

    scene: Scene
    speed: float

    @classmethod
    def of(cls, scene: Scene) -> Ladders:
        """The ladders of a resolved scene; the speed is that of its outer radius."""
        turning = scene.rotation.speed if scene.rotation else 0.0
        return cls(scene, turning * scene.tire.proportions().outer_radius)

    def at(self, rungs: dict[str, int]) -> Settings | None:
        """The settings on these rungs; None if a ladder has no such rung."""
        meshes = self._meshes
        if rungs["mesh"] >= len(meshes) or any(rungs[cause] > RUNGS[cause] for cause in CAUSES):
            return None
        step = self._step / 2 ** rungs["step"]
        return Settings(
            mesh=meshes[rungs["mesh"]],
            order=self.scene.tire.shape.search_order(self.scene.tire),
            up_to=MODES * self.scene.accuracy.up_to * FINER ** rungs["modes"],
            residual=self._residual,
            pitch=self._pitch / 2 ** rungs["points"],
            step=step,
            rungs=dict(rungs),
        )

    def first(self) -> Settings:
        """The coarsest settings."""
        settings = self.at(dict.fromkeys(CAUSES, 0))
        assert settings is not None
        return settings

    def finest(self) -> Settings:
        """The finest settings."""
        top = RUNGS | {"mesh": len(self._meshes) - 1}
        settings = self.at(top)
        assert settings is not None
        return settings

    def finer(self, settings: Settings) -> Iterator[tuple[str, Settings]]:
        """(cause, settings one rung up its ladder) for each cause that has a higher rung."""
        for cause in CAUSES:
            found = self.at(settings.rungs | {cause: settings.rungs[cause] + 1})
            if found is not None:
                yield cause, found

    @property
    def _meshes(self) -> tuple[tuple[int, int], ...]:
        return self.scene.tire.shape.meshes(self.scene.tire)

    @property
    def _residual(self) -> str:
        """Attachment modes, which have mass, for rolling belts.

        Without their mass, the residual of a stiff tire with few modes lets the contact ring above
        the band, where coarse steps do not resolve it (docs/verification.md).
        """
        turning = self.scene.rotation is not None and self.scene.rotation.speed > 0
        belted = bool(self.scene.tire.cords) or self.scene.tire.section != "torus"
        simple = self.scene.rotation is None or self.scene.rotation.method == "projected"
        return "attachment" if turning and belted and simple else "static"

    @property
    def _pitch(self) -> float:
        largest = POINTS * self.scene.tire.proportions().outer_radius
        if self.speed:
            largest = min(largest, self.speed / (PASSING * self.scene.accuracy.up_to))
        return largest

    @property
    def _step(self) -> float:
        assert self.scene.time is not None
        duration, up_to = self.scene.time.duration, self.scene.accuracy.up_to
        return duration / math.ceil(duration * up_to * SAMPLES)


def bounds(scene: Scene) -> list[str]:
    """Lines for `check` about the search that the run begins with."""
    ladders, accuracy = Ladders.of(scene), scene.accuracy
    limit = f" or {accuracy.budget:g} s" if accuracy.budget is not None else ""
    return [
        f"search for {accuracy.aim()}: mesh, modes, residual, points and step as given are not used",
        f"  from  {ladders.first()}",
        f"  to    {ladders.finest()}, as far as the memory holds it",
        f"  until {MARGINAL}",
        f"  in {accuracy.trials} trials{limit} at most; sizes and costs below are those of the first",
    ]


def size_ratio(cause: str, settings: Settings, other: Settings) -> float:
    """Size that causes the error in `other` over that in `settings`: below 1 if `other` is finer."""
    sizes = {
        "mesh": (1 / settings.mesh[0], 1 / other.mesh[0]),
        "modes": (1 / settings.up_to, 1 / other.up_to),
        "points": (settings.pitch, other.pitch),
        "step": (settings.step, other.step),
    }
    before, after = sizes[cause]
    return after / before


def applied(scene: Scene, settings: Settings, *, search: bool = False) -> Scene:
    """The scene with the settings applied, and without a search unless requested."""
    assert scene.contact is not None and scene.time is not None
    around, along = settings.mesh
    return replace(
        scene,
        tire=replace(
            scene.tire,
            segments=around,
            order=settings.order,
            shape=scene.tire.shape.elements_along(along),
        ),
        # The mesh companion estimates that error, and for the forces of interest.
        static=replace(scene.static, error_estimate=False),
        modal=replace(scene.modes, up_to=settings.up_to),
        greens=replace(scene.greens, residual=settings.residual, dynamic=None, band=None),
        contact=replace(scene.contact, points=Pitch(settings.pitch, settings.pitch)),
        time=replace(scene.time, step=settings.step, scheme="auto"),
        accuracy=replace(scene.accuracy, search=search),
    )
