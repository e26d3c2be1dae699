"""A result folder as a mapping of numpy arrays with units, for scripts and notebooks."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import (
    is_as_signed,
    is_table_as_signed,
    signed,
    text_digest,
)
from tireroad.runs.files.folder import ending, left_out
from tireroad.runs.files.store import AGAIN, verify


def check_results(directory: Path) -> None:
    """Raise InputError, with what to give instead, unless the folder holds results of a run."""
    if (directory / "summary.json").is_file():
        return
    if (directory / "sweep.csv").is_file():
        raise InputError(
            f"{directory}: the results of a sweep: see sweep.html in it; each of its runs has a folder in "
            f"{directory / 'members'}"
        )
    if not directory.exists():
        raise InputError(f"{directory}: there is no such folder")
    if not directory.is_dir():
        raise InputError(f"{directory}: a file: give the folder with the results of a run")
    raise InputError(f"{directory}: no result folder: it has no summary.json")


class RunResults(Mapping[str, NDArray[Any]]):
    """The datasets of all result files in a folder, read on access.

    `run["contact/total_force"]` is the dataset `total_force` of `contact.h5`; `unit(name)` is its
    unit; `attributes(file)` are a file's attributes (for example
    `run.attributes("static")["load"]`, N); `scene` is the resolved scene, `summary` the stages as
    in `summary.json`; `left_out` are the files that an earlier run of another scene left in the
    folder, which are not read, each with the reason. No file stays open. Raises InputError for a folder without results and for an
    unreadable or damaged file; KeyError, with the names available, for a dataset that does not exist.
    """

    def __init__(self, directory: str | Path) -> None:
        try:
            self.directory = Path(directory)
        except TypeError:
            raise InputError(f"{directory!r}: no path of a folder with results") from None
        check_results(self.directory)
        self.left_out = left_out(self.directory)
        self._units: dict[str, str] | None = None

    @property
    def scene(self) -> dict[str, Any]:
        """The resolved scene with every default."""
        return tomllib.loads(self._scene_text())

    @property
    def summary(self) -> dict[str, Any]:
        """Per stage: seconds, headline figures and indicators with units, warnings."""
        return self._table()["stages"]

    @property
    def ending(self) -> str:
        """How the run ended if it was stopped or failed, else ""."""
        return ending(self._table())

    def finished(self, scenes: Iterable[str]) -> bool:
        """Whether the run of one of these scenes, resolved as in scene.toml, is finished.

        A run that failed or was stopped leaves results of an earlier one beside its own.
        """
        known, table = set(scenes), self._table()
        own = self._scene_text() in {signed(text) for text in known}
        told = table.get("resolved_scene") in {text_digest(text) for text in known}
        return own and told and "report" in table["stages"]

    def unit(self, name: str) -> str:
        """The unit of a dataset; "-" if dimensionless."""
        self._known(name)
        return self._listed()[name]

    def attributes(self, file: str) -> dict[str, Any]:
        """The attributes of a file, e.g. "static" for `static.h5`: figures and provenance."""
        with self._opened(file) as opened:
            attributes = dict(opened.attrs)
        return {key: v.item() if isinstance(v, np.generic) else v for key, v in attributes.items()}

    def __getitem__(self, name: str) -> NDArray[Any]:
        self._known(name)
        file, _, path = name.partition("/")
        with self._opened(file) as opened:
            item = opened[path]
            texts = h5py.check_string_dtype(item.dtype) is not None
            return np.asarray(item.asstr()[()] if texts else item[()])

    def __iter__(self) -> Iterator[str]:
        return iter(self._listed())

    def __len__(self) -> int:
        return len(self._listed())

    def __repr__(self) -> str:
        without = f"; left out: {', '.join(self.left_out)}" if self.left_out else ""
        return f"RunResults({str(self.directory)!r}: {len(self)} datasets{without})"

    def _scene_text(self) -> str:
        text = self._text("scene.toml")
        if not is_as_signed(text):
            raise self._damaged("scene.toml", "it is not what the run wrote (checksum)")
        return text

    def _table(self) -> dict[str, Any]:
        """All of summary.json."""
        try:
            table = json.loads(self._text("summary.json"))
            table["stages"].items()
        except (ValueError, KeyError, TypeError, AttributeError):
            raise self._damaged("summary.json", "it is not the summary of a run") from None
        if not is_table_as_signed(table):
            raise self._damaged("summary.json", "it is not what the run wrote (checksum)")
        return table

    def _text(self, name: str) -> str:
        path = self.directory / name
        try:
            return path.read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(f"{path} cannot be read ({error.strerror}); {AGAIN}") from None
        except UnicodeDecodeError:
            raise self._damaged(name, "it is not text") from None

    def _damaged(self, name: str, why: str) -> InputError:
        return InputError(f"{self.directory / name} is damaged: {why}; {AGAIN}")

    def _known(self, name: str) -> None:
        if name not in self._listed():
            file = name.partition("/")[0]
            self._counted(file)
            near = [known for known in self._listed() if known.startswith(f"{file}/")]
            raise KeyError(f"{name}; there are {', '.join(near or self._listed())}")

    def _listed(self) -> dict[str, str]:
        """The unit of every dataset, by name."""
        if self._units is None:
            units: dict[str, str] = {}
            paths = sorted(self.directory.glob("*.h5"))
            for path in (path for path in paths if path.name not in self.left_out):
                with self._opened(path.stem) as opened:
                    units |= {f"{path.stem}/{name}": unit for name, unit in _units(opened)}
            self._units = units
        return self._units

    def _counted(self, stem: str) -> None:
        """KeyError for a file that is left out."""
        if (why := self.left_out.get(f"{stem}.h5")) is not None:
            raise KeyError(f"{stem}.h5 in {self.directory} is left out: {why}")

    def _opened(self, stem: str) -> h5py.File:
        self._counted(stem)
        path = self.directory / f"{stem}.h5"
        if not path.is_file():
            raise KeyError(f"{stem}.h5 is not in {self.directory}")
        verify(path, foreign=True)
        try:
            return h5py.File(path, "r")
        except OSError as error:
            raise InputError(f"{path} is damaged or no HDF5 file: {error}") from error


def _units(file: h5py.File) -> list[tuple[str, str]]:
    """Name and unit of every dataset."""
    units: list[tuple[str, str]] = []

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            units.append((name, str(item.attrs.get("unit", "-"))))

    file.visititems(visit)
    return units


def load(directory: str | Path) -> RunResults:
    """Open the results in a folder for reading."""
    return RunResults(directory)
