"""XDMF pages for ParaView that point into the HDF5 results, one folder up, and copy no data."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np

from tireroad.runs.files.store import opened

SHAPES = 20  # modes offered: ParaView lists every one in its menus
INSTANTS = 400  # contact states offered: every one costs 1 kB of page and a line in the time slider


def static(file: h5py.File) -> str:
    """The outer face as made, quads, with its displacement (warp by it to see the loaded tire)."""
    moved = _attribute("displacement", "Vector", _reference(file["surface/displacement"]))
    return _document(_grid("loaded tire", *_surface(file), moved))


def modes(file: h5py.File) -> str:
    """The first mode shapes as vectors on the outer face."""
    frequency, shape = file["frequency"][()], file["surface/shape"]
    fields = [
        _attribute(f"mode {number + 1:03d} {value:.2f} Hz", "Vector", _row(shape, number))
        for number, value in enumerate(frequency[:SHAPES])
    ]
    return _document(_grid("modes", *_surface(file), "".join(fields)))


def contact(file: h5py.File) -> str | None:
    """Normal force and gap of the contact points over time; None before the first step."""
    time, points = file["time"][()], file["points"]
    if not len(time):
        return None
    geometry, topology = _reference(points), _vertices(points.shape[0])
    grids = []
    for row in np.unique(np.linspace(0, len(time) - 1, min(INSTANTS, len(time))).astype(int)):
        fields = [
            _attribute(name, "Scalar", _row(file[name], int(row)))
            for name in ("normal_force", "gap")
            if name in file
        ]
        instant = f'<Time Value="{time[row]:.10g}"/>'
        grids.append(_grid(f"step {row}", geometry, topology, instant + "".join(fields)))
    series = '<Grid Name="contact" GridType="Collection" CollectionType="Temporal">'
    return _document(series + "\n".join(grids) + "</Grid>")


def motion(file: h5py.File) -> str | None:
    """The outer face over time: warp it by its displacement beyond the static state."""
    time, moved = file["time"][()], file["displacement"]
    if not len(time):
        return None
    geometry, topology = _surface(file)
    grids = []
    for row, value in enumerate(time):
        field = _attribute("displacement", "Vector", _row(moved, row))
        instant = f'<Time Value="{value:.10g}"/>'
        grids.append(_grid(f"instant {row}", geometry, topology, instant + field))
    series = '<Grid Name="motion" GridType="Collection" CollectionType="Temporal">'
    return _document(series + "\n".join(grids) + "</Grid>")


def _surface(file: h5py.File) -> tuple[str, str]:
    """Geometry and topology of the outer face; its quads are kept in static.h5 alone."""
    points = file["surface/points"]
    beside = Path(file.filename).with_name("static.h5")
    quads = None
    if beside.is_file():
        with opened(beside) as other:
            if "surface/quads" in other and other["surface/points"].shape == points.shape:
                found = other["surface/quads"]
                quads = f'<Topology TopologyType="Quadrilateral" NumberOfElements="{len(found)}">'
                quads += _reference(found) + "</Topology>"
    return _reference(points), quads or _vertices(points.shape[0])


def _vertices(count: int) -> str:
    return f'<Topology TopologyType="Polyvertex" NumberOfElements="{count}" NodesPerElement="1"/>'


def _grid(name: str, points: str, topology: str, content: str) -> str:
    return (
        f'<Grid Name={quoteattr(name)} GridType="Uniform">{topology}\n'
        f'<Geometry GeometryType="XYZ">{points}</Geometry>\n{content}</Grid>'
    )


def _attribute(name: str, kind: str, data: str) -> str:
    head = f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="Node">'
    return f"{head}{data}</Attribute>\n"


def _reference(dataset: h5py.Dataset) -> str:
    """A whole dataset, by its place in the result file."""
    kind = "Float" if dataset.dtype.kind == "f" else "Int"
    shape = " ".join(str(size) for size in dataset.shape)
    place = f"../{Path(dataset.file.filename).name}:{dataset.name}"
    return (
        f'<DataItem Dimensions="{shape}" NumberType="{kind}" '
        f'Precision="{dataset.dtype.itemsize}" Format="HDF">{place}</DataItem>'
    )


def _row(dataset: h5py.Dataset, row: int) -> str:
    """Row `row` of a dataset (n, …) as a hyperslab."""
    rest = dataset.shape[1:]
    start, stride, count = ([row, *(0 for _ in rest)], [1] * dataset.ndim, [1, *rest])
    numbers = " ".join(str(number) for number in (*start, *stride, *count))
    shape = " ".join(str(size) for size in rest)
    return (
        f'<DataItem ItemType="HyperSlab" Dimensions="{shape}" Type="HyperSlab">'
        f'<DataItem Dimensions="3 {dataset.ndim}" Format="XML">{numbers}</DataItem>'
        f"{_reference(dataset)}</DataItem>"
    )


def _document(content: str) -> str:
    return f'<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>\n{content}\n</Domain></Xdmf>\n'
