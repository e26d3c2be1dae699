"""Solutions on the full matrices need a damping that has a full matrix."""

from collections.abc import Callable
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]


def full_matrices(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error for a solution on the full matrices without [damping]."""
    if scene.damping is not None:
        return
    advice = "needs a full damping matrix, which loss factors do not give: add [damping]"
    if scene.rotation is not None and scene.rotation.method == "full":
        raise error(("rotation", "method"), f'= "full" {advice}')
