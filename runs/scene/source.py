"""Where the values of a scene come from, and what is wrong with them: all of it, not the first thing."""

from dataclasses import dataclass, field
from pathlib import Path

from tireroad.fem.errors import InputError
from tireroad.runs.scene import locate

Path_ = tuple[str, ...]


@dataclass(frozen=True)
class Source:
    """The file, its text and the paths set by --set; `problems` collects (path of the key, message)."""

    path: Path
    text: str
    overridden: frozenset[Path_] = frozenset()
    problems: list[tuple[Path_, str]] = field(default_factory=list)

    def where(self, path: Path_) -> str:
        """The file and line of a key, or the --set that gave it."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.overridden:
                return f"--set {shortened(path[:length])}"
        line = locate.line_of(self.text, path)
        return f"{self.path}, line {line}" if line else f"{self.path}"

    def add(self, path: Path_, message: str) -> None:
        """Note what is wrong with a key."""
        self.problems.append((path, f"{self.where(path)}: {shortened(path)} {message}"))

    def add_as_is(self, path: Path_, message: str) -> None:
        """Note what is wrong, in a message that names the key itself."""
        self.problems.append((path, f"{self.where(path)}: {message}"))

    def error(self, path: Path_, message: str) -> InputError:
        """One thing that is wrong, as an exception."""
        return InputError(f"{self.where(path)}: {shortened(path)} {message}")

    def broken(self) -> set[str]:
        """The tables in which something is wrong."""
        return {path[0] for path, _ in self.problems if path}

    def refuse(self) -> None:
        """InputError with all that is wrong, if anything is."""
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
    """A dotted key; parts that are too long to be one of ours are cut."""
    return ".".join(part if len(part) <= 60 else f"{part[:57]}..." for part in path[:12])
