"""A small road and a tread pattern in every format, and random damage to the file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
from in_child import forked
from matplotlib.image import imsave

from tireroad.contact.roads.road import make_road
from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.contact import PatternTable
from tireroad.runs.stages.setup import make_pattern

ENDS = ("driven", "refused", "not finite")
LIMIT = 60.0  # s for a case


def road_files(folder: Path) -> Iterator[Path]:
    """A small road in every format, and a pattern's depths."""
    x, y = np.arange(0.0, 3.0, 0.02), np.arange(-0.3, 0.3, 0.02)
    z = 1e-3 * np.random.default_rng(0).standard_normal((len(x), len(y)))
    np.savez(folder / "a.npz", x=x, y=y, z=z)
    np.savez_compressed(folder / "b.npz", x=x, y=y, z=z)
    with h5py.File(folder / "c.h5", "w") as store:
        store["x"], store["y"] = x, y
        store.create_dataset("z", data=z, compression="gzip")
    head = ",".join(["", *map(str, y)])
    rows = [",".join(map(str, [px, *row])) for px, row in zip(x, z, strict=True)]
    (folder / "d.csv").write_text("\n".join([head, *rows]))
    sections = "".join(f"D:long section {i + 1},m\n" for i in range(len(y)))
    header = "$ROAD_CRG\nREFERENCE_LINE_INCREMENT = 0.02\nLONG_SECTION_V_INCREMENT = 0.02\n$\n"
    crg = (header + f"$KD_DEFINITION\n#:KRBI\n{sections}").encode() + b"$" * 80 + b"\n"
    crg += z.astype(">f4").tobytes() + b"\x7f\xc0\0\0" * (-z.size % 20)
    (folder / "e.crg").write_bytes(crg)
    np.savez_compressed(folder / "pattern.npz", depth=np.abs(z), y=y)
    imsave(folder / "pattern.png", z)
    names = ("a.npz", "b.npz", "c.h5", "d.csv", "e.crg", "pattern.npz", "pattern.png")
    yield from (folder / name for name in names)


def fuzz_road(files: list[Path], seed: int, number: int) -> tuple[str, str]:
    """(end, which file) of one road file with random damage."""
    rng = np.random.default_rng([seed, 3, number])
    good = files[number % len(files)]
    data = bytearray(good.read_bytes())
    spread = len(data) if rng.random() < 0.5 else min(600, len(data))
    for _ in range(rng.integers(1, 20)):
        data[rng.integers(spread)] = rng.integers(256)
    if rng.random() < 0.2:
        data = data[: rng.integers(len(data))]
    bad = good.with_name(f"bad{good.suffix}")
    bad.write_bytes(bytes(data))
    drive = _patterned if good.stem == "pattern" else _driven

    def judged() -> int:
        try:
            return 0 if np.isfinite(drive(bad)).all() else 2
        except InputError:
            return 1

    status, said, _ = forked(judged, bad.with_suffix(".txt"), LIMIT)
    if status is None:
        return "hang", good.name
    known = status in (0, 1, 2) and "Traceback" not in said
    return (ENDS[status] if known else f"crash {status}: {said[-2000:]}"), good.name


def _driven(file: Path) -> np.ndarray:
    kind = "crg" if file.suffix == ".crg" else "grid"
    road = make_road(kind=kind, file=str(file), holes="fill", run_in=0.0)
    strip = road.prepare(0.1, 2.0, -0.1, 0.1)
    return strip.height(np.linspace(0.1, 2.0, 500), np.zeros(500))


def _patterned(file: Path) -> np.ndarray:
    pattern = make_pattern(PatternTable(file=str(file)), 0.3)
    assert pattern is not None
    return pattern.depth(np.linspace(0.0, 1.9, 500), np.zeros(500))
