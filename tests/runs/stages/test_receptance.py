"""The receptance of a point holds its dent in the surface, which is told; that of a patch is not."""

import pytest

SCENE = """
name = "struck"
[tire]
section = "radial"
size = "205/60 R15"
segments = 16
elements_arc = 10
[static]
inflation = 2.2e5
[modal]
up_to = 300.0
[output]
receptance = { to = 240.0, step = 4.0 }
[[force]]
angle = 20.0
"""


@pytest.mark.slow
@pytest.mark.parametrize(("spread", "told"), [("", True), ("spread = [2.0, 2.0]\n", False)])
def test_a_dent_is_told_where_a_point_presses(tmp_path, ran, spread: str, told: bool) -> None:
    scene = tmp_path / "struck.toml"
    scene.write_text(SCENE + spread)
    warnings = ran(scene, tmp_path / "out")[1]["response"]["warnings"]
    assert any("dent under a point" in text for text in warnings) == told
