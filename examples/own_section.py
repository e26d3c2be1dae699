"""A section of one's own in a scene: an ellipse, wider than it is high.

Run it with `./tireroad python examples/own_section.py`. A class with a decorator is all it
takes: its parameters become keys of `[tire]` with unit, range and meaning, checked like any other.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

from tireroad.fem.parameters import number
from tireroad.fem.static.press import press
from tireroad.runs.scene.load import load
from tireroad.runs.scene.physics import make_tire
from tireroad.runs.scene.sections.torus import TorusSection
from tireroad.runs.scene.tables.tire import SECTIONS, section_kind


@section_kind("ellipse", "the torus, stretched along the axle")
class Ellipse(TorusSection):
    """The torus's keys, and one more: nodes (r, y) of the circle go to (r, stretch y)."""

    stretch: float = number(1.2, "-", "width of the section over its height", least=0.3, most=3)

    def ring(self, tire):
        """The torus's elements, stretched: regions, cords and grading come with them."""
        round_ = super().ring(tire)
        return replace(round_, section=round_.section.moved(lambda at: at * [1.0, self.stretch]))


SCENE = """
[tire]
section = "ellipse"
segments = 16
elements_arc = 8
[tire.material]
youngs_modulus = 48e6
"""


def main() -> list[float]:
    """Load (N) at 4 mm of deflection of the circle, and of an ellipse half again as wide."""
    loads = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(SCENE)
        for stretch in (1.0, 1.5):
            tire = make_tire(MPI.COMM_WORLD, load(path, [f"tire.stretch={stretch}"]).tire)
            loads.append(press(tire, inflation=2e5, deflection=0.004).load)
    return loads


if __name__ == "__main__":
    print("circle {:.1f} N, ellipse {:.1f} N".format(*main()))
    SECTIONS.forget("ellipse")
