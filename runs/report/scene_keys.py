"""The keys of a resolved scene with their units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from tireroad.runs.scene.schema import every_field, key_of, table_of
from tireroad.runs.scene.tables.scene import Scene


class SceneKey(NamedTuple):
    """A key's `value` and `unit` ("" if it has none); `table`: the names and numbers of its tables."""

    table: tuple[str | int, ...]
    name: str
    value: Any
    unit: str

    @property
    def path(self) -> str:
        """As `--set` takes it, such as tire.region.0.density."""
        return ".".join(map(str, (*self.table, self.name)))


def scene_keys(
    scene: Mapping[str, Any],
    table: tuple[str | int, ...] = (),
    kind: type | None = Scene,
    unit: str = "",
) -> Iterator[SceneKey]:
    """All keys of a scene, or of one of its tables of a `kind`, sub-tables after the keys beside them.

    `unit`: that of a key whose value is a table, such as contact.points = { dx, dy }.
    """
    known = every_field(kind) if kind else {}
    below = []
    for name, value in scene.items():
        part = table_of(known[name]) if name in known else None
        of = part.of if part else None
        key = key_of(known[name]) if name in known else None
        mine = key.unit if key else unit
        if isinstance(value, Mapping):
            below.append((value, (*table, name), of, mine))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            below += [(item, (*table, name, number), of, "") for number, item in enumerate(value)]
        else:
            yield SceneKey(table, name, value, mine)
    for one in below:
        yield from scene_keys(*one)
