"""The scenes in the description of the interface are taken as they stand there."""

import pytest
from full_scene import CONTRACT, REAL_TIRE

from tireroad.runs.cli import main


@pytest.mark.parametrize("text", [CONTRACT, REAL_TIRE], ids=["torus", "real tire"])
def test_check_takes_it(scene_file, tmp_path, monkeypatch, capsys, text: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["check", str(scene_file(text))]) == 0, capsys.readouterr().err
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    for stage in ("static", "modes", "rotating", "greens", "contact", "accuracy", "spectra"):
        assert [stage, "runs"] in lines
