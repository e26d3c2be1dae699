"""check of a road file alone: its figures against the road they were made of."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tireroad.contact.roads.kinds.iso8608 import CLASSES
from tireroad.contact.roads.road import ROADS
from tireroad.contact.roads.under_tire import mean_profile_depth, texture_of
from tireroad.fem.errors import InputError
from tireroad.runs.cli import main
from tireroad.runs.report.input_file import describe_road, iso_class


def test_a_grid_and_a_line(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Both of the same waves: 0.5 mm high and 50 mm long."""
    x = np.arange(0, 2, 1e-3)
    z = 0.5e-3 * np.sin(2 * np.pi * x / 0.05)
    np.savez(tmp_path / "grid.npz", x=x, y=[-0.2, 0.2], z=np.repeat(z[:, None], 2, axis=1))
    rows = "\n".join(
        f"{1e3 * a:.1f};{1e3 * b:.4f}".replace(".", ",") for a, b in zip(x, z, strict=True)
    )
    (tmp_path / "line.csv").write_text("Abstand;Höhe\nmm;mm\n" + rows, encoding="cp1252")
    for name, kind in (("grid.npz", "grid"), ("line.csv", "laser")):
        told = describe_road(tmp_path / name, tmp_path / "out")
        assert f'kind = "{kind}"\nfile = "{tmp_path / name}"' in told
        depth = re.search(r"mean profile depth ([\d.]+) mm", told)
        assert depth and float(depth[1]) == pytest.approx(
            1e3 * (mean_profile_depth(z, 1e-3) or 0), abs=0.01
        )
        assert (tmp_path / "out" / "road.png").stat().st_size > 10_000
    assert main(["check", str(tmp_path / "grid.npz")]) == 0
    assert "[road]" in capsys.readouterr().out


@pytest.mark.parametrize("name", "ACE")
def test_a_random_profile_has_its_class(name: str) -> None:
    road = ROADS.make("iso8608", road_class=name, shortest_wave=0.2, seed=3).make()
    x = 0.02 * np.arange(40_000)
    found = iso_class(texture_of(road.height(x, 0 * x), 0.02))
    assert found is not None and found[0] == name
    assert found[1] == pytest.approx(CLASSES[name], rel=0.3)


def test_refusals(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(InputError, match="no such file"):
        describe_road(tmp_path / "none.crg", tmp_path)
    (tmp_path / "words.csv").write_text("no numbers\nat all\n")
    with pytest.raises(InputError, match="too few"):
        describe_road(tmp_path / "words.csv", tmp_path)
    (tmp_path / "tire.inp").write_text("*NODE\n")
    assert main(["check", str(tmp_path / "tire.inp")]) == 2
    assert "no solid element in it" in capsys.readouterr().err
    (tmp_path / "notes.pdf").write_text("%PDF")
    assert main(["check", str(tmp_path / "notes.pdf")]) == 2
    assert "a tire's deck or mesh (.inp, .msh), or a road file" in capsys.readouterr().err
