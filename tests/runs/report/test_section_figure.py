"""The drawing of a section shows every region, ply and face where they lie."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.image import imread

from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.runs.report.section_figure import draw_section, save_section
from tireroad.tests.validation.cases import thesis_torus


@pytest.fixture
def mesh():
    torus = thesis_torus(segments=16, elements_arc=12, elements_thickness=2)
    return torus.section(plies=[PlyLine("belt", (-0.7, 0.7), 0.5)])


def test_places(mesh):
    """The ply is 6 mm under the outer face, in mm; the cells fill the section."""
    (axes,) = draw_section(mesh, {"belt": 20.0}).axes
    ply = np.concatenate(axes.collections[1].get_segments())
    assert np.hypot(ply[:, 0], ply[:, 1] - 220) == pytest.approx(94, abs=1e-6)
    (fill,) = [c for c in axes.collections if isinstance(c, PolyCollection)]
    assert len(fill.get_paths()) == len(mesh.cells)
    lines = [c for c in axes.collections if isinstance(c, LineCollection)]
    assert [len(c.get_segments()) for c in lines] == [
        len(mesh.plies["belt"]),
        len(mesh.inner),
        len(mesh.tread),
        len(mesh.rim),
    ]
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "cords belt, +20°" in texts
    assert axes.yaxis_inverted()


def test_picture(mesh, tmp_path):
    save_section(mesh, tmp_path / "section.png", {"belt": 20.0}, dpi=60)
    picture = imread(tmp_path / "section.png")
    assert picture.shape[0] > 200 and np.ptp(picture[..., 0]) > 0.5
