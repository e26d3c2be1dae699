"""Draws a scene's section into its result folder."""

from __future__ import annotations

from pathlib import Path

from tireroad.runs.report.section_figure import save_section
from tireroad.runs.scene.tables.scene import Scene

NAME = "section.png"


def write_section(scene: Scene, directory: Path) -> str:
    """Draw the section of the scene's tire; returns a message: where it is, or why it failed."""
    tire = scene.tire
    try:
        directory.mkdir(parents=True, exist_ok=True)
        save_section(tire.ring().section, directory / NAME, tire.shape.angles(tire))
    except OSError as error:
        return f"section not drawn: {directory / NAME}: {error.strerror}"
    return f"section drawn: {directory / NAME}"
