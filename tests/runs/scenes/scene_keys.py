"""Every key of a scene by its table and name."""

from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene

KEYS = {f"{of.__name__}.{item.name}": key for _, of, item, key in walk(Scene)}
