"""What the packages export is there, explained with its units, and cheap to import."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from runpy import run_path

import pytest

from tireroad.fem import InputError, Torus, Turning, compound
from tireroad.modal import StrainEnergy

PACKAGES = ("fem", "modal", "greens", "contact")
UNIT = re.compile(r"\b(m|m2|N|Pa|Hz|rad|s|kg|K|degrees)\b|1/s|N/m|kg\^")
NAMES = [
    (package, name) for package in PACKAGES for name in import_module(f"tireroad.{package}").__all__
]


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_every_name_is_there_with_its_docstring(package: str, name: str) -> None:
    found = getattr(import_module(f"tireroad.{package}"), name)
    assert inspect.getdoc(found), f"{package}.{name} has no docstring"
    if isinstance(found, type) and issubclass(found, Exception):
        return
    text = inspect.getdoc(found) + str(inspect.getdoc(getattr(found, "__init__", None)))
    takes = [p for p in inspect.signature(found).parameters.values() if _number(p)]
    if takes:
        assert UNIT.search(text), f"{package}.{name} takes {takes[0]} and names no unit"


def test_every_name_is_on_the_page(root: Path) -> None:
    page = run_path(str(root / "docs" / "public_names.py"))["page"]()
    assert page.count("\n### ") == len(NAMES)
    assert "Proportional(mass: float = 0.0, stiffness: float = 0.0)" in page


def _number(parameter: inspect.Parameter) -> bool:
    return str(parameter.annotation).strip("'").split(" | ")[0] == "float"


@pytest.mark.parametrize("package", PACKAGES)
def test_an_unknown_name_is_an_attribute_error(package: str) -> None:
    module = import_module(f"tireroad.{package}")
    assert set(module.__all__) <= set(dir(module))
    beside = {file.stem for file in Path(module.__path__[0]).iterdir()}
    assert not beside & set(module.__all__), "a module of that name would take the name's place"
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        module.nothing  # noqa: B018


def test_the_packages_import_without_finite_elements(root: Path) -> None:
    script = (
        "import sys, tireroad.fem, tireroad.modal, tireroad.greens, tireroad.contact\n"
        "heavy = {'dolfinx', 'petsc4py', 'mpi4py', 'scipy', 'numpy', 'h5py'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        env={"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr


SIZES = {"outer_radius": 0.32, "minor_radius": 0.10, "thickness": 0.012, "half_angle": 2.0}
MESH = {"segments": 10, "elements_arc": 6, "elements_thickness": 1, "order": 2}


@pytest.mark.parametrize(
    "wrong",
    [
        {"half_angle": 120.0},  # degrees
        {"half_angle": 0.0},
        {"thickness": 0.2},
        {"minor_radius": 0.01},
        {"outer_radius": float("nan")},
        {"outer_radius": "wide"},
        {"segments": 7.5},
        {"segments": True},
        {"segments": 0},
        {"elements_arc": 6.5},
        {"elements_arc": 0},
        {"elements_thickness": 0},
        {"order": 4},
        {"footprint_size": 0},
        {"footprint_size": 2},
        {"footprint_size": float("nan")},
    ],
)
def test_a_torus_refuses_what_is_none(wrong: dict[str, object]) -> None:
    Torus(**SIZES, **MESH)
    with pytest.raises(InputError, match="torus"):
        Torus(**(SIZES | MESH | wrong))


@pytest.mark.parametrize(
    "wrong", [{"poisson_ratio": 0.5}, {"poisson_ratio": -1.0}, {"youngs_modulus": 0.0}]
)
def test_a_rubber_without_stiffness_or_volume_change_is_refused(wrong: dict[str, float]) -> None:
    good = {"youngs_modulus": 5e6, "poisson_ratio": 0.49}
    compound("neo-hookean", 1200.0, **good)
    with pytest.raises(InputError):
        compound("neo-hookean", 1200.0, **(good | wrong))
    with pytest.raises(InputError, match="density"):
        compound("neo-hookean", 0.0, **good)


@pytest.mark.parametrize(
    "wrong", [(-500.0, 0.0), (0.0, -1e-5), (float("nan"), 0.0), (500.0,), 500.0, "soft", None]
)
def test_damping_is_two_numbers_that_take_energy(wrong: object) -> None:
    Turning(damping=(500, 1e-5))
    Turning(damping=StrainEnergy())
    with pytest.raises(InputError, match=r"damping = .* must be two numbers"):
        Turning(damping=wrong)
