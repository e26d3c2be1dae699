"""Keys that state a rubber's law: temperature, hardness, master curve."""

import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps

RADIAL = '[tire]\nsection = "radial"\n'
CURVE = (
    "frequency Hz, storage Pa, loss Pa\n1, 5e6, 1e6\n100, 8e6, 2e6  # measured\n1e4, 14e6, 5e6\n"
)


def scene(tmp_path, text, *overrides):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return load(path, overrides)


def test_a_warm_tire(tmp_path):
    """Pressure by the gas law; the rubber of the contact follows the tread; what is written back is read the same."""
    road = "[static]\nload = 4000\ninflation = 2.2e5\n[contact]\n[road]\nkind = 'flat'\n[time]\nduration = 0.01\n"
    cold, warm = (scene(tmp_path, RADIAL + road, f"temperature={T}") for T in (20, 60))
    assert cold.inflation == cold.static.inflation == warm.static.inflation == 2.2e5
    assert warm.inflation == pytest.approx(263.84e3, rel=1e-4)
    stiffness = warm.contact.law.youngs_modulus / cold.contact.law.youngs_modulus
    tread = warm.tire.shape.rubbers(warm.tire)["tread"]
    both = (tread.at(T) for T in (60.0, 20.0))
    assert stiffness == pytest.approx(
        np.divide(*(one.dynamic * one.law.youngs for one in both)), 1e-5
    )
    assert stiffness < 0.8
    again = scene(tmp_path, dumps(warm))
    assert again == warm
    assert again.inflation == warm.inflation
    with pytest.raises(InputError, match="temperature"):
        scene(tmp_path, RADIAL, "temperature=-60")


def test_what_the_temperature_makes_is_said(tmp_path):
    """And nothing of a tire at 20 degrees C."""
    path, said = tmp_path / "scene.toml", []
    path.write_text(RADIAL + "[static]\ninflation = 2.2e5\n")
    load(path, (), said.append)
    assert not any("temperature" in line for line in said)
    load(path, ("temperature=60",), said.append)
    (line,) = (line for line in said if "temperature" in line)
    assert "220 kPa at 20 °C are 263.8 kPa" in line and "0.0147 f" in line


def test_a_hardness_is_written_back_as_moduli(tmp_path):
    """65 Shore A, of the built-in tire and of a torus, once: what is written back has no hardness."""
    text = '[[tire.region]]\nname = "tread"\nhardness = 70\n'
    found = scene(tmp_path, RADIAL + text)
    tread = found.tire.shape.rubbers(found.tire)["tread"]
    assert tread.law.youngs == pytest.approx(5.55e6, rel=0.02)
    assert tread.law.poisson == 0.49
    assert "\nhardness = " not in dumps(found)
    assert scene(tmp_path, dumps(found)).tire == found.tire
    torus = scene(tmp_path, "[[tire.region]]\nhardness = 70\n").tire
    assert torus.shape.rubbers(torus)["tire.region 0"].law.youngs == pytest.approx(tread.law.youngs)
    with pytest.raises(InputError, match="exclude each other"):
        scene(tmp_path, RADIAL + text + "material = { youngs_modulus = 4e6 }\n")
    with pytest.raises(InputError, match="hardness"):
        scene(tmp_path, RADIAL + text.replace("70", "5"))


def test_a_master_curve(tmp_path):
    """Its moduli are absolute: the dynamic ratio is to the static modulus of the compound."""
    (tmp_path / "curve.csv").write_text(CURVE)
    text = '[[tire.region]]\nname = "skim"\nmaster_curve = "curve.csv"\n'
    found = scene(tmp_path, RADIAL + text)
    skim = found.tire.shape.rubbers(found.tire)["skim"]
    assert skim.dynamic * skim.law.youngs == pytest.approx(8e6)
    assert skim.loss_factor == pytest.approx(0.25)
    assert skim.spectrum.modulus(np.array([1.0])) == pytest.approx(5 / 8)
    assert scene(tmp_path, dumps(found)).tire == found.tire
    assert [str(tmp_path / "curve.csv")] == list(found.tire.curves)
    with pytest.raises(InputError, match="exclude each other"):
        scene(tmp_path, RADIAL + text + "exponent = 0.1\n")
    for wrong, said in (("1, 2\n", "not three"), ("1, a, 2\n1, b, 3\n", "line 2"), ("", "no line")):
        (tmp_path / "curve.csv").write_text(wrong)
        with pytest.raises(InputError, match=said):
            scene(tmp_path, RADIAL + text)
