"""The origin of a scene's values, the line of each, and the collection of all its problems."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from tireroad.fem.errors import InputError

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


Path_ = tuple[str, ...]


@dataclass(frozen=True)
class Source:
    """The file, its text and the paths set by --set; `problems`: (path of the key, message).

    `unread`: the keys of files that the run will not read."""

    path: Path
    text: str
    overridden: frozenset[Path_] = frozenset()
    problems: list[tuple[Path_, str]] = field(default_factory=list)
    unread: frozenset[Path_] = frozenset()

    def where(self, path: Path_) -> str:
        """The file and line of a key, or the --set that gave it."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.overridden:
                return f"--set {shortened(path[:length])}"
        if line := line_of(self.text, path):
            return f"{self.path}, line {line}"
        below = (one for one in self.overridden if one[: len(path)] == path)
        return f"--set {shortened(least)}" if (least := min(below, default=())) else f"{self.path}"

    def add(self, path: Path_, message: str) -> None:
        """Note a problem with a key."""
        self.problems.append((path, f"{self.where(path)}: {shortened(path)} {message}"))

    def add_as_is(self, path: Path_, message: str) -> None:
        """Note a problem whose message names the key itself."""
        self.problems.append((path, f"{self.where(path)}: {message}"))

    def error(self, path: Path_, message: str) -> InputError:
        """A single problem, as an exception."""
        return InputError(f"{self.where(path)}: {shortened(path)} {message}")

    def broken(self) -> set[str]:
        """The tables that have a problem."""
        return {path[0] for path, _ in self.problems if path}

    def refuse(self) -> None:
        """Raise InputError with all problems, if there are any."""
        messages = list(dict.fromkeys(message for _, message in self.problems))
        if len(messages) == 1:
            raise InputError(messages[0])
        if messages:
            listed = "\n".join(f"  {message}" for message in messages[:_SHOWN])
            more = len(messages) - _SHOWN
            rest = f"\n  and {more} more" if more > 0 else ""
            raise InputError(f"{len(messages)} errors in the scene\n{listed}{rest}")


_SHOWN = 30


def shortened(path: Path_) -> str:
    """A dotted key; parts too long to be valid keys are truncated."""
    return ".".join(part if len(part) <= 60 else f"{part[:57]}..." for part in path[:12])
