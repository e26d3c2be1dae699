"""Pictures of the same arguments are drawn once a process."""

import numpy as np

from tireroad.runs.report import surface_figures
from tireroad.runs.report.surface_figures import once


def test_the_same_arguments_are_drawn_once_and_others_anew() -> None:
    calls = []

    @once
    def draw(points, titles, height=None) -> str:
        calls.append(height)
        return f"{points.sum()} {titles} {height}"

    points = np.arange(6.0)
    assert draw(points, ["a", "b"]) == draw(points.copy(), ["a", "b"]) and len(calls) == 1
    changed = points.copy()
    changed[0] = 1e-300
    for other in ((changed, ["a", "b"]), (points.reshape(2, 3), ["a", "b"]), (points, ["ab"])):
        draw(*other)
    draw(points, ["a", "b"], height=1.0)
    assert len(calls) == 5
    for k in range(surface_figures.MOST):
        draw(points, ["a", "b"], height=float(k))
    assert len(surface_figures._drawn) == surface_figures.MOST
    draw(points, ["a", "b"])
    assert (
        len(calls) == 5 + surface_figures.MOST
    )  # height 1.0 was there, the first picture had gone
