"""Roads in OpenCRG files (ASAM OpenCRG 1.2, curved regular grid), text and binary, read as data.

The tire follows the reference line: the height under it at the distance u along and v to the left
of the line is the grid's z(u, v). The curvature of the line is neglected within the patch: 0.12 m
ahead of the axle a line of radius R has an offset of 0.12^2/2R, below 0.4 mm for R >= 20 m; lines
of smaller radius are refused. Factors of heights, length and width among the modifiers are applied. Slope and banking
of the line, and other modifiers and options that change heights, are refused by name unless they are zero.
"""

import re
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import (
    Coding,
    Decoded,
    FileRows,
    Grid,
    GridColumns,
    Packed,
    Rows,
    Spool,
    pieces,
)
from tireroad.contact.roads.meaning import ReadAs
from tireroad.contact.roads.missing import CodeSearch
from tireroad.fem.errors import InputError

# Line number and text, by the block's name in capitals.
Blocks = dict[str, list[tuple[int, str]]]

# Room for ten thousand channels of 72 bytes each; a binary file without separator is not read to
# its end.
MAX_HEADER = 1_000_000
MAX_BYTES = 1_000_000_000_000  # larger: an error, not a road

Array = NDArray[np.float64]
RECORD = 80
BLOCK = 4096  # rows of text read at a time
Channel = tuple[int, str, str]  # line in the file, name, unit
SMALLEST_RADIUS = 20.0
# Larger steps (m) are damage, and would overflow later.
LONGEST_STEP = 1e6
FORMATS = ("KRBI", "KDBI", "LRFI", "LDFI")
# Options for searching, checking and logging, which do not affect heights.
HARMLESS_OPTIONS = ("REFLINE_SEARCH_", "WARN_", "LOG_", "CHECK_")
# Options that act beyond the ends and sides of what was measured, where no tire rolls, or where
# heights are missing, which `holes` treats; and a height of the whole road, which is levelled.
BEYOND = (
    "REFLINE_CONTINUATION", "BORDER_MODE_", "BORDER_OFFSET_", "BORDER_SMOOTH_", "GRID_NAN_MODE",
    "GRID_NAN_OFFSET", "REFPOINT_Z",
)  # fmt: skip
# Modifiers that only move the road within its plane.
HARMLESS_MODIFIERS = (
    "REFPOINT_U", "REFPOINT_V", "REFPOINT_X", "REFPOINT_Y", "REFPOINT_PHI",
    "REFLINE_ROTCENTER_", "REFLINE_OFFSET_X", "REFLINE_OFFSET_Y", "REFLINE_OFFSET_PHI",
)  # fmt: skip
DEEPEST = 8  # files that refer to a file
SCALES = "SCALE_Z_GRID", "SCALE_LENGTH", "SCALE_WIDTH"
# Without effect, as slope and banking have to be none.
OF_THE_LINE = "SCALE_SLOPE", "SCALE_BANKING"


