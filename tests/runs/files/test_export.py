"""CSV that a spreadsheet reads, XDMF whose every reference leads to the right numbers."""

import csv
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_results import sealed, write_results

from tireroad.fem.errors import InputError
from tireroad.runs.results.export import INSTANTS, MADE, SHAPES, export

CSV = {
    "footprint.csv",
    "modes.csv",
    "rolling_modes.csv",
    "contact_force.csv",
    "spectra.csv",
    "third_octave.csv",
    "response.csv",
    "receptance.csv",
}
XDMF = {
    "static.xdmf",
    "modes.xdmf",
    "modes_fields.h5",
    "contact.xdmf",
    "contact_fields.h5",
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = write_results(tmp_path_factory.mktemp("export") / "run", steps=900, modes=30)
    export(directory)
    return directory


def columns(path: Path) -> dict[str, NDArray]:
    with path.open(newline="") as stream:
        head, *rows = csv.reader(stream)
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def follow(item: ElementTree.Element, page: Path) -> NDArray:
    """The numbers of a DataItem, as a reader of XDMF finds them."""
    name, place = item.text.split(":")
    with h5py.File(page.parent / name, "r") as file:
        values = file[place][()]
    assert values.dtype.itemsize == int(item.get("Precision"))
    assert {"f": "Float", "i": "Int"}[values.dtype.kind] == item.get("NumberType")
    assert values.shape == tuple(int(size) for size in item.get("Dimensions").split())
    return values


def states(page: Path) -> list[ElementTree.Element]:
    """The states of a series: the first holds the mesh, the others take it from there; each has a time."""
    (series,) = ElementTree.parse(page).findall(".//Grid[@CollectionType='Temporal']")
    assert series.find("Grid/Topology") is not None
    include = "{http://www.w3.org/2001/XInclude}include"
    assert all(grid.find(include) is not None for grid in list(series)[1:])
    assert all(grid.find("Time") is not None for grid in series)
    return list(series)


def test_all_files_are_written_and_nothing_else(results: Path) -> None:
    again = export(results)
    assert {path.name for path in again} == CSV | XDMF
    assert {path.name for path in (results / "export").iterdir()} == CSV | XDMF
    assert CSV | XDMF <= MADE, "what a later export without them removes"


@pytest.mark.parametrize("name", sorted(CSV))
def test_every_column_names_its_unit(results: Path, name: str) -> None:
    with (results / "export" / name).open(newline="") as stream:
        head, *rows = csv.reader(stream)
    for heading, values in zip(head, zip(*rows, strict=True), strict=True):
        texts = heading in ("mode", "name", "motion")
        assert texts or (heading.endswith("]") and " [" in heading and np.array(values, float).size)


def test_forces_and_spectra_are_those_of_the_results(results: Path) -> None:
    force, spectrum = (
        columns(results / "export" / f"{n}.csv") for n in ("contact_force", "spectra")
    )
    with h5py.File(results / "contact.h5") as file:
        assert force["time [s]"] == pytest.approx(file["time"][()], rel=1e-9)
        assert force["contact force z [N]"] == pytest.approx(file["total_force"][:, 2], rel=1e-9)
        assert force["axle force x [N]"] == pytest.approx(file["axle_force"][:, 0], rel=1e-9)
    with h5py.File(results / "spectra.h5") as file:
        both = spectrum["Re axle force z [N]"] + 1j * spectrum["Im axle force z [N]"]
        assert both == pytest.approx(file["axle_force"][:, 2], rel=1e-9)
    receptance = columns(results / "export" / "receptance.csv")
    with h5py.File(results / "response.h5") as file:
        exact = file["receptance"][:, 1, 0]
        assert receptance["Im receptance 2,1 [m/N]"] == pytest.approx(exact.imag, rel=1e-9)


def test_surface_and_displacement(results: Path) -> None:
    page = results / "export" / "static.xdmf"
    (grid,) = states(page)
    points = follow(grid.find("Geometry/DataItem"), page)
    quads = follow(grid.find("Topology/DataItem"), page)
    assert int(grid.find("Topology").get("NumberOfElements")) == len(quads)
    assert quads.max() < len(points)
    with h5py.File(results / "static.h5") as file:
        assert (points == file["surface/points"][()]).all()
        moved = follow(grid.find("Attribute/DataItem"), page)
        assert (moved == file["surface/displacement"][()]).all()


def test_first_modes_are_vector_fields_over_frequency(results: Path) -> None:
    page = results / "export" / "modes.xdmf"
    fields = states(page)
    assert len(fields) == SHAPES
    with h5py.File(results / "modes.h5") as file:
        for number, grid in enumerate(fields):
            frequency = float(grid.find("Time").get("Value"))
            assert frequency == pytest.approx(file["frequency"][number])
            shape = follow(grid.find("Attribute/DataItem"), page)
            assert (shape == file["surface/shape"][number]).all()


def test_contact_over_time_is_thinned_and_ends_at_the_end(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From any folder: a field is found by the place of the page."""
    monkeypatch.chdir(tmp_path)
    page = results / "export" / "contact.xdmf"
    grids = states(page)
    assert len(grids) == INSTANTS
    with h5py.File(results / "contact.h5") as file:
        points = follow(grids[0].find("Topology/DataItem"), page)
        assert (points[:, 0] == np.arange(len(file["points"]))).all()
        for grid, row in ((grids[0], 0), (grids[-1], 899)):
            assert float(grid.find("Time").get("Value")) == pytest.approx(file["time"][row])
            force = grid.find("Attribute[@Name='normal_force']")[0]
            assert (follow(force, page) == file["normal_force"][row]).all()


@pytest.mark.parametrize("name", ["static", "modes", "contact"])
def test_meshio_reads_the_series(results: Path, name: str) -> None:
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    with meshio.xdmf.TimeSeriesReader(results / "export" / f"{name}.xdmf") as reader:
        points, cells = reader.read_points_cells()
        for state in range(reader.num_steps):
            _, fields, _ = reader.read_data(state)
            assert all(len(values) == len(points) for values in fields.values())
        assert cells[0].type == ("vertex" if name == "contact" else "quad")


def test_modes_and_states_are_exported_by_name(results: Path) -> None:
    """Every row names its mode and says how damped it is, in the order of the frequencies."""
    for name, first in (("modes", "R0"), ("rolling_modes", "R0-")):
        with (results / "export" / f"{name}.csv").open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert rows[0]["name"] == first and rows[0]["motion"] == "in plane, symmetric"
        frequency = np.array([float(row["frequency [Hz]"]) for row in rows])
        assert (np.diff(frequency) >= 0).all()
        assert all(float(row["damping ratio [-]"]) > 0 for row in rows)
    with (results / "export" / "modes.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["effective mass x [kg]"] for row in rows[:4]] == ["0", "0", "6", "6"]
    assert "effective inertia y [kg m2]" in rows[0]


def test_only_what_is_there_is_exported(tmp_path: Path) -> None:
    directory = write_results(tmp_path / "run")
    for name in ("static.h5", "contact.h5", "response.h5"):
        (directory / name).unlink()
    assert {path.name for path in export(directory)} == {
        "modes.csv",
        "modes.xdmf",
        "modes_fields.h5",
        "rolling_modes.csv",
        "spectra.csv",
        "third_octave.csv",
    }
    topology = ElementTree.parse(directory / "export" / "modes.xdmf").find(".//Topology")
    assert topology.get("TopologyType") == "Polyvertex", "the quads are in static.h5"


def test_a_tire_without_a_road_has_no_footprint(tmp_path: Path) -> None:
    """Its static state has no `contact/`."""
    directory = write_results(tmp_path / "run")
    with sealed(directory / "static.h5", "a") as file:
        del file["contact"]
    names = {path.name for path in export(directory)}
    assert names == (CSV | XDMF) - {"footprint.csv"}


def test_damage_is_an_input_error_and_writes_nothing(tmp_path: Path) -> None:
    directory = write_results(tmp_path / "run")
    whole = (directory / "spectra.h5").read_bytes()
    (directory / "spectra.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"spectra\.h5 is damaged"):
        export(directory)
    assert not (directory / "export").exists()


def test_nothing_to_export_is_an_input_error(tmp_path: Path) -> None:
    for directory in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(InputError, match="give the result folder of a run"):
            export(directory)


def test_bands_have_the_names_of_the_standard(results: Path) -> None:
    """315, where the centre is 316.2: IEC 61260-1."""
    bands = columns(results / "export" / "third_octave.csv")
    assert {31.5, 315.0, 1000.0} <= set(bands["band [Hz]"])
    exact = bands["exact centre of the band [Hz]"]
    assert exact[bands["band [Hz]"] == 315.0] == pytest.approx([316.227766])


def test_a_force_that_does_not_vary_has_an_empty_level(tmp_path: Path) -> None:
    """It was -3076.5 dB."""
    directory = write_results(tmp_path / "run")
    with sealed(directory / "spectra.h5", "a") as file:
        file["third_octave/level"][:, 0] = -3076.5
    export(directory)
    rows = (directory / "export" / "third_octave.csv").read_text().splitlines()
    column = rows[0].replace('"', "").split(",").index("axle force level x [dB re 1 N]")
    assert {row.split(",")[column] for row in rows[1:]} == {""}
    assert "-3076" not in "".join(rows)


def test_a_face_that_does_not_vibrate_has_an_empty_level(tmp_path: Path) -> None:
    directory = write_results(tmp_path / "run")
    (directory / "summary.json").unlink()  # without it every file counts
    with sealed(directory / "vibration.h5") as file:
        file["third_octave/centre"] = np.array([100.0])
        for name in ("velocity_level", "radiated_power_level"):
            file[f"third_octave/{name}"] = np.array([-2896.5])
            file[f"third_octave/{name}_a_weighted"] = np.array([60.0])
    export(directory)
    row = (directory / "export" / "vibration.csv").read_text().splitlines()[1]
    assert row == "100,100,,60,,60"
