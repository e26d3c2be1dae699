"""Finds the line of a key in a scene's text, for messages: the TOML reader returns values only."""

import re

HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
ASSIGNMENT = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*[^\s=.]+)*)\s*=""")


def parts(dotted: str) -> tuple[str, ...]:
    """The parts of a dotted key, without quotes and blanks."""
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _paths(text: str) -> list[tuple[int, tuple[str, ...]]]:
    """Every header and assignment with its line number (from 1) and full path."""
    found: list[tuple[int, tuple[str, ...]]] = []
    here: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    quoted = ""
    for line_number, line in enumerate(text.splitlines(), 1):
        if quoted:
            quoted = "" if quoted in line else quoted
            continue
        if match := HEADER.match(line):
            here = parts(match[2])
            if match[1] == "[[":
                counts[here] = counts.get(here, -1) + 1
                here = (*here, str(counts[here]))
            found.append((line_number, here))
        elif match := ASSIGNMENT.match(line):
            found.append((line_number, here + parts(match[1])))
            opened = [mark for mark in ('"""', "'''") if line.count(mark) == 1]
            quoted = opened[0] if opened else ""
    return found


def line_of(text: str, path: tuple[str, ...]) -> int | None:
    """The line of `path` (table, …, key), or of the innermost table that contains it.

    A list of tables is where its first one is.
    """
    best: tuple[int, int] | None = None
    for line_number, found in _paths(text):
        if found == (*path, "0"):
            found = path
        if path[: len(found)] == found and (best is None or len(found) > best[1]):
            best = (line_number, len(found))
    return best[0] if best else None
