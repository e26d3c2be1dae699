"""Combinations of `validate stability`, the cheapest and the fullest; the others run in the command."""

import pytest

from tireroad.tests.validation import stability


def test_every_combination_is_a_scene(tmp_path) -> None:
    from tireroad.runs.scene.load import load

    for one in stability.COMBINATIONS.values():
        text = stability._BASE.format(**vars(one))
        if one.tread == "winkler":
            text = text.replace("youngs_modulus = 1e7\n", "")
        (tmp_path / "scene.toml").write_text(text)
        load(tmp_path / "scene.toml", [])


@pytest.mark.long
def test_a_free_cambered_patterned_wheel_on_a_drum_comes_to_its_end() -> None:
    ((_, _, what, how),) = stability.combined_rows(
        ["free wheel, camber, drum, pattern with friction"]
    )
    assert "steps, load" in what
    assert "complementarity" in how
