"""The origin of a scene's values, and the collection of all its problems."""

from dataclasses import dataclass, field
from pathlib import Path

from tireroad.fem.errors import InputError
from tireroad.runs.scene import locate

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
        if line := locate.line_of(self.text, path):
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
