"""Exports for other programs: CSV, XDMF and Universal File 58.

XDMF pages (ParaView, pyvista, meshio) refer to the HDF5 results and copy no data. A page is a time
series of states; the first holds geometry and topology for all (XInclude, as
DOLFINx writes it). The results lie one folder up. Readers expect every field to be a separate
dataset: a row of a larger dataset becomes one through a virtual dataset (HDF5) in a small file
beside the page.

Frequency responses are written as Universal File, dataset 58 (I-DEAS), which programs of modal
analysis read. One function a dataset: displacement of point i along its force over the force at
point j, or force on the axle over the force at point j. ASCII, double precision, SI units.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import heard, nominal
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import replacing
from tireroad.runs.files.folder import left_out
from tireroad.runs.files.store import opened
from tireroad.runs.results.wave import LISTEN, joined, wave_file
from tireroad.runs.version import PROGRAM

FRF = 4  # function type: frequency response
COMPLEX_DOUBLE = 6
FREQUENCY, DISPLACEMENT, EXCITATION, REACTION = 18, 8, 13, 9  # specific data types
# Exponents of length, force, temperature.
_OF = {FREQUENCY: (0, 0, 0), DISPLACEMENT: (1, 0, 0), EXCITATION: (0, 1, 0), REACTION: (0, 1, 0)}
_NAMES = {
    FREQUENCY: ("Frequency", "Hz"),
    DISPLACEMENT: ("Displacement", "m"),
    EXCITATION: ("Force", "N"),
    REACTION: ("Axle force", "N"),
}
AXLE = 1000  # number of the axle as a point
_EVEN = 1e-9
SHAPES = 20  # modes written
INSTANTS = 400  # contact states written: each takes 1 kB of page and an entry of the time slider
_BORROWED = 'xpointer(//Grid[@Name="states"]/Grid[1]/*[self::Topology or self::Geometry])'
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
    "tire.tir",
    *(f"{name}.csv" for name in ("stiffness", "stiffness_longitudinal", "stiffness_lateral")),
    *(f"{name}.csv" for name in ("footprint", "modes", "contact_force", "spectra", "third_octave")),
    *(f"{name}.csv" for name in ("density", "response", "receptance", "vibration", "sound")),
    *(f"{name}.csv" for name in ("rolling_modes", "campbell")),
    "response.uff",
    *(f"{name}.xdmf" for name in ("static", "modes", "contact", "motion")),
    *(f"{name}_fields.h5" for name in ("static", "modes", "contact", "motion")),
}
"""The names of all files that an export may write."""
Columns = dict[str, NDArray]  # heading with unit -> values (n)
Remark = Callable[[str, str], None]  # name of a file, what cannot be made of it and why


def frequency_responses(file: h5py.File, directions: Sequence[Sequence[float]]) -> str:
    """All receptances and transmissibilities of a response.h5; empty if it has none.

    `directions` (k, 3): those of the forces, as in the scene.
    """
    ways = [direction(one) for one in directions]
    parts: list[str] = []
    if "receptance" in file:
        frequency, values = file["frequency"][()], file["receptance"][()]
        for i, j in np.ndindex(values.shape[1:]):
            ends = (i + 1, ways[i]), (j + 1, ways[j])
            parts += dataset(frequency, values[:, i, j], DISPLACEMENT, *ends)
    ratio = file.get("transmissibility/momentum")
    if ratio is not None:
        frequency, values = file["transmissibility/frequency"][()], ratio[()]
        for k, j in np.ndindex(values.shape[1:]):
            parts += dataset(frequency, values[:, k, j], REACTION, (AXLE, k + 1), (j + 1, ways[j]))
    return "".join(f"{line}\n" for line in parts)


def direction(vector: Sequence[float]) -> int:
    """1, 2, 3 along x, y, z, negative against them; 0 (scalar) for another direction."""
    size = np.asarray(vector, float) / np.linalg.norm(vector)
    axis = int(np.abs(size).argmax())
    if abs(size[axis]) < 1 - 1e-9:
        return 0
    return int(np.sign(size[axis])) * (axis + 1)


def dataset(
    frequency: NDArray,
    values: NDArray,
    what: int,
    response: tuple[int, int],
    reference: tuple[int, int],
) -> Iterator[str]:
    """The lines of one function: complex `values` (f,) at `frequency` (f,) Hz.

    `what`: data type of the numerator; `response`, `reference`: number and direction of the points.
    """
    step = float(frequency[1] - frequency[0]) if len(frequency) > 1 else 0.0
    even = len(frequency) > 1 and bool(
        np.abs(np.diff(frequency) - step).max() <= _EVEN * frequency[-1]
    )
    yield f"{-1:6d}"
    yield f"{58:6d}"
    yield f"{_NAMES[what][0]} of point {response[0]} over the force at point {reference[0]}"[:80]
    yield PROGRAM[:80]
    yield from ("NONE", "NONE", "NONE")
    yield (
        f"{FRF:5d}{0:10d}{1:5d}{0:10d} {'NONE':<10}{response[0]:10d}{response[1]:4d}"
        f" {'NONE':<10}{reference[0]:10d}{reference[1]:4d}"
    )
    yield f"{COMPLEX_DOUBLE:10d}{len(frequency):10d}{int(even):10d}{frequency[0]:13.5E}{step if even else 0.0:13.5E}{0.0:13.5E}"
    for kind in (FREQUENCY, what, EXCITATION):
        length, force, heat = _OF[kind]
        name, unit = _NAMES[kind]
        yield f"{kind:10d}{length:5d}{force:5d}{heat:5d} {name:<20} {unit:<20}"
    yield f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}"
    if even:
        flat = np.stack([values.real, values.imag], axis=1).ravel()
        for first in range(0, len(flat), 4):
            yield "".join(f"{value:20.11E}" for value in flat[first : first + 4])
    else:
        for f, value in zip(frequency, values, strict=True):
            yield f"{f:13.5E}{value.real:20.11E}{value.imag:20.11E}"
    yield f"{-1:6d}"


@dataclass
class Page:
    """A page `name`.xdmf as `text`, and the datasets of its `name`_fields.h5."""

    name: str
    text: str = ""
    rows: dict[str, h5py.VirtualLayout] = field(default_factory=dict)
    arrays: dict[str, NDArray] = field(default_factory=dict)

    @property
    def beside(self) -> str:
        """Name of the fields file; it is needed if there are `rows` or `arrays`."""
        return f"{self.name}_fields.h5"

    def write_fields(self, path: Path) -> None:
        """Write the fields file; its virtual datasets find the results relative to its place."""
        with h5py.File(path, "w", libver="latest") as file:
            for name, layout in self.rows.items():
                file.create_virtual_dataset(name, layout)
            for name, values in self.arrays.items():
                file[name] = values

    def row(self, dataset: h5py.Dataset, row: int) -> str:
        """Row `row` of a dataset (n, …) as a separate dataset."""
        name = f"{dataset.name.strip('/').replace('/', '_')}_{row}"
        above = f"../{Path(dataset.file.filename).name}"
        source = h5py.VirtualSource(above, dataset.name, dataset.shape, dataset.dtype)
        layout = h5py.VirtualLayout(dataset.shape[1:], dataset.dtype)
        layout[...] = source[row]
        self.rows[name] = layout
        return _item(dataset.shape[1:], dataset.dtype, f"{self.beside}:/{name}")

    def vertices(self, count: int) -> str:
        """Topology of that many single points."""
        self.arrays["vertices"] = np.arange(count)[:, None]
        places = _item((count, 1), np.dtype(np.int64), f"{self.beside}:/vertices")
        return (
            f'<Topology TopologyType="Polyvertex" NumberOfElements="{count}" NodesPerElement="1">'
            f"{places}</Topology>"
        )

    def states(self, body: str, states: Iterable[tuple[float, str]]) -> Page:
        """Set the text: geometry and topology `body`, and the fields at each time; returns self."""
        grids = []
        for number, (time, fields) in enumerate(states):
            mesh = f"<xi:include xpointer={quoteattr(_BORROWED)}/>" if number else body
            grids.append(
                f'<Grid Name="state {number}" GridType="Uniform">{mesh}\n'
                f'<Time Value="{time:.10g}"/>{fields}</Grid>'
            )
        self.text = (
            '<?xml version="1.0"?>\n<Xdmf Version="3.0" xmlns:xi="http://www.w3.org/2001/XInclude">'
            '<Domain>\n<Grid Name="states" GridType="Collection" CollectionType="Temporal">'
            + "\n".join(grids)
            + "</Grid>\n</Domain></Xdmf>\n"
        )
        return self


def static_page(file: h5py.File) -> Page:
    """The undeformed outer face as quads, and its displacement (warp by it to load the tire)."""
    page = Page("static")
    moved = _attribute("displacement", "Vector", _whole(file["surface/displacement"]))
    return page.states(_surface(file, page), [(0.0, moved)])


def modes_page(file: h5py.File) -> Page:
    """The first mode shapes as vectors on the outer face; frequency in Hz stands for time."""
    page, shape = Page("modes"), file["surface/shape"]
    fields = [
        (float(value), _attribute("shape", "Vector", page.row(shape, number)))
        for number, value in enumerate(file["frequency"][:SHAPES])
    ]
    return page.states(_surface(file, page), fields)


def contact_page(file: h5py.File) -> Page | None:
    """Normal force and gap of the contact points over time; None before the first step."""
    time, points = file["time"][()], file["points"]
    if not len(time):
        return None
    page = Page("contact")
    rows = np.unique(np.linspace(0, len(time) - 1, min(INSTANTS, len(time))).astype(int))
    scalars = {name: file[name] for name in ("normal_force", "gap") if name in file}
    body = page.vertices(points.shape[0]) + _geometry(points)
    return page.states(body, _over_time(page, time, rows.tolist(), scalars, "Scalar"))


def motion_page(file: h5py.File) -> Page | None:
    """The outer face over time: warp it by its displacement from the static state."""
    time, moved = file["time"][()], {"displacement": file["displacement"]}
    if not len(time):
        return None
    page = Page("motion")
    states = _over_time(page, time, range(len(time)), moved, "Vector")
    return page.states(_surface(file, page), states)


def _over_time(
    page: Page, time: NDArray, rows: Sequence[int], fields: Mapping[str, h5py.Dataset], kind: str
) -> list[tuple[float, str]]:
    """A state for each of the rows of datasets (n, …)."""
    return [
        (
            float(time[row]),
            "".join(_attribute(name, kind, page.row(held, row)) for name, held in fields.items()),
        )
        for row in rows
    ]


def _surface(file: h5py.File, page: Page) -> str:
    """Topology and geometry of the outer face; its quads are stored in static.h5 only."""
    points = file["surface/points"]
    beside = Path(file.filename).with_name("static.h5")
    if beside.is_file():
        with opened(beside) as other:
            if "surface/quads" in other and other["surface/points"].shape == points.shape:
                found = other["surface/quads"]
                quads = f'<Topology TopologyType="Quadrilateral" NumberOfElements="{len(found)}">'
                return quads + _whole(found) + "</Topology>\n" + _geometry(points)
    return page.vertices(points.shape[0]) + _geometry(points)


def _geometry(points: h5py.Dataset) -> str:
    return f'<Geometry GeometryType="XYZ">{_whole(points)}</Geometry>'


def _attribute(name: str, kind: str, data: str) -> str:
    head = f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="Node">'
    return f"{head}{data}</Attribute>\n"


def _whole(dataset: h5py.Dataset) -> str:
    """A whole dataset, by its path in the result file."""
    place = f"../{Path(dataset.file.filename).name}:{dataset.name}"
    return _item(dataset.shape, dataset.dtype, place)


def _item(shape: tuple[int, ...], dtype: np.dtype, place: str) -> str:
    kind = "Float" if dtype.kind == "f" else "Int"
    sizes = " ".join(str(size) for size in shape)
    return (
        f'<DataItem Dimensions="{sizes}" NumberType="{kind}" '
        f'Precision="{dtype.itemsize}" Format="HDF">{place}</DataItem>'
    )


def export(
    directory: Path,
    uff: bool = False,
    tir: bool = False,
    remark: Remark = lambda name, text: None,
) -> list[Path]:
    """Write directory/export/*.csv and *.xdmf from the existing result files; returns the paths.

    `uff`: also response.uff, frequency responses as Universal File 58; `tir`: also tire.tir, the tire's
    figures in the form of MF-Tyre/MF-Swift. Of these two `remark` is told, with the file's name, what cannot be
    made: the file, or parts of it.

    XDMF files refer to the HDF5 results beside `export` and copy no data: do not move that folder.
    Every CSV column names its unit. Each file is written to a temporary name and renamed. Results
    of an earlier run in the folder are left out, and what an earlier export made of them is
    removed. Not collective: call it on one process. Raises InputError if there is nothing to
    export, a result file is damaged (then nothing is written), or `export` cannot be written.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is not a folder: give the result folder of a run")
    files: dict[str, Callable[[Path], object]] = {}
    others = left_out(directory)
    for name, reader in READERS.items():
        if (directory / name).is_file() and name not in others:
            files |= _read(directory / name, reader)
    if uff:
        files |= _asked("response.uff", remark, lambda: _universal(directory, others))
    if tir:
        from tireroad.runs.results.tir import written  # needs the tire, which no other export does

        files |= _asked(
            "tire.tir", remark, lambda: written(directory, others, partial(remark, "tire.tir"))
        )
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
    for old in folder.glob("sound_*_Pa.wav"):
        if old.name not in files:
            old.unlink()
    return [folder / name for name in files]


def _asked(
    name: str, remark: Remark, text: Callable[[], str]
) -> dict[str, Callable[[Path], object]]:
    """A file that was asked for, if its text can be made; otherwise `remark` is told why not."""
    try:
        data = text()
    except InputError as error:
        remark(name, str(error))
        return {}
    return {name: partial(Path.write_text, data=data, encoding="utf-8")}


def _universal(directory: Path, others: Mapping[str, str]) -> str:
    name = "response.h5"
    text = ""
    if (directory / name).is_file() and name not in others:
        scene = tomllib.loads((directory / "scene.toml").read_text(encoding="utf-8"))
        ways = [force["direction"] for force in scene.get("force", [])]
        with opened(directory / name) as file:
            text = frequency_responses(file, ways)
    if not text:
        raise InputError(
            f"{directory} has no frequency responses: add [[force]], and [output.receptance] or "
            "[output.transmissibility], to the scene, and run it again"
        )
    return text


def _read(path: Path, reader: Callable[[h5py.File], dict]) -> dict:
    with opened(path) as file:
        return reader(file)


def write_csv(path: Path, columns: Columns) -> None:
    """One row of headings, then the numbers to 10 digits, separated by commas; empty where NaN.

    Texts are in quotes.
    """
    if any(values.dtype.kind in "OU" for values in columns.values()):
        rows = zip(*map(_written, columns.values()), strict=True)
        body = "".join(",".join(row) + "\n" for row in rows).encode()
    else:  # of millions of numbers
        stream = BytesIO()
        np.savetxt(stream, np.column_stack(list(columns.values())), fmt="%.10g", delimiter=",")
        body = stream.getvalue().replace(b"nan", b"")
    header = ",".join(f'"{heading}"' for heading in columns) + "\n"
    path.write_bytes(header.encode() + body)


def _written(values: NDArray) -> list[str]:
    """Values of a column as they stand in a CSV file."""
    if values.dtype.kind in "OU":
        return [f'"{value}"' for value in values]
    return ["" if value != value else f"{value:.10g}" for value in values.tolist()]


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
    """modes.csv: number, name, frequency, damping, effective mass, …; modes.xdmf: the first shapes."""
    frequency = file["frequency"][()]
    columns = {"mode": np.arange(1, len(frequency) + 1)} | _names(file)
    columns["frequency [Hz]"] = frequency
    if "damping" in file:  # not of an earlier version
        columns["damping ratio [-]"] = file["damping"][()]
        held = file["effective_mass"][()].T
        columns |= {f"effective mass {axis} [kg]": held[k] for k, axis in enumerate(AXES)}
        columns |= {f"effective inertia {axis} [kg m2]": held[3 + k] for k, axis in enumerate(AXES)}
    columns["residual [-]"] = file["residual"][()]
    return _table("modes.csv", columns) | _page(modes_page(file))


def rotating(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """rolling_modes.csv: name, frequency and damping of each state; campbell.csv: branches over speed."""
    value = file["eigenvalue"][()]
    order = np.lexsort((value.real, value.imag))
    order = order[value.imag[order] >= 0]
    columns = {"frequency [Hz]": value.imag / (2 * np.pi), "decay rate [1/s]": -value.real}
    columns |= {"damping ratio [-]": -value.real / np.abs(value)}
    every = _names(file) | columns
    files = _table("rolling_modes.csv", {name: held[order] for name, held in every.items()})
    if "campbell/name" not in file:
        return files
    group = file["campbell"]
    lines, ratio = group["frequency"][()], group["eigenvalue"][()]
    ratio = -ratio.real / np.abs(ratio)
    over = {"speed [rad/s]": group["speed"][()]}
    for k, name in enumerate(group["name"].asstr()):
        over[f"{k + 1} {name} [Hz]"] = lines[:, k]
        over[f"{k + 1} {name} damping ratio [-]"] = ratio[:, k]
    return files | _table("campbell.csv", over)


def _names(file: h5py.File) -> Columns:
    """Columns of the names of modes or states; none of a file of an earlier version."""
    if "name" not in file:
        return {}
    columns: Columns = {key: file[key].asstr()[()] for key in ("name", "motion")}
    columns["waves around [-]"] = file["wave_number"][()]
    columns["nodal lines along the tread [-]"] = file["nodal_lines"][()]
    columns["share of that number of waves [-]"] = file["wave_share"][()]
    return columns


def static(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """footprint.csv: deformed contact points and their forces; static.xdmf: the loaded surface."""
    files = _page(static_page(file))
    if "contact/points" not in file or not len(file["contact/points"]):  # a tire without a road
        return files
    points, force = file["contact/points"][()], file["contact/force"][()]
    columns = _components("position", points, "m") | _components("force", force, "N")
    return _table("footprint.csv", columns) | files


def stiffness(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """stiffness.csv: load, footprint and rolling radius over deflection; slides, of a run with friction."""
    curve = file["curve"]
    columns = {
        f"{name.replace('_', ' ')} [{curve[name].attrs['unit']}]": curve[name][()] for name in curve
    }
    files = _table(
        "stiffness.csv",
        dict(sorted(columns.items(), key=lambda column: "deflection" not in column[0])),
    )
    for axis in file.get("slide", {}):
        parts = file[f"slide/{axis}"]
        columns = {
            f"{name} [{part.attrs['unit']}]": part[()] for name, part in parts.items() if part.shape
        }
        files |= _table(f"stiffness_{axis}.csv", columns)
    return files


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
    return _table("contact_force.csv", columns) | _page(contact_page(file))


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
    for name in (name for name in group if name.endswith("_spread")):
        what = name.removesuffix("_spread")
        label, bounds = NAMES.get(what, what.replace("_", " ")), group[name][()]
        bounds = bounds.reshape(len(centre), -1, 3, 2)
        for point, end in np.ndindex(bounds.shape[1], 2):
            place = f" {point + 1}" if bounds.shape[1] > 1 else ""
            title = f"95 % of the {label}{place} by its spread, {('from', 'to')[end]}"
            columns |= _components(title, bounds[:, point, :, end], "dB")
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


def sound(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """sound.csv: third octaves at the microphones; a WAV file each, whose name says its full scale.

    A record shorter than `LISTEN` is joined to itself in overlap.
    """
    centre, names = file["third_octave/centre"][()], file.attrs["microphone_names"]
    columns = {"band [Hz]": nominal(centre), "exact centre of the band [Hz]": centre}
    for key, unit in (
        ("level", "dB re 20 uPa"),
        ("level_a", "dB(A) re 20 uPa"),
        ("level_error", "dB"),
    ):
        what = {
            "level": "sound pressure level",
            "level_a": "A-weighted sound pressure level",
            "level_error": "error of the sound pressure level",
        }[key]
        for name, values in zip(names, file[f"third_octave/{key}"][()], strict=True):
            columns[f"{what} at {name} [{unit}]"] = values
    columns["sound power level [dB re 1 pW]"] = file["power"][()]
    files = _table("sound.csv", columns)
    held = file["signal/pressure"]
    for number, (name, signal) in enumerate(zip(names, held[()], strict=True)):
        rate = float(held.attrs["rate"])
        data, full = wave_file(joined(signal, max(round(LISTEN * rate), len(signal))), rate)
        plain = "".join(c if c.isalnum() or c in "-." else "_" for c in str(name))
        files[f"sound_{number}_{plain}_{full:g}_Pa.wav"] = partial(Path.write_bytes, data=data)
    return files


def motion(file: h5py.File) -> dict[str, Callable[[Path], object]]:
    """motion.xdmf: the outer face over time, for ParaView."""
    return _page(motion_page(file))


def _page(page: Page | None) -> dict[str, Callable[[Path], object]]:
    """A page and, if needed, its file of fields."""
    if page is None:
        return {}
    files: dict[str, Callable[[Path], object]] = {
        f"{page.name}.xdmf": partial(Path.write_text, data=page.text, encoding="utf-8")
    }
    return files | ({page.beside: page.write_fields} if page.rows or page.arrays else {})


READERS: dict[str, Callable[[h5py.File], dict[str, Callable[[Path], object]]]] = {
    "static.h5": static,
    "stiffness.h5": stiffness,
    "modes.h5": modes,
    "rotating.h5": rotating,
    "contact.h5": contact,
    "spectra.h5": spectra,
    "response.h5": response,
    "vibration.h5": vibration,
    "sound.h5": sound,
    "motion.h5": motion,
}