def read_header(file: Path) -> tuple[Blocks, int, int]:
    """Named blocks of (line number, text) without comments; byte and line where the data begin.

    InputError if no line of $$$$ ends the header, and the file does not refer to another one.
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
    if "ROAD_CRG_FILE" in blocks:
        return blocks, 0, 0
    raise InputError(
        f"{file}: no line of $$$$ that separates header and data within {len(head):,} bytes: "
        "this is not an OpenCRG file, or it is truncated"
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


class Payload(NamedTuple):
    """Position and size of a file's numbers.

    Format code, byte and line where they begin, numbers per row, and the number of rows that the
    header announces (None if it does not).
    """

    file: Path
    code: str
    start: int
    line: int
    channels: int
    rows: int | None


def read_payload(payload: Payload) -> Rows:
    """Rows of numbers, NaN where missing. InputError names the place of damage.

    Binary data stay in the file; text is converted once (contact.roads.grid.Spool).
    """
    if payload.code in ("KRBI", "KDBI"):
        return _read_binary(payload)
    return _read_text(payload)


def _read_binary(payload: Payload) -> Rows:
    """Big-endian numbers, packed across record boundaries; the last record is padded with NaN."""
    kind = np.dtype(">f4" if payload.code == "KRBI" else ">f8")
    size = payload.file.stat().st_size - payload.start
    whole = size - size % RECORD
    rows, row = payload.rows, payload.channels * kind.itemsize
    if rows is None:
        rows = whole // row
    needed = -(-rows * row // RECORD) * RECORD
    # A line end may follow the last record.
    if size < rows * row or size - whole > 2 or (payload.rows is not None and whole > needed):
        raise InputError(
            f"{payload.file}: {size:,} bytes of data from byte {payload.start:,} on, "
            f"{needed:,} expected for {rows} rows of {payload.channels} channels ({payload.code}): "
            f"the file is {'longer than its header says' if whole > needed else 'truncated'}"
        )
    if payload.rows is None:
        rows = _without_padding(payload, kind, rows, whole)
    return FileRows(payload.file, Packed(payload.start, kind, (rows, payload.channels)))


def _without_padding(payload: Payload, kind: np.dtype, rows: int, whole: int) -> int:
    """Number of rows without the NaN rows that pad the last record.

    A cross section has at least one valid height.
    """
    row = payload.channels * kind.itemsize
    most = min(RECORD // row, rows)
    with payload.file.open("rb") as stream:
        stream.seek(payload.start + (rows - most) * row)
        last = np.frombuffer(stream.read(whole - (rows - most) * row), kind)
    if not np.isnan(last[most * payload.channels :]).all():
        raise InputError(
            f"{payload.file}: {whole:,} bytes of data from byte {payload.start:,} on end within a "
            f"row of {payload.channels} channels ({payload.code}): the file is truncated"
        )
    empty = np.isnan(last[: most * payload.channels].reshape(most, payload.channels)).all(axis=1)
    while most > 0 and empty[most - 1]:
        rows, most = rows - 1, most - 1
    return rows


def _read_text(payload: Payload) -> Rows:
    """Fields of 10 (LRFI) or 20 (LDFI) characters; each row begins a new record (line)."""
    width = 10 if payload.code == "LRFI" else 20
    per_row = -(-payload.channels // (RECORD // width))
    count = _lines(payload)
    rows = count // per_row
    if count % per_row or (payload.rows is not None and rows != payload.rows):
        size = f"{payload.rows} rows" if payload.rows is not None else "whole rows"
        raise InputError(
            f"{payload.file}: {count} records of data from line {payload.line} on, "
            f"{size} of {per_row} records expected: the file is truncated or damaged"
        )
    spool = Spool()
    with payload.file.open("rb") as stream:
        stream.seek(payload.start)
        left, part = count, payload
        while left:
            lines = [line.rstrip(b"\r\n") for line in islice(stream, min(left, BLOCK * per_row))]
            spool.add(_table(part, lines, width, per_row))
            left -= len(lines)
            part = part._replace(line=part.line + len(lines))
    return spool.rows()


def _lines(payload: Payload) -> int:
    """Number of lines of data, without empty ones at the end."""
    with payload.file.open("rb") as stream:
        stream.seek(payload.start)
        last = 0
        for number, line in enumerate(stream, 1):
            if line.strip():
                last = number
    return last


def _table(payload: Payload, lines: list[bytes], width: int, per_row: int) -> Array:
    """Numbers (rows, channels) of some lines, the first of which is the payload's."""
    a_record = RECORD // width
    table = np.empty((len(lines) // per_row, payload.channels))
    for k in range(per_row):
        first = k * a_record
        count = min(a_record, payload.channels - first)
        chosen = lines[k::per_row]
        table[:, first : first + count] = _fields(payload, chosen, width, count, k, per_row)
    return table


def _fields(
    payload: Payload, lines: list[bytes], width: int, count: int, offset: int, step: int
) -> Array:
    """(lines, count) numbers of fixed width; a field that starts with * is missing."""
    size = width * count
    for i, line in enumerate(lines):
        # A last field may lack its trailing blanks, but not be absent.
        if len(line.rstrip()) > size or len(line.rstrip()) <= size - width:
            number = payload.line + offset + i * step
            raise InputError(
                f"{payload.file}, line {number}: {len(line.rstrip())} characters, {count} numbers "
                f"of {width} characters expected ({payload.code})"
            )
    joined = b"".join(line.rstrip().ljust(size) for line in lines)
    fields = np.char.strip(np.frombuffer(joined, dtype=f"S{width}"))
    fields = np.where(np.char.startswith(fields, b"*"), b"nan", fields)
    try:
        return fields.astype(float).reshape(len(lines), count)
    except ValueError:
        bad = next(i for i, field in enumerate(fields) if not _is_number(field))
        number = payload.line + offset + bad // count * step
        text = fields[bad].decode("latin-1")
        raise InputError(
            f"{payload.file}, line {number}, column {bad % count * width + 1}: {text!r} is not a "
            "number"
        ) from None


def _is_number(field: bytes) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def read_opencrg(
    file: Path | str,
    holes: str = "refuse",
    end: str = "refuse",
    missing: tuple[float, ...] | None = None,
) -> Grid:
    """The road of an OpenCRG file as a Grid: x = u from its beginning, y = v to the left, z in m.

    Formats LRFI, LDFI, KRBI (also if none is named) and KDBI; long sections are numbered or given
    `at v =`. A file that refers to another one ($ROAD_CRG_FILE) is the road of that with its own modifiers and options.
    `holes` and `end` as in Grid, `missing` as in `read_grid`. InputError names the file, and the line or byte, of what
    is missing, damaged or not supported.
    """
    path = Path(file)
    if not path.is_file():
        raise InputError(f"road.file {path}: no such file")
    try:
        file, blocks, start, line, followed = _followed(path)
        unused = _refuse_blocks(file, blocks)
        scales = _scales(file, blocks)
        parameters = key_values(file, blocks.get("ROAD_CRG", []))
        code, channels = _definition(file, blocks)
        step, rows = _rows(file, parameters, blocks["KD_DEFINITION"])
        payload = Payload(file, code, start, line, len(channels), rows)
        table = read_payload(payload)
    except OSError as error:
        raise InputError(f"road.file {path}: cannot be read ({error})") from error
    count = table.shape[0]
    if count < 2:
        raise InputError(f"{file}: {count} cross sections, at least 2 are needed")
    step *= scales["SCALE_LENGTH"]
    _check_line(file, channels, parameters, table, step)
    v, columns = _sections(file, channels, parameters)
    u = step * np.arange(count, dtype=float)
    source = f"road.file {path}"
    z: Rows = GridColumns(table, columns)
    factor = scales["SCALE_Z_GRID"]
    coding = Coding(unit=factor, missing=missing or ())
    if coding != Coding():
        z = Decoded(z, coding)
    road = Grid(u, scales["SCALE_WIDTH"] * v, z, holes=holes, end=end, source=source)
    if missing is None or len(missing):
        road.search = CodeSearch(source, factor or 1.0)
        road.look_for_codes()
    road.notes = tuple(followed)
    changed = [f"{key.lower()} = {value:g}" for key, value in scales.items() if value != 1.0]
    if changed:
        road.notes = (*road.notes, f"modifiers: {', '.join(changed)}")
    if unused:
        road.notes = (
            *road.notes,
            f"not used, as they act beyond the road or where it has holes: {', '.join(unused)}",
        )
    times = f"m times {factor:g}" if factor != 1.0 else "m"
    gone = f"no height: {', '.join(f'{code:g}' for code in missing)}" if missing else ""
    road.readings = (
        ReadAs("x", "reference line u", "m", f"every {step:g} m"),
        ReadAs("y", f"{len(v)} long sections", "m"),
        ReadAs("height", f"data of format {code}", times, gone),
    )
    return road


def referred(file: Path) -> tuple[Path, ...]:
    """The file, and those that it refers to as far as they are there."""
    files = [file]
    while len(files) <= DEEPEST and files[-1].is_file():
        try:
            lines = read_header(files[-1])[0].get("ROAD_CRG_FILE", [])
        except (InputError, OSError):
            break
        names = [text for _, text in lines if text]
        if not names or (target := _target(files[-1], names[0])) in files:
            break
        files.append(target)
    return tuple(files)


def _target(file: Path, name: str) -> Path:
    """The file that a name in another one means."""
    return file.parent / name.strip("'\"").replace("\\", "/")


def _followed(file: Path) -> tuple[Path, Blocks, int, int, list[str]]:
    """The file that holds the road, its header with the blocks of those that refer to it, where its data begin, and notes.

    InputError for a file that is not there, a circle, and a modifier or option that two of the files set differently.
    """
    over: Blocks = {}
    notes: list[str] = []
    seen: list[Path] = []
    while True:
        if file.resolve() in seen or len(seen) > DEEPEST:
            raise InputError(
                f"{file}: refers to itself, through {len(seen)} files ($ROAD_CRG_FILE)"
            )
        seen.append(file.resolve())
        blocks, start, line = read_header(file)
        over = _merged(file, blocks, over)
        names = [(number, text) for number, text in blocks.get("ROAD_CRG_FILE", []) if text]
        if "ROAD_CRG_FILE" not in blocks:
            return file, {**blocks, **over}, start, line, notes
        if len(names) != 1 or start:
            why = (
                "has a road of its own, too"
                if start
                else f"names {len(names)} files, one is needed"
            )
            raise InputError(f"{file}: $ROAD_CRG_FILE {why}")
        number, name = names[0]
        target = _target(file, name)
        if not target.is_file():
            raise InputError(
                f"{file}, line {number}: refers to {name}, and there is no file {target}"
            )
        notes.append(f"{file.name} refers to {target.name}, which was read with its modifiers")
        file = target


def _merged(file: Path, blocks: Blocks, over: Blocks) -> Blocks:
    """Modifiers and options of a file together with those of the files that refer to it."""
    merged: Blocks = {}
    for name in ("ROAD_CRG_MODS", "ROAD_CRG_OPTS"):
        here, above = (key_values(file, part.get(name, [])) for part in (blocks, over))
        for key in here.keys() & above.keys():
            if here[key] != above[key]:
                raise InputError(
                    f"{file}: ${name} {key} = {here[key]:g}, and {above[key]:g} in a file that refers to it: keep one"
                )
        if name in blocks or name in over:
            merged[name] = [*blocks.get(name, []), *over.get(name, [])]
    return merged


def _scales(file: Path, blocks: Blocks) -> dict[str, float]:
    """Factors of heights, length and width among the modifiers. InputError for one that leaves no road."""
    values = key_values(file, blocks.get("ROAD_CRG_MODS", []))
    scales = {key: values.get(key, 1.0) for key in SCALES}
    for key in ("SCALE_LENGTH", "SCALE_WIDTH"):
        if not 0.0 < scales[key] < LONGEST_STEP:
            raise InputError(f"{file}: {key} = {scales[key]:g} leaves no road: it must be positive")
    return scales


def _refuse_blocks(file: Path, blocks: Blocks) -> list[str]:
    """Options without an effect on the road. InputError for what would change heights, by name."""
    unused = []
    for name in ("ROAD_CRG", "KD_DEFINITION"):
        if name not in blocks:
            raise InputError(
                f"{file}: no block ${name}: this is not an OpenCRG file, or it is damaged"
            )
    for block, harmless in (
        ("ROAD_CRG_OPTS", HARMLESS_OPTIONS),
        ("ROAD_CRG_MODS", HARMLESS_MODIFIERS),
    ):
        for key, value in key_values(file, blocks.get(block, [])).items():
            scale = key.startswith("SCALE_")
            applied = block == "ROAD_CRG_MODS" and key in (*SCALES, *OF_THE_LINE)
            without_effect = applied or value == (1.0 if scale else 0.0)
            if not without_effect and key.startswith(BEYOND):
                unused.append(f"{key} = {value:g}")
            elif not without_effect and not key.startswith(harmless):
                raise InputError(
                    f"{file}: ${block} {key} = {value:g} is not supported; apply it to the file "
                    "first, or remove it"
                )
    return unused


def _definition(file: Path, blocks: Blocks) -> tuple[str, list[Channel]]:
    """Format code and the channels as (line, name, unit) of $KD_DEFINITION."""
    code, channels = "KRBI", []
    for number, text in blocks["KD_DEFINITION"]:
        if text.startswith("#:"):
            code = text[2:].strip().upper()
            if code not in FORMATS:
                known = ", ".join(FORMATS)
                raise InputError(f"{file}, line {number}: format {code!r}, not one of {known}")
        elif text.upper().startswith("U:"):
            along = [*text[2:].split(","), ""][1].strip()
            if along.strip("[]()").lower() not in ("", "m", "meter", "metre"):
                raise InputError(
                    f"{file}, line {number}: the reference line u is in {along!r}, not in m"
                )
        elif text.upper().startswith("D:"):
            name, _, unit = text[2:].partition(",")
            channels.append((number, " ".join(name.lower().split()), unit.strip().lower()))
    if not channels:
        raise InputError(f"{file}: $KD_DEFINITION defines no channel (lines of D:name,unit)")
    return code, channels


def _rows(
    file: Path, parameters: dict[str, float], definition: list[tuple[int, str]]
) -> tuple[float, int | None]:
    """Step along the line (m), and the number of cross sections if the header gives an end."""
    step = parameters.get("REFERENCE_LINE_INCREMENT")
    for number, text in definition:
        # The virtual channel repeats the step: U:reference line u,m,start,step
        fields = [field.strip().lower() for field in text.split(",")]
        if fields[:2] != ["u:reference line u", "m"] or len(fields) < 4:
            continue
        (virtual,) = key_values(file, [(number, f"U={fields[3]}")]).values()
        # Writers of the format round it to three decimals: the key decides.
        rounded = 0.501 * 10.0 ** -len(fields[3].partition(".")[2].partition("e")[0])
        if step is not None and abs(virtual - step) > max(1e-3 * abs(step), min(rounded, 1e-3)):
            raise InputError(
                f"{file}, line {number}: step {virtual:g} m, but REFERENCE_LINE_INCREMENT = "
                f"{step:g} m"
            )
        step = virtual if step is None else step
    if step is None:
        raise InputError(f"{file}: REFERENCE_LINE_INCREMENT is missing in $ROAD_CRG")
    if not 0.0 < step < LONGEST_STEP:
        raise InputError(f"{file}: REFERENCE_LINE_INCREMENT = {step:g} m must be positive")
    if "REFERENCE_LINE_END_U" not in parameters:
        return step, None
    length = parameters["REFERENCE_LINE_END_U"] - parameters.get("REFERENCE_LINE_START_U", 0.0)
    steps = length / step
    if not (1.0 - 1e-3 < steps < MAX_BYTES and abs(steps - round(steps)) < 1e-3 * max(1.0, steps)):
        raise InputError(
            f"{file}: REFERENCE_LINE_START_U to END_U, {length:g} m, is not a whole number of "
            f"REFERENCE_LINE_INCREMENT = {step:g} m"
        )
    return step, round(steps) + 1


def _sections(
    file: Path, channels: list[Channel], parameters: dict[str, float]
) -> tuple[Array, list[int]]:
    """Ascending v (m) of the long sections, and their columns in the data."""
    places: list[float] = []
    numbers: list[float] = []
    columns: list[int] = []
    for column, (line, name, unit) in enumerate(channels):
        if not name.startswith("long section"):
            continue
        if unit != "m":
            raise InputError(f"{file}, line {line}: long sections must be in m, not {unit!r}")
        text = name.removeprefix("long section").strip()
        value = re.sub(r"^at v\s*=\s*", "", text)
        try:
            (numbers if value == text else places).append(float(value))
        except ValueError:
            raise InputError(f"{file}, line {line}: {name!r} has no position") from None
        columns.append(column)
    if places and numbers:
        raise InputError(f"{file}: long sections are defined by number and by position at once")
    if len(columns) < 2:
        raise InputError(f"{file}: {len(columns)} long sections, at least 2 are needed")
    v = np.array(places) if places else _numbered(file, np.array(numbers), parameters)
    order = np.argsort(v, kind="stable")
    return v[order], [columns[i] for i in order]


def _numbered(file: Path, numbers: Array, parameters: dict[str, float]) -> Array:
    """v (m) of numbered sections, from the right border on; centred on the line by default."""
    if not np.array_equal(np.sort(numbers), np.arange(1, len(numbers) + 1)):
        raise InputError(f"{file}: long sections are not numbered 1 to {len(numbers)}")
    borders = ("LONG_SECTION_V_RIGHT", "LONG_SECTION_V_LEFT")
    step = parameters.get("LONG_SECTION_V_INCREMENT")
    if step is None and all(key in parameters for key in borders):
        step = (parameters[borders[1]] - parameters[borders[0]]) / (len(numbers) - 1)
    if step is None or not 0.0 < step < LONGEST_STEP:
        raise InputError(
            f"{file}: LONG_SECTION_V_INCREMENT is "
            f"{'missing' if step is None else f'{step:g} m, no step of a road'}"
        )
    right = parameters.get("LONG_SECTION_V_RIGHT", -0.5 * step * (len(numbers) - 1))
    left = right + step * (len(numbers) - 1)
    announced = parameters.get("LONG_SECTION_V_LEFT", left)
    if abs(announced - left) > 1e-3 * step:
        raise InputError(
            f"{file}: LONG_SECTION_V_LEFT = {announced:g} m, but {len(numbers)} long sections "
            f"every {step:g} m from {right:g} m end at {left:g} m"
        )
    return right + step * (numbers - 1.0)


def _check_line(
    file: Path,
    channels: list[Channel],
    parameters: dict[str, float],
    table: Rows,
    step: float,
) -> None:
    """Refuse lines whose slope, banking or curvature does not permit reading heights at (u, v)."""
    for letter, name in (("S", "slope"), ("B", "banking")):
        for key in (f"REFERENCE_LINE_START_{letter}", f"REFERENCE_LINE_END_{letter}"):
            if parameters.get(key, 0.0) != 0.0:
                raise InputError(f"{file}: {key} = {parameters[key]:g}: {name} is not supported")
    start = parameters.get("REFERENCE_LINE_START_Z", 0.0)
    if abs(parameters.get("REFERENCE_LINE_END_Z", start) - start) > 1e-6:  # m, as written
        raise InputError(f"{file}: REFERENCE_LINE_START_Z and END_Z differ: slope is not supported")
    lines = [c for c in channels if c[1].startswith("reference line ")]
    for line, name, _ in lines:
        if name in ("reference line x", "reference line y"):
            raise InputError(f"{file}, line {line}: channel {name!r} is not supported")
    if lines:
        # Each piece repeats a row, so a turn or slope between two rows is within one of them.
        for first, rows in pieces(table, overlap=1):
            _check_rows(file, channels, rows, (first, step))


def _check_rows(file: Path, channels: list[Channel], rows: Array, place: tuple[int, float]) -> None:
    """Refuse slope, banking and sharp turns in rows; `place`: first row and step (m)."""
    first, step = place
    for column, (line, name, _) in enumerate(channels):
        # Slope and heading belong to the segment before a point: the first value of the road is not
        # used.
        values = rows[0 if first or name == "reference line banking" else 1 :, column]
        if name in ("reference line slope", "reference line banking"):
            if np.any(np.nan_to_num(values) != 0.0):
                raise InputError(f"{file}, line {line}: {name} is not zero: not supported")
        elif name == "reference line phi":
            _check_radius(file, values, step, step * max(first, 1))


def _check_radius(file: Path, phi: Array, step: float, start: float) -> None:
    """InputError if the heading (rad), from `start` (m) on, turns faster than permitted."""
    if np.isnan(phi).any():
        missing = int(np.isnan(phi).sum())
        raise InputError(f"{file}: reference line phi is missing at {missing} points")
    turn = np.abs(np.diff(np.unwrap(phi))) / step
    if len(turn) > 0 and turn.max() > 1.0 / SMALLEST_RADIUS:
        raise InputError(
            f"{file}: the reference line turns with a radius of {1.0 / turn.max():.3g} m at "
            f"{start + step * int(turn.argmax()):.4g} m along; below {SMALLEST_RADIUS:g} m heights "
            "cannot be read along it"
        )
