"""The drawing of a scene's section, in its result folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tireroad.runs.report.section_figure import save_section
from tireroad.runs.scene.extent.own_tire import own_section
from tireroad.runs.scene.extent.tire_section import make_section
from tireroad.runs.scene.tables.scene import Scene

NAME = "section.png"


def write_section(scene: Scene, directory: Path) -> str:
    """Draw the section of the scene's tire; says where, or why it could not be kept."""
    tire = scene.tire
    angles = {cords.name: cords.angle for cords in tire.cords}
    if tire.section == "file":
        angles = {p.name: float(np.degrees(p.angle)) for p in own_section(tire).plies} | angles
    try:
        directory.mkdir(parents=True, exist_ok=True)
        save_section(make_section(tire).section, directory / NAME, angles)
    except OSError as error:
        return f"section not drawn: {directory / NAME}: {error.strerror}"
    return f"section drawn: {directory / NAME}"
