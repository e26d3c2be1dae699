"""The family of speeds of `bench speeds`: its file is a sweep of that many members, its share a ratio."""

from pathlib import Path

import pytest

from tireroad.runs.sweep.definition import read
from tireroad.tests.bench import speeds


def test_a_family_of_speeds_about_one_static_state(tmp_path: Path, monkeypatch) -> None:
    commands = []

    def took(*command: str) -> float:
        commands.append(command)
        return 70.0 if command[0] == "sweep" else 10.0 * len(commands)

    monkeypatch.setattr(speeds, "_processor_time", took)
    scene, members, together, alone, share = speeds.measured(tmp_path, "passenger", 20)
    assert (scene, members, together) == ("passenger", 20, 70.0)
    assert alone == pytest.approx(20 * (20.0 + 30.0) / 2) and share == pytest.approx(14.0)
    family = read(Path(commands[0][1]))
    loaded = [family.load(member) for member in family.members]
    assert len({scene.rotation.speed for scene in loaded}) == 20
    assert not any(scene.static.steady_rolling for scene in loaded)
    ends = {f"rotation.speed={scene.rotation.speed}" for scene in (loaded[0], loaded[-1])}
    assert ends == {part for command in commands[1:] for part in command if "speed=" in part}
    assert all("--fresh" in command and speeds.SHAPE in command for command in commands[1:])
