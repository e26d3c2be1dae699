"""A tire's figures as a .tir file, the form of MF-Tyre/MF-Swift, from a result folder.

What a run computed is written, and nothing else: a key that is absent was not computed. Modes and
damping are those of the belt as a rigid ring on its rim without a road, by Fourier series around
(fem.sections.inflated), with the laws' moduli at zero strain; the belt's mass and inertias are what
moves with these modes. Meanings: Besselink, Schmeitz and Pacejka, "An improved Magic Formula/Swift
tyre model", Vehicle System Dynamics 48 S1 (2010) 337-352.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.runs.files.store import opened
from tireroad.runs.files.tir import UNITS
from tireroad.runs.fit import KINDS
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.version import PROGRAM, VERSION

Row = tuple[str, float | str, str]
_NEEDS_STIFFNESS = (
    "VERTICAL_STIFFNESS, the curves of load, effective rolling radius and footprint, and the horizontal stiffnesses "
    "are left out: add [stiffness] to the scene and run it again"
)
_STATIC = (
    "mass",
    "load",
    "deflection",
    "inflation",
    "rolling_radius",
    "footprint_length",
    "footprint_width",
)
_UNITS = "LENGTH", "FORCE", "ANGLE", "MASS", "TIME"
_STIFF = "load", "vertical", "longitudinal", "lateral", "torsional"


def written(
    directory: Path, others: Mapping[str, str], remark: Callable[[str], None] = lambda text: None
) -> str:
    """The text of the file. Raises InputError without a static state. Not collective.

    `others`: results in the folder that are of an earlier run. `remark` is told what is left out because the
    run did not compute it.
    """
    path = directory / "static.h5"
    if not path.exists() or path.name in others:
        raise InputError(f"{directory}: no static.h5: a run up to the static state is needed")
    scene = load(directory / "scene.toml", [], lambda remark: None, "static")
    with opened(path) as file:
        static = {key: float(file.attrs[key]) for key in _STATIC if key in file.attrs}
    stiff = None if "stiffness.h5" in others else directory / "stiffness.h5"
    sections = dict(_sections(scene, static, stiff))
    if not sections["CONTACT_PATCH"]:
        remark(_NEEDS_STIFFNESS)
    if not sections["VERTICAL"]:
        remark("FNOMIN is left out: the run has no load (static.load, deflection or road_height)")
    if all(name != "BELT_MASS" for name, *_ in sections["INERTIA"]):
        remark("the modes and the belt are left out: the tire's inflation does not settle")
    lines = [
        "$ "
        + f"{scene.name}: computed by {PROGRAM} {VERSION}; keys that are absent were not computed",
        "[MDI_HEADER]",
        "FILE_TYPE                = 'tir'",
        "FILE_VERSION             = 3.0",
        "FILE_FORMAT              = 'ASCII'",
        "[UNITS]",
        *(f"{key:24s} = '{UNITS[key][0]}'" for key in _UNITS),
    ]
    for name, rows in sections.items():
        copied = list(rows)
        if copied:
            lines.append(f"[{name}]")
            lines += [
                f"{key:24s} = {_shown(value)}".ljust(48) + f" $ {text}"
                for key, value, text in copied
            ]
    return "\n".join(lines) + "\n"


def _shown(value: float | str) -> str:
    return f"'{value}'" if isinstance(value, str) else f"{value:.8g}"


def _sections(
    scene: Scene, static: dict[str, float], stiff: Path | None
) -> Iterator[tuple[str, list[Row]]]:
    model: list[Row] = [
        ("FITTYP", 61.0, "-, parameters as those of MF-Tyre/MF-Swift 6.1"),
        ("TYRESIDE", "SYMMETRIC", "-"),
    ]
    if scene.rotation is not None:
        turning = scene.rotation.speed * static.get("rolling_radius", 0.0)
        if travels := scene.rotation.travel_speed or turning:
            model.append(("LONGVL", travels, "m/s, travelling speed of the run"))
    yield "MODEL", model
    mesh = scene.tire.ring().section
    radius, width = float(mesh.nodes[:, 0].max()), float(np.ptp(mesh.nodes[:, 1]))
    rim = float(mesh.nodes[np.unique(mesh.side(mesh.rim)), 0].min())
    yield (
        "DIMENSION",
        [
            ("UNLOADED_RADIUS", radius, "m, before inflation"),
            ("WIDTH", width, "m, of the section"),
            ("RIM_RADIUS", rim, "m, where the rim holds the tire"),
            ("ASPECT_RATIO", (radius - rim) / width, "-"),
        ],
    )
    yield (
        "OPERATING_CONDITIONS",
        [("INFLPRES", static["inflation"], "Pa"), ("NOMPRES", static["inflation"], "Pa")],
    )
    ring = _ring(scene)
    modes = {mode.name: mode for mode in ring.rigid_modes()} if ring else {}
    inertia: list[Row] = [("MASS", static["mass"], "kg, of the tire")]
    if modes:
        inertia += [
            ("BELT_MASS", modes["vertical"].inertia, "kg, that moves with the vertical mode"),
            ("BELT_IXX", modes["yaw"].inertia, "kg m2, about a diameter"),
            ("BELT_IYY", modes["windup"].inertia, "kg m2, about the axle"),
        ]
    yield "INERTIA", inertia
    load = static.get("load", 0.0)
    vertical: list[Row] = [("FNOMIN", load, "N, of the run")] if load > 0 else []
    structural: list[Row] = []
    patch: list[Row] = []
    if stiff is not None and stiff.exists():
        with opened(stiff) as file:
            stiffness = {name: float(file[name][()]) for name in _STIFF if name in file}
            curve = {name: file[f"curve/{name}"][:] for name in file["curve"]}
        vertical = [
            ("FNOMIN", stiffness["load"], "N, at which stiffness holds"),
            *_vertical(stiffness, curve, radius),
        ]
        for name, key in (
            ("longitudinal", "LONGITUDINAL"),
            ("lateral", "LATERAL"),
            ("torsional", "YAW"),
        ):
            if name in stiffness:
                unit = "N m/rad" if name == "torsional" else "N/m"
                structural.append(
                    (f"{key}_STIFFNESS", stiffness[name], f"{unit}, standing, sticking footprint")
                )
        patch = _patch(stiffness, curve, radius, width)
    yield "VERTICAL", vertical
    for name, mode in modes.items():
        structural.append(
            (
                KINDS[f"{name}_frequency"].tir,
                mode.frequency,
                f"Hz, {KINDS[f'{name}_frequency'].doc}",
            )
        )
        structural.append((KINDS[f"{name}_damping"].tir, mode.damping, "-, damping ratio"))
    yield "STRUCTURAL", structural
    yield "CONTACT_PATCH", patch


def _vertical(
    stiffness: dict[str, float], curve: dict[str, np.ndarray], radius: float
) -> list[Row]:
    """Stiffness and the curves of load and effective rolling radius.

    F = F0 (Q_FZ1 d + Q_FZ2 d^2) with d = deflection / R; R_e = R - F0 / C (D atan(B f) + E f), f = F / F0.
    """
    load, slope = stiffness["load"], stiffness["vertical"]
    rows: list[Row] = [("VERTICAL_STIFFNESS", slope, "N/m, slope at FNOMIN")]
    if len(curve["load"]) >= 3:
        d = curve["deflection"] / radius
        linear, square = np.linalg.lstsq(
            np.column_stack([d, d**2]), curve["load"] / load, rcond=None
        )[0]
        rows += [("Q_FZ1", float(linear), "-, load over deflection"), ("Q_FZ2", float(square), "-")]
        rows += _rolling(curve["load"] / load, curve["rolling_radius"], radius, load / slope)
    return rows


def _rolling(share: np.ndarray, rolling: np.ndarray, radius: float, unit: float) -> list[Row]:
    from scipy.optimize import least_squares

    known = np.isfinite(rolling)
    if known.sum() < 4:
        return []
    f, sunk = share[known], (radius - rolling[known]) / unit

    def off(at: np.ndarray) -> np.ndarray:
        offset, b, d, e = at
        return offset + d * np.arctan(b * f) + e * f - sunk

    coefficients = least_squares(off, [0.0, 8.0, 0.25, 0.05]).x
    text = "-, effective rolling radius over load"
    return [
        (
            "Q_RE0",
            float(1 - coefficients[0] * unit / radius),
            "-, free rolling radius over UNLOADED_RADIUS",
        ),
        ("BREFF", float(coefficients[1]), text),
        ("DREFF", float(coefficients[2]), text),
        ("FREFF", float(coefficients[3]), text),
    ]


def _patch(
    stiffness: dict[str, float], curve: dict[str, np.ndarray], radius: float, width: float
) -> list[Row]:
    """Half length R (Q_RA2 x + Q_RA1 sqrt x), half width w (Q_RB2 x + Q_RB1 x^(1/3)), x = F / (C R)."""
    x = curve["load"] / (stiffness["vertical"] * radius)
    rows: list[Row] = []
    for letter, values, size, power in (
        ("A", curve["footprint_length"], radius, 1 / 2),
        ("B", curve["footprint_width"], width, 1 / 3),
    ):
        known = np.isfinite(values) & (values > 0)
        if known.sum() < 2:
            continue
        table = np.column_stack([x[known] ** power, x[known]])
        first, second = np.linalg.lstsq(table, values[known] / 2 / size, rcond=None)[0]
        what = "half length" if letter == "A" else "half width"
        rows += [
            (
                f"Q_R{letter}1",
                float(first),
                f"-, {what} of the footprint over load, to {curve['load'].max():.5g} N",
            ),
            (f"Q_R{letter}2", float(second), "-"),
        ]
    return rows


class _AsRun:
    """Section, compounds and cords of the ring of a scene; laws of rubber by their moduli at zero strain."""

    def __init__(self, scene: Scene) -> None:
        shape = scene.tire.shape
        self._mesh = scene.tire.ring().section
        self.cords = shape.cords(scene.tire)
        layers = shape.in_layers(scene.tire)
        compounds = {name: layer.at(scene.temperature) for name, layer in layers.items()}
        self.compounds = {
            name: {
                "youngs_modulus": compound.law.youngs,
                "poisson_ratio": compound.law.poisson,
                "density": compound.density,
                "dynamic": compound.dynamic,
                "loss_factor": compound.loss_factor,
                "spectrum": compound.spectrum,
            }
            for name, compound in compounds.items()
        }

    def section(self, elements: int, order: int) -> SectionMesh:
        """The scene's own mesh."""
        return self._mesh


def _ring(scene: Scene) -> InflatedRing | None:
    """The tire of the scene by Fourier series around; None where its inflation does not settle."""
    try:
        return InflatedRing(_AsRun(scene), 0, 0, scene.inflation)
    except ConvergenceError:
        return None
