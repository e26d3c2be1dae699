"""Thousands of variants of road files: each is read with the right values, or refused; never with another value."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tireroad.contact.roads.road import ROADS
from tireroad.fem.errors import InputError

sys.path.insert(0, str(Path(__file__).parent))

from variants import MAKERS, Variant  # noqa: E402

EACH = 800  # variants of each kind: profile, list of points, matrix, arrays


def outcome(variant: Variant, path: Path) -> str:
    """read, refused, or what is wrong."""
    file = path / f"road{variant.suffix}"
    variant.write(file)
    keys = dict(variant.keys)
    if variant.y is None:
        keys |= {"across": "ruts", "outlier": 1e6, "longest_gap": 10.0}
    else:
        keys["holes"] = "fill"
    kind = "laser" if variant.y is None else "grid"
    try:
        made = ROADS.make(kind, file=str(file), **keys).make()
    except InputError as error:
        return f"refused: {error}"
    x = variant.x
    if variant.y is None:
        if abs(made.extent_of_file[0] - x[-1]) > 1e-4 * x[-1]:
            return f"length {made.extent_of_file[0]} m for {x[-1]} m"
        z = made.height(x, 0 * x)
        known, exact = ~variant.missing, variant.z
    else:
        y = variant.y
        length, width = made.extent_of_file
        if abs(length - x[-1] + x[0]) > 1e-4 * x[-1] or abs(width - y[-1] + y[0]) > 1e-4 * y[-1]:
            return f"size {length} m x {width} m"
        try:
            made = made.prepare(*made.extent[0], *made.extent[1])
        except InputError as error:
            return f"refused: {error}"
        if made.filled != variant.missing.sum():
            return f"{made.filled} heights filled of {variant.missing.sum()}"
        z = made.height(*np.meshgrid(x, y, indexing="ij"))
        known, exact = ~variant.missing, variant.z
    off, exact = np.abs(z - exact)[known].max(), exact[known]
    return "read" if off < 2e-3 * np.ptp(exact) + 1e-6 else f"heights {off} m off"


def tried(path: Path, seeds: range) -> tuple[list[str], Counter, Counter]:
    """What is wrong, and how many of each trait there were and were read."""
    wrong, there, read = [], Counter(), Counter()
    for maker in MAKERS:
        for seed in seeds:
            variant = maker(seed)
            found = outcome(variant, path)
            traits = [*variant.traits.items(), ("all", maker.__name__)]
            there.update(traits)
            if found == "read":
                read.update(traits)
            elif not found.startswith("refused"):
                wrong.append(
                    f"{maker.__name__}({seed}): {found}\n{variant.traits} {variant.keys}\n{variant.shown}"
                )
    return wrong, there, read


def check(path: Path, seeds: range) -> None:
    wrong, there, read = tried(path, seeds)
    assert not wrong, (
        f"{len(wrong)} of {sum(there.values())} read with another value:\n" + "\n\n".join(wrong[:3])
    )
    for trait, count in there.items():
        if trait[1] in ("furlong", "1e-07", "first alone") or trait[0] == "code" or count < 30:
            continue  # a unit that nobody knows
        if trait in (("missing", "code"), ("missing", "undeclared")):
            assert read[trait] == 0, "a code that neither file nor scene names was read"
            continue
        assert read[trait] > 0, f"{trait}: none of {count} was read"
    for maker in MAKERS:
        trait = "all", maker.__name__
        assert read[trait] > 0.25 * there[trait], f"{trait}: {read[trait]} of {there[trait]} read"


def test_a_sample_of_variants(tmp_path: Path) -> None:
    check(tmp_path, range(20))


@pytest.mark.long
@pytest.mark.parametrize("part", range(4))
def test_all_variants(tmp_path: Path, part: int) -> None:
    """3,200 variants: 0 with another value."""
    check(tmp_path, range(part * EACH // 4, (part + 1) * EACH // 4))
