"""The energy balance of a run: every term counted, standing and rolling."""

import pytest
from tires import soft_torus

from tireroad.runs.stages.contact import _rolling, negligible
from tireroad.runs.stages.stage import Record

SCENE = (
    """
name = "energy"
"""
    + soft_torus(16, 6, order=2)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 25
[contact]
youngs_modulus = 2e7
[road]
kind = "flat"
[road.motion]
kind = "sine"
amplitude = 2e-4
frequency = 60.0
[time]
duration = 0.05
step = 5e-5
[output]
spectra = false
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    """The indicators and warnings of the contact stage, with more of a scene."""
    folder = tmp_path_factory.mktemp("energy")

    def started(name: str, more: str, *sets: str) -> tuple[dict[str, float], list[str]]:
        scene = folder / f"{name}.toml"
        scene.write_text(SCENE + more)
        options = [part for one in sets for part in ("--set", one)]
        entry = ran(scene, folder / name, "--until", "contact", *options)[1]["contact"]
        return {k: v["value"] for k, v in entry["indicators"].items()}, entry["warnings"]

    return started


@pytest.mark.slow
def test_an_undamped_standing_tire_keeps_what_it_takes(run) -> None:
    """Also what the residual flexibility holds, which counted as lost before."""
    found, warnings = run("standing", "[damping]\nmass = 0.0\n")
    work, springs = (
        found["work of contact on the tire"],
        found["energy left in the residual flexibility"],
    )
    assert springs > 0.01 * abs(work)
    assert abs(found["lost"]) < 5e-3 * max(abs(work), found["energy left in the modes"])
    assert not warnings


AIR = """
[tire.cavity]
loss_factor = 0.05
"""
CORNER = """
[axle]
kind = "corner"
wheel_mass = 5.0
body_mass = 30.0
stiffness = [2e5, 0.0, 8e3, 0.0, 0.0, 0.0]
damping = [300.0, 0.0, 600.0, 0.0, 0.0, 0.0]
locked = ["y", "rx", "ry", "rz"]
"""


ATTACHED = '[greens]\nresidual = "attachment"\n'
SLOW = """
[[tire.region]]
dynamic = 1.5
loss_factor = 0.2
exponent = 0.15
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "more",
    [
        "",
        AIR,
        CORNER,
        AIR + CORNER,
        ATTACHED,
        ATTACHED + AIR,
        SLOW,
        AIR + CORNER + SLOW,
        ATTACHED + SLOW,
    ],
    ids=[
        "alone",
        "air",
        "corner",
        "air and corner",
        "attachment",
        "attachment and air",
        "slow rubber",
        "air, corner and slow rubber",
        "attachment and slow rubber",
    ],
)
def test_a_rolling_tire_loses_what_contact_and_drive_put_in(run, more: str) -> None:
    """Also with air, whose own losses count, on a corner, with those of its dampers, and with attachment modes, and rubber
    whose modulus depends on frequency."""
    parts = {"air": AIR, "corner": CORNER, "attached": ATTACHED, "slow": SLOW}
    name = "rolling" + "".join(f"-{part}" for part, text in parts.items() if text in more)
    found, warnings = run(name, "[damping]\nmass = 400.0\n[rotation]\nspeed = 50.0\n" + more)
    lost, drive = (
        found["energy lost in the material"],
        found["work of the drive against the damping"],
    )
    work, off = found["work of contact on the tire"], found["energy that does not add up"]
    left = found["energy left in the modes"] + found["energy left in the residual flexibility"]
    left += found["energy left in slow rubber"]
    assert (found["energy left in slow rubber"] > 0.0) == (SLOW in more)
    left -= found.get("energy in both as the run begins", 0.0)
    beyond = found["energy lost in the modes left out, less their drive"]
    assert work + drive - left - lost - beyond == pytest.approx(off, abs=1e-12)
    assert lost > 0.1 * abs(work)
    assert abs(off) < 0.002 * lost
    # Without that term it would not add up; attachment modes leave little of it.
    term = (
        found["energy lost in slow rubber, part of that in the material"]
        if SLOW in more
        else beyond
    )
    assert abs(off) < (0.3 if ATTACHED in more else 0.2) * abs(term)
    assert not any("add up" in text for text in warnings)


@pytest.mark.parametrize(("scale", "said"), [(1.0, True), (1e-6, False)])
def test_an_imbalance_is_told_where_the_energy_matters(scale: float, said: bool) -> None:
    """Of 500 N on 4 mm, 2 J, a millionth is nothing: 5 % of 0.2 J are told, of 0.2 uJ are not."""
    record = Record()
    slight = negligible(500.0 * 0.004)
    _rolling(record, 0.2 * scale, 0.0, 0.19 * scale, 0.0, 0.0, 0.0, slight)
    assert any("does not add up by 5 %" in text for text in record.warnings) == said


STIFF = (
    "greens.residual=none",
    "contact.youngs_modulus=3.4e8",
    'contact.points="nodes"',
    "road.motion.frequency=150",
    "road.motion.amplitude=5e-4",
    "time.step=4e-4",
)


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["linear", "damped", "constant", "auto"])
def test_a_stiff_tread_on_long_steps_chatters_where_forces_are_linear(run, scheme: str) -> None:
    """The balance fails then; damped forces, which "auto" takes, and constant ones balance with what they take."""
    more = "[damping]\nmass = 100.0\n[rotation]\nspeed = 50.0\n"
    found, warnings = run(f"stiff-{scheme}", more, *STIFF, f"time.scheme={scheme}")
    moved = max(
        abs(found[f"energy {part}"]) for part in ("lost in the material", "that the scheme takes")
    )
    share = abs(found["energy that does not add up"]) / moved
    assert found["steps in the fastest oscillation of the contact"] < 3.0
    failed = any("add up" in text for text in warnings)
    if scheme == "linear":
        assert share > 0.02 and failed
        assert found["energy that the scheme takes"] == 0.0
    else:
        assert not failed
        assert abs(found["energy that the scheme takes"]) > 1e-3 * moved
    assert ("open and close" in found["reason for the scheme"]) == (scheme == "auto")


@pytest.mark.long
def test_a_tire_clear_of_the_road_at_rest_is_hit_by_it(run) -> None:
    """Then the contact points settle without force."""
    clear = ("static.load=", "static.road_height=-0.327", "road.motion.amplitude=8e-3")
    found, _ = run("clear", "[rotation]\nspeed = 40.0\n", *clear)
    assert found["work of contact on the tire"] > 0.0
