"""The clear-text header of an OpenCRG file: named blocks of lines before the data."""

import re
from pathlib import Path

import numpy as np

from tireroad.fem.errors import InputError

# Line number and text, by the block's name in capitals.
Blocks = dict[str, list[tuple[int, str]]]

# Room for ten thousand channels of 72 bytes each; a binary file without separator is not read to
# its end.
MAX_HEADER = 1_000_000
MAX_BYTES = 1_000_000_000_000  # larger: an error, not a road


def read_header(file: Path) -> tuple[Blocks, int, int]:
    """Named blocks of (line number, text) without comments; byte and line where the data begin.

    InputError if no line of $$$$ ends the header.
    """
    if file.stat().st_size > MAX_BYTES:
        raise InputError(f"{file}: larger than {MAX_BYTES:,} bytes; cut the road first")
    with file.open("rb") as stream:
        head = stream.read(MAX_HEADER)
    blocks: Blocks = {}
    name, position = "", 0
    for number, raw in enumerate(head.splitlines(keepends=True), 1):
        position += len(raw)
        text = raw.decode("latin-1").rstrip("\r\n")
        if text.startswith("$$"):
            return blocks, position, number + 1
        if text.startswith("$"):
            name = re.split(r"[\s!]", text[1:], maxsplit=1)[0].upper()
            blocks.setdefault(name, [])
        elif name and not text.startswith("*"):
            blocks[name].append((number, text.split("!", 1)[0].strip()))
    raise InputError(
        f"{file}: no line of $$$$ that separates header and data within {len(head):,} bytes: "
        "this is no OpenCRG file, or it is truncated"
    )


def key_values(file: Path, lines: list[tuple[int, str]]) -> dict[str, float]:
    """KEY = number pairs of a block, keys in capitals. InputError names a line that is not one."""
    pairs = {}
    for number, text in lines:
        if not text:
            continue
        key, equals, value = text.partition("=")
        try:
            pairs[key.strip().upper()] = float(value.replace("'", ""))
        except ValueError:
            raise InputError(f"{file}, line {number}: {text!r} is not KEY = number") from None
        if not np.isfinite(pairs[key.strip().upper()]):
            raise InputError(f"{file}, line {number}: {text!r} is not finite")
    return pairs
