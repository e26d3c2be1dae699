"""Exports for other programs: CSV for spreadsheets, and XDMF (runs/files/xdmf.py) for ParaView."""

from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import heard, nominal
from tireroad.fem.errors import InputError
from tireroad.runs.files import xdmf
from tireroad.runs.files.disk import replacing
from tireroad.runs.files.present import left_out
from tireroad.runs.files.store import opened

AXES = ("x", "y", "z")
NAMES = {  # levels in third_octave/ whose names do not give the quantity
    "level": "axle force level",
    "level_a_weighted": "axle force level a weighted",
    "level_error": "error of the axle force level",
    "contact_level": "contact force level",
    "contact_level_a_weighted": "contact force level a weighted",
    "contact_level_error": "error of the contact force level",
}
MADE = {
    *(f"{name}.csv" for name in ("footprint", "modes", "contact_force", "spectra", "third_octave")),
    *(f"{name}.csv" for name in ("density", "response", "receptance", "vibration")),
    *(f"{name}.xdmf" for name in ("static", "modes", "contact", "motion")),
    *(f"{name}_fields.h5" for name in ("static", "modes", "contact", "motion")),
}
"""The names of all files that an export may write."""
Columns = dict[str, NDArray]  # heading with unit -> values (n)


def export(directory: Path) -> list[Path]:
    """Write directory/export/*.csv and *.xdmf from the existing result files; returns the paths.

    XDMF files refer to the HDF5 results beside `export` and copy no data: do not move that folder.
    Every CSV column names its unit. Each file is written to a temporary name and renamed. Results
    of an earlier run in the folder are left out, and what an earlier export made of them is
    removed. Not collective: call it on one process. Raises InputError if there is nothing to
    export, a result file is damaged (then nothing is written), or `export` cannot be written.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is no folder: give the result folder of a run")
    files: dict[str, Callable[[Path], object]] = {}
    others = left_out(directory)
    for name, reader in READERS.items():
        if (directory / name).is_file() and name not in others:
            files |= _read(directory / name, reader)
    if not files:
        raise InputError(
            f"{directory} holds nothing to export (none of {', '.join(READERS)}): "
            "give the result folder of a run"
        )
    folder = directory / "export"
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: the folder cannot be made ({error.strerror})") from error
    for name, write in files.items():
        with replacing(folder / name) as part:
            write(part)
    for name in MADE - files.keys():
        (folder / name).unlink(missing_ok=True)
    return [folder / name for name in files]


def _read(path: Path, reader: Callable[[h5py.File], dict]) -> dict:
    with opened(path) as file:
        return reader(file)


def write_csv(path: Path, columns: Columns) -> None:
    """One row of headings, then the numbers to 10 digits, separated by commas; empty where NaN."""
    values, rows = np.column_stack(list(columns.values())), BytesIO()
    np.savetxt(rows, values, fmt="%.10g", delimiter=",")
    header = ",".join(f'"{heading}"' for heading in columns) + "\n"
    path.write_bytes(header.encode() + rows.getvalue().replace(b"nan", b""))


def _table(name: str, columns: Columns) -> dict[str, Callable[[Path], object]]:
    return {name: partial(write_csv, columns=columns)}


def _components(name: str, values: NDArray, unit: str) -> Columns:
    """Columns of a vector (n, 3); a complex vector gives real and imaginary parts."""
    columns: Columns = {}
    for axis, column in zip(AXES, values.T, strict=True):
        columns |= _parts(f"{name} {axis}", column, unit)
    return columns


def _parts(name: str, values: NDArray, unit: str) -> Columns:
    if not np.iscomplexobj(values):
        return {f"{name} [{unit}]": values}
    return {f"Re {name} [{unit}]": values.real, f"Im {name} [{unit}]": values.imag}


def modes(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """modes.csv: number, frequency, residual; modes.xdmf: the first shapes."""
    frequency = file["frequency"][()]
    columns = {"mode": np.arange(1, len(frequency) + 1), "frequency [Hz]": frequency}
    columns["residual [-]"] = file["residual"][()]
    return _table("modes.csv", columns) | _page(xdmf.modes(file))


def static(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """footprint.csv: deformed contact points and their forces; static.xdmf: the loaded surface."""
    files = _page(xdmf.static(file))
    if "contact/points" not in file or not len(file["contact/points"]):  # a tire without a road
        return files
    points, force = file["contact/points"][()], file["contact/force"][()]
    columns = _components("position", points, "m") | _components("force", force, "N")
    return _table("footprint.csv", columns) | files


def contact(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """contact_force.csv: total force, axle force and hub moments over time; contact.xdmf."""
    columns = {"time [s]": file["time"][()]}
    columns |= _components("contact force", file["total_force"][()], "N")
    if "axle_force" in file:
        columns |= _components("axle force", file["axle_force"][()], "N")
    if "hub_moment" in file:
        columns |= _components("hub moment", file["hub_moment"][()], "N m")
    if "active" in file:
        columns["points in contact [-]"] = file["active"][()]
    return _table("contact_force.csv", columns) | _page(xdmf.contact(file))


def spectra(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """spectra.csv: complex spectra; third_octave.csv: all levels, with errors; density.csv."""
    columns = {"frequency [Hz]": file["frequency"][()]}
    for name, unit in (("axle_force", "N"), ("contact_force", "N"), ("hub_moment", "N m")):
        if name in file:
            columns |= _components(name.replace("_", " "), file[name][()], unit)
    files = _table("spectra.csv", columns)
    if "third_octave/centre" in file:
        files |= _table("third_octave.csv", bands(file["third_octave"]))
    if "density/frequency" in file:
        over, group = file["density/frequency"], file["density"]
        files |= _table("density.csv", {"frequency [Hz]": over[()]} | _spread(group, over))
    return files


def bands(group: h5py.Group) -> Columns:
    """Levels by band: nominal frequency (IEC 61260), exact centre, a column per component."""
    centre = group["centre"][()]
    columns = {"band [Hz]": nominal(centre), "exact centre of the band [Hz]": centre}
    if "confidence" in group:
        low, high = group["confidence"][()].T
        columns["lines in the band [-]"] = group["lines"][()]
        columns |= {"95 % of the process from [dB]": low, "95 % of the process to [dB]": high}
    return columns | _spread(group, group["centre"])


def _spread(group: h5py.Group, over: h5py.Dataset) -> Columns:
    """Columns of the vectors (n, 3), or (n, k, 3) at k points, in a group with abscissa `over`."""
    columns: Columns = {}
    for name, held in group.items():
        if held.ndim < 2 or held.shape[-1] != 3 or len(held) != len(over):
            continue
        points = held.shape[1] if held.ndim > 2 else 1
        label, values = NAMES.get(name, name.replace("_", " ")), held[()].reshape(-1, points, 3)
        for point in range(points):
            place = f" {point + 1}" if held.ndim > 2 else ""
            unit, column = held.attrs["unit"], values[:, point]
            if unit.startswith("dB"):
                column = heard(column)
            columns |= _components(label + place, column, unit)
    return columns


def response(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """response.csv: force, displacement, axle force over time; receptance.csv over frequency."""
    files: dict[str, Callable[[Path], object]] = {}
    if "time" in file:
        columns = {"time [s]": file["time"][()]}
        force, moved = file["force"][()], file["displacement"][()]
        for point in range(moved.shape[1]):
            columns[f"force {point + 1} [N]"] = force[:, point]
            columns |= _components(f"displacement {point + 1}", moved[:, point], "m")
        if "axle_force" in file:
            columns |= _components("axle force", file["axle_force"][()], "N")
        if "hub_moment" in file:
            columns |= _components("hub moment", file["hub_moment"][()], "N m")
        files |= _table("response.csv", columns)
    if "receptance" in file:
        columns, values = {"frequency [Hz]": file["frequency"][()]}, file["receptance"][()]
        for i, j in np.ndindex(values.shape[1:]):
            columns |= _parts(f"receptance {i + 1},{j + 1}", values[:, i, j], "m/N")
        files |= _table("receptance.csv", columns)
    return files


def vibration(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """vibration.csv: third-octave levels of the outer face."""
    names = {
        "velocity level [dB re 1 nm/s]": "velocity_level",
        "velocity level, A-weighted [dB(A) re 1 nm/s]": "velocity_level_a_weighted",
        "radiated power [dB re 1 pW]": "radiated_power_level",
        "radiated power, A-weighted [dB(A) re 1 pW]": "radiated_power_level_a_weighted",
    }
    centre = file["third_octave/centre"][()]
    columns = {"band [Hz]": nominal(centre), "exact centre of the band [Hz]": centre}
    columns |= {label: heard(file[f"third_octave/{name}"][()]) for label, name in names.items()}
    return _table("vibration.csv", columns)


def motion(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """motion.xdmf: the outer face over time, for ParaView."""
    return _page(xdmf.motion(file))


def _page(page: xdmf.Page | None) -> dict[str, Callable[[Path], object]]:
    """A page and, if needed, its file of fields."""
    if page is None:
        return {}
    files: dict[str, Callable[[Path], object]] = {
        f"{page.name}.xdmf": partial(Path.write_text, data=page.text, encoding="utf-8")
    }
    return files | ({page.beside: page.write_fields} if page.rows or page.arrays else {})


READERS: dict[str, Callable[[h5py.File], dict[str, Callable[[Path], object]]]] = {
    "static.h5": static,
    "modes.h5": modes,
    "contact.h5": contact,
    "spectra.h5": spectra,
    "response.h5": response,
    "vibration.h5": vibration,
    "motion.h5": motion,
}
