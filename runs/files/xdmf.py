"""XDMF pages for ParaView, pyvista and meshio; they refer to the HDF5 results and copy no data.

A page is a time series of states; the first holds geometry and topology for all (XInclude, as
DOLFINx writes it). The results lie one folder up. Readers expect every field to be a separate
dataset: a row of a larger dataset becomes one through a virtual dataset (HDF5) in a small file
beside the page.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.store import opened

SHAPES = 20  # modes written
INSTANTS = 400  # contact states written: each takes 1 kB of page and an entry of the time slider
_BORROWED = 'xpointer(//Grid[@Name="states"]/Grid[1]/*[self::Topology or self::Geometry])'


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


def static(file: h5py.File) -> Page:
    """The undeformed outer face as quads, and its displacement (warp by it to load the tire)."""
    page = Page("static")
    moved = _attribute("displacement", "Vector", _whole(file["surface/displacement"]))
    return page.states(_surface(file, page), [(0.0, moved)])


def modes(file: h5py.File) -> Page:
    """The first mode shapes as vectors on the outer face; frequency in Hz stands for time."""
    page, shape = Page("modes"), file["surface/shape"]
    fields = [
        (float(value), _attribute("shape", "Vector", page.row(shape, number)))
        for number, value in enumerate(file["frequency"][:SHAPES])
    ]
    return page.states(_surface(file, page), fields)


def contact(file: h5py.File) -> Page | None:
    """Normal force and gap of the contact points over time; None before the first step."""
    time, points = file["time"][()], file["points"]
    if not len(time):
        return None
    page = Page("contact")
    rows = np.unique(np.linspace(0, len(time) - 1, min(INSTANTS, len(time))).astype(int))
    scalars = {name: file[name] for name in ("normal_force", "gap") if name in file}
    body = page.vertices(points.shape[0]) + _geometry(points)
    return page.states(body, _over_time(page, time, rows.tolist(), scalars, "Scalar"))


def motion(file: h5py.File) -> Page | None:
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
