"""Road files as programs and public data bases write them: each is read, with the right heights."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.contact.roads.grid_file import read_grid
from tireroad.contact.roads.profile_file import ProfileKeys, read_profile

N = 200
X = 10.0 + 2e-3 * np.arange(N)  # m
Y = 0.02 * (np.arange(7) - 3)
RNG = np.random.default_rng(3)
ROUGH = np.cumsum(RNG.normal(0, 3e-4, N))
FORMS = {
    "rough": ROUGH,
    "rounded to 0.1 mm": np.round(ROUGH, 4),
    "123 m above the sea": ROUGH + 123.456,
    "faded out": ROUGH * np.hanning(N),
    "cleats": np.where((np.arange(N) // 10) % 4 == 0, 0.01, 0.0),
    "a kerb": np.round(0.1 * ROUGH, 5) + 0.15 * (np.arange(N) > N / 2),
    "clipped": np.maximum(ROUGH, np.quantile(ROUGH, 0.3)),
}
ABOVE = [
    "date: 2021-05-03", "lane: 2", "speed: 80 km/h", "measured at 50 km/h", "Sensor LMI 2342, range 100 mm", "road A12 km 13.4 to 13.5",
    "sampled every 2 mm", "temperature: 21.5 °C", "laser spot 0.2 mm", "surface: dense asphalt 0/11", "length: 120 m", "width 3.5 m",
    "coordinate system: local", "points: 200", "created 2020-03-04 10:12:33",
]  # fmt: skip
Rows = Callable[[np.ndarray], str]


def joined(first: str, *columns: list[str], separator: str = ",", end: str = "\n") -> str:
    lines = [separator.join(row) for row in zip(*columns, strict=True)]
    return end.join([first, *lines] if first else lines) + end


def f(values: np.ndarray, unit: float, digits: int) -> list[str]:
    return [f"{value / unit:.{digits}f}" for value in values]


PROFILES: dict[str, Rows] = {
    "numpy.savetxt": lambda z: joined("# x [m], z [m]", [f"{a:.18e}" for a in X], [f"{a:.18e}" for a in z]),
    "pandas": lambda z: joined(
        ",distance_m,height_mm", [str(k) for k in range(N)], [repr(a) for a in X.round(6).tolist()],
        [repr(a) for a in (1e3 * z).round(6).tolist()],
    ),
    "German spreadsheet": lambda z: joined(
        "No.;Weg in mm;Profil in µm;Temperatur in °C", [str(k + 1) for k in range(N)], f(X, 1e-3, 1), f(z, 1e-6, 1), ["21.5"] * N,
        separator=";", end="\r\n",
    ).replace(".", ",").replace("No,", "No."),
    "R": lambda z: joined('"","x_mm","z_mm"', [f'"{k + 1}"' for k in range(N)], f(X, 1e-3, 3), f(z, 1e-3, 5)),
    "LabVIEW": lambda z: "LabVIEW Measurement\nWriter_Version\t2\nDate\t2021/03/04\n***End_of_Header***\n\n" + joined(
        "Distance [mm]\tHeight [mm]", f(X, 1e-3, 3), f(z, 1e-3, 5), separator="\t"
    ),
    "profilometer": lambda z: joined(
        "time [s]\tdistance [m]\tspeed [km/h]\theight [mm]", [f"{k / 1000:.3f}" for k in range(N)], f(X, 1, 4), ["79.9"] * N,
        f(z, 1e-3, 5), separator="\t",
    ),
    "feet and inches": lambda z: joined("Station (ft),Elevation (in)", f(X, 0.3048, 7), f(z, 0.0254, 6)),
    "line of units": lambda z: joined("distance,elevation\nm,mm", f(X, 1, 4), f(z, 1e-3, 5)),
    "no headings": lambda z: joined("", f(X, 1e-3, 2), f(z, 1e-3, 5), separator="\t"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("written", PROFILES)
def test_a_profile_is_read(tmp_path: Path, form: str, written: str) -> None:
    text = PROFILES[written](FORMS[form])
    for k, line in enumerate((None, *ABOVE)):
        (tmp_path / "road.txt").write_text((f"# {line}\n" if line else "") + text, "utf-8")
        if k and form != "rough":
            break
        found = read_profile(tmp_path / "road.txt", "F")
        np.testing.assert_allclose(found.heights, FORMS[form], atol=2e-7)
        np.testing.assert_allclose(found.x, X, atol=1e-6)


@pytest.mark.parametrize("line", ABOVE)
def test_a_single_column_is_read(tmp_path: Path, line: str) -> None:
    for above in (f"# {line}\n", f"{line}\n# height in mm\n", f"{line}\n"):
        (tmp_path / "road.txt").write_text(above + "\n".join(f(ROUGH, 1e-3, 5)), "utf-8")
        found = read_profile(tmp_path / "road.txt", "F", ProfileKeys(pitch=2e-3))
        np.testing.assert_allclose(found.heights, ROUGH, atol=2e-7)


def text_grid(path: Path, form: str, z: np.ndarray) -> Path:
    x, y = np.meshgrid(X, Y, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    if form == "//X Y Z":
        text = joined("//X Y Z", *(f(points[:, k], 1, 7) for k in range(3)), separator=" ")
    elif form == "x [mm]":
        order = np.lexsort((points[:, 0], points[:, 1]))
        text = joined("x [mm],y [mm],z [mm]", *(f(points[order, k], 1e-3, 4) for k in range(3)))
    else:
        rows = zip(f(X, 1, 4), z, strict=True)
        text = (
            ",".join([form, *f(Y, 1, 3)])
            + "\n"
            + "\n".join(",".join([a, *f(row, 1, 7)]) for a, row in rows)
        )
    (path / "road.csv").write_text(text)
    return path / "road.csv"


def binary_grid(path: Path, form: str, z: np.ndarray) -> Path:
    if form == "npz":
        more = {
            "date": "2021-03-04",
            "speed": 80.5,
            "lane": 2,
            "description": "scan of lane 2, spot 0.1 mm",
        }
        np.savez_compressed(path / "road.npz", x=X, y=Y, z=z, **more)  # type: ignore[arg-type]
        return path / "road.npz"
    step = np.ptp(z) / 30000
    with h5py.File(path / "road.nc", "w") as file:  # as xarray packs it
        file["x"], file["y"] = X, Y
        packed = np.round((z - z.mean()) / step).astype(np.int16) if form == "packed" else 1e3 * z
        file["z"] = packed.T
        for k, name in enumerate("yx"):
            file[name].make_scale(name)
            file["z"].dims[k].attach_scale(file[name])
            file[name].attrs["units"] = "m"
        file["z"].attrs["units"] = "m" if form == "packed" else "mm"
        more = {
            "standard_name": "surface_altitude",
            "actual_range": [z.min(), z.max()],
            "_Netcdf4Dimid": 0,
            "long_name": "height",
        }
        if form == "packed":
            more |= {"scale_factor": step, "add_offset": z.mean(), "_FillValue": np.int16(-32768)}
        file["z"].attrs.update(more)
        more = {
            "title": "Road scan",
            "history": "2021: resampled to 10 mm, units converted",
            "Conventions": "CF-1.8",
            "speed": 80.5,
        }
        file.attrs.update(more)
    return path / "road.nc"


@pytest.mark.parametrize("road", FORMS)
@pytest.mark.parametrize("form", ["//X Y Z", "x [mm]", "", "x\\y", "npz", "packed", "netCDF"])
def test_a_grid_is_read(tmp_path: Path, form: str, road: str) -> None:
    z = FORMS[road][:, None] + 1e-4 * np.sin(40 * Y) * (np.ptp(FORMS[road]) != 0.01)
    make = binary_grid if form in ("npz", "packed", "netCDF") else text_grid
    grid = read_grid(make(tmp_path, form, z))
    x, y = np.meshgrid(X, Y, indexing="ij")
    np.testing.assert_allclose(grid.height(x, y), z, atol=max(2e-7, 1e-4 * np.ptp(z)))
