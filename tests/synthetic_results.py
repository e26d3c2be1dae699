"""A result folder as a finished run leaves it, from closed forms: no solver, no mesh."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray
from synthetic_scene import SCENE

from tireroad.runs.files.disk import BLOCK, seal, signed

CROWN, SECTION, HALF_ARC, ROAD = 0.32, 0.10, np.radians(120.0), -0.309


@contextmanager
def sealed(path: Path, mode: str = "w") -> Iterator[h5py.File]:
    """A file, new or changed (mode "a"), with the checksum that a run gives it."""
    block = {"userblock_size": BLOCK} if mode == "w" else {}
    with h5py.File(path, mode, **block) as file:
        yield file
    seal(path)


def put(file: h5py.File, name: str, values: NDArray, unit: str, **storage: object) -> None:
    file.create_dataset(name, data=values, **storage).attrs["unit"] = unit


def provenance(file: h5py.File, stage: str) -> None:
    libraries = json.dumps({"h5py": h5py.__version__, "numpy": np.__version__})
    file.attrs.update(program="tireroad", version="0.1.0", format=1, libraries=libraries)
    file.attrs.update(processes=2, scene_name="synthetic-torus", scene=SCENE)
    file.attrs.update(stage=stage, input_hash="0f" * 32)


def lattice(around: int, across: int) -> tuple[NDArray, NDArray]:
    """Torus nodes (around·across, 3) m and the corners of its quads."""
    theta = 2 * np.pi * np.arange(around) / around
    arc = np.linspace(-HALF_ARC, HALF_ARC, across)
    angle, phi = np.meshgrid(theta, arc, indexing="ij")
    radius = CROWN - SECTION + SECTION * np.cos(phi)
    points = np.stack((radius * np.sin(angle), SECTION * np.sin(phi), -radius * np.cos(angle)), -1)
    number = np.arange(around * across).reshape(around, across)
    after = np.roll(number, -1, axis=0)
    corners = (number[:, :-1], after[:, :-1], after[:, 1:], number[:, 1:])
    return points.reshape(-1, 3), np.stack(corners, -1).reshape(-1, 4)


def write_static(path: Path, around: int, across: int) -> NDArray:
    """static.h5; returns the deformed positions of its contact points (c, 3) m."""
    points, quads = lattice(around, across)
    displacement = 0.004 * points / np.linalg.norm(points, axis=1)[:, None]
    deformed = points + displacement
    below = np.maximum(ROAD - deformed[:, 2], 0.0)
    displacement[:, 2] += below
    near = np.flatnonzero(ROAD - deformed[:, 2] > -0.01)
    force = np.zeros((near.size, 3))
    force[:, 2] = 500.0 * below[near] / below[near].sum()
    touching = (points + displacement)[near]
    with sealed(path) as file:
        provenance(file, "static")
        file.attrs.update(load=500.0, deflection=0.015, inflation=2.0e5, touch_height=-0.324)
        file.attrs.update(
            road_height=ROAD,
            rolling_radius=0.316,
            footprint_length=0.14,
            footprint_width=0.08,
            footprint_area=0.009,
        )
        put(file, "mesh/points", points, "m")
        put(file, "displacement", displacement, "m")
        put(file, "surface/points", points, "m")
        put(file, "surface/displacement", displacement, "m")
        put(file, "surface/quads", quads, "-")
        put(file, "contact/index", near, "-")
        put(file, "contact/gap", np.maximum(touching[:, 2] - ROAD, 0.0), "m")
        put(file, "contact/area", np.full(near.size, 2 * np.pi * 0.32 / around * 0.013), "m2")
        put(file, "contact/points", touching, "m")
        put(file, "contact/force", force, "N")
    return touching


def write_modes(path: Path, around: int, across: int, count: int) -> None:
    points, _ = lattice(around, across)
    theta = np.arctan2(points[:, 0], -points[:, 2])
    radial = points / np.linalg.norm(points, axis=1)[:, None]
    waves = np.arange(count) // 2
    shape = np.stack(
        [np.cos(n * theta + 1.6 * (q % 2))[:, None] * radial for q, n in enumerate(waves)]
    )
    frequency = 60.0 + 9.0 * np.arange(count) ** 1.1
    with sealed(path) as file:
        provenance(file, "modes")
        file.attrs.update(inertia_count=count, rigid_modes=0)
        put(file, "frequency", frequency, "Hz")
        put(file, "residual", np.full(count, 3e-11), "-")
        put(file, "surface/points", points, "m")
        put(file, "surface/shape", shape, "kg^-1/2")
        write_names(file, [f"R{n}" for n in waves], waves)
        put(file, "damping", 250.0 / (2 * np.pi * frequency), "-")
        mass = np.where((waves == 1)[:, None], [[6.0, 0.0, 0.0, 0.0, 0.001, 0.0]], 0.0)
        put(file, "effective_mass", mass, "kg, kg m2")


def write_names(file: h5py.File, names: list[str], waves: NDArray) -> None:
    put(file, "name", np.array(names, dtype=h5py.string_dtype()), "-")
    motion = ["in plane, symmetric"] * len(names)
    put(file, "motion", np.array(motion, dtype=h5py.string_dtype()), "-")
    put(file, "wave_number", waves, "-")
    put(file, "wave_share", np.full(len(names), 0.9), "-")
    put(file, "nodal_lines", np.zeros(len(names), int), "-")


def write_rotating(path: Path, count: int, unstable: bool = False) -> None:
    frequency = np.repeat(60.0 + 9.0 * np.arange(count) ** 1.1, 2) + np.tile((4.0, -4.0), count)
    decay = np.full(frequency.size, -250.0)
    decay[0] = 12.0 if unstable else -240.0
    eigenvalue = np.concatenate((decay + 2j * np.pi * frequency, decay - 2j * np.pi * frequency))
    with sealed(path) as file:
        provenance(file, "rotating")
        file.attrs.update(speed=50.0, basis_condition=42.0, first_unstable=2 * int(unstable))
        put(file, "eigenvalue", eigenvalue, "1/s")
        put(file, "frequency", eigenvalue.imag / (2 * np.pi), "Hz")
        put(file, "residual", np.full(eigenvalue.size, 1e-12), "-")
        put(file, "left_residual", np.full(eigenvalue.size, 2e-12), "-")
        waves = np.tile(np.repeat(np.arange(count) // 2, 2), 2)
        ways = np.tile(("+", "-"), eigenvalue.size // 2)
        write_names(file, [f"R{n}{way}" for n, way in zip(waves, ways, strict=True)], waves)
        put(file, "damping", -eigenvalue.real / np.abs(eigenvalue), "-")


def write_contact(path: Path, points: NDArray, steps: int) -> None:
    time = 2.5e-5 * np.arange(1, steps + 1)
    noise = np.random.default_rng(4).standard_normal((3, steps))
    excitation = np.array((20.0, 4.0, 60.0))[:, None] * np.sin(2 * np.pi * 87.0 * time) + 3 * noise
    normal = np.exp(-((points[:, 0] / 0.05) ** 2 + (points[:, 1] / 0.03) ** 2)) - 0.3
    shift = 0.8 + 0.4 * np.sin(2 * np.pi * (40.0 * time[:, None] + 6.0 * points[:, 0]))
    force = np.maximum(normal * shift, 0.0) * 500.0 / np.maximum(normal, 0.0).sum()
    total = np.stack((excitation[0], excitation[1], force.sum(axis=1)), -1)
    axle = total + np.stack((excitation[1], excitation[0], excitation[2]), -1)
    storage = {"chunks": (min(64, steps), points.shape[0]), "compression": "gzip"}
    with sealed(path) as file:
        provenance(file, "contact")
        file.attrs.update(road="cobblestones", step=2.5e-5, scheme="linear", speed=50.0)
        put(file, "time", time, "s")
        put(file, "points", points, "m")
        put(file, "normal_force", force, "N", **storage)
        put(file, "total_force", total, "N")
        put(file, "axle_force", axle, "N")
        put(file, "active", (force > 0).sum(axis=1), "-")
        put(file, "displacement", 1e-4 * force, "m", **storage)
        put(file, "gap", np.where(force > 0, 0.0, 1e-3), "m", **storage)
        put(file, "residual", np.full(steps, 1e-13), "-")


def write_spectra(path: Path, lines: int) -> None:
    frequency = 4.0 * np.arange(lines)
    peak = 1.0 / (1.0 - (frequency / 87.0) ** 2 + 0.1j * frequency / 87.0)
    force = peak[:, None] * np.array((0.4, 0.05, 1.5))
    centre = 1000.0 * 10.0 ** (np.arange(-15, 6) / 10.0)
    level = 20 * np.log10(np.abs(1 / (1 - (centre / 87.0) ** 2 + 0.1j)))[:, None] + [
        0.0,
        -18.0,
        9.0,
    ]
    with sealed(path) as file:
        provenance(file, "spectra")
        put(file, "frequency", frequency, "Hz")
        put(file, "axle_force", force, "N")
        put(file, "contact_force", 2 * force, "N")
        put(file, "third_octave/centre", centre, "Hz")
        put(file, "third_octave/level", level, "dB re 1 N")


def write_response(path: Path, steps: int) -> None:
    time = 1e-4 * np.arange(1, steps + 1)
    frequency = np.arange(1.0, 251.0) * 2.0
    force = np.stack((np.sin(2 * np.pi * 5.0 * time), np.ones(steps)), -1)
    moved = 1e-6 * force[:, :, None] * np.array((0.1, 0.02, 1.0))
    plain = 1e-6 / (1 - (frequency / 91.0) ** 2 + 0.08j * frequency / 91.0)
    receptance = plain[:, None, None] * np.array(((1.0, 0.3), (0.3, 0.8)))
    with sealed(path) as file:
        provenance(file, "response")
        put(file, "time", time, "s")
        put(file, "force", force, "N")
        put(file, "displacement", moved, "m")
        put(file, "frequency", frequency, "Hz")
        put(file, "receptance", receptance, "m/N")
        put(file, "axle_force", force @ np.ones((2, 3)), "N")


def summary() -> dict[str, object]:
    def stage(
        seconds: float, headline: dict, indicators: dict, **more: object
    ) -> dict[str, object]:
        quantities = {"headline": headline, "indicators": indicators}
        named = {
            key: {name: {"value": v, "unit": u} for name, (v, u) in group.items()}
            for key, group in quantities.items()
        }
        extra = {"status": "computed", "reason": "", "warnings": [], "cost": {}} | more
        return {"seconds": seconds, **named, **extra}

    skipped = {"status": "skipped", "reason": "the scene has no [stiffness] table"}
    stages = {
        "static": stage(
            14.2,
            {"load": (500.0, "N"), "deflection": (0.015, "m"), "rolling radius": (0.316, "m")},
            {"equilibrium residual": (3.1e-12, "-"), "complementarity": (0.0, "N")},
            cost={"assembly": 6.0, "factorisation": 7.1},
        ),
        "modes": stage(
            19.8,
            {"modes": (40, "-"), "lowest frequency": (61.3, "Hz")},
            {"largest residual": (3e-11, "-")},
            status="reused",
            reason="same mesh, load and material as before",
        ),
        "rotating": stage(0.4, {"basis condition": (42.0, "-")}, {"identity": (4e-11, "-")}),
        "greens": stage(1.2, {"contact points": (250, "-")}, {"reciprocity": (1e-10, "-")}),
        "stiffness": stage(0.0, {}, {}, **skipped),
        "response": stage(0.3, {}, {}),
        "contact": stage(
            8.3,
            {"steps": (10000, "-"), "greatest force": (731.2, "N"), "step": (2.5e-5, "s")},
            {"complementarity residual": (2e-13, "-")},
            warnings=["in 12 steps the tire left the road & the load was <zero>"],
            cost={"recursion": 5.0, "complementarity": 2.9},
        ),
        "spectra": stage(0.1, {"axle force, rms": (42.0, "N")}, {"momentum": (1e-3, "-")}),
    }
    program = {"name": "tireroad", "version": "0.1.0"}
    return {"program": program, "scene": "synthetic-torus", "processes": 2, "stages": stages}


def write_results(
    directory: Path, around: int = 40, across: int = 9, steps: int = 400, modes: int = 10
) -> Path:
    """Fills `directory` with every file of the contract; returns it."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "scene.toml").write_text(signed(SCENE))
    (directory / "summary.json").write_text(json.dumps(summary()))
    touching = write_static(directory / "static.h5", around, across)
    write_modes(directory / "modes.h5", around, across, modes)
    write_rotating(directory / "rotating.h5", modes)
    write_contact(directory / "contact.h5", touching, steps)
    write_spectra(directory / "spectra.h5", 500)
    write_response(directory / "response.h5", steps)
    return directory
