"""The table [road]: placement, kind with the kind's keys, and motion."""

from dataclasses import dataclass

from tireroad.contact.roads.kind import ROADS, RoadKind
from tireroad.contact.roads.placement import Placement
from tireroad.contact.roads.under_tire import Motion
from tireroad.runs.scene.schema import Variants, registered, table, variant


@dataclass(frozen=True, kw_only=True)
class Road(Variants, Placement):
    """The road driven over; `surface` is the kind with its parameters."""

    kind: str = registered(ROADS, "flat", "type of road")
    surface: RoadKind = variant("kind", ROADS)
    motion: Motion = table(Motion, "vertical motion of the whole road")

    @property
    def file(self) -> str | None:
        """The file of a measured road, or None."""
        return getattr(self.surface, "file", None)
