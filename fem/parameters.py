"""Parameters of models, declared once: type, unit, range and meaning; and registries of named variants.

Dataclass fields are made by `number`, `integer`, `flag`, `choice`, `text`, `filename` or `vector`.
They are the only description of a parameter: the constructor, the scene file, `check`, the key
reference and the error messages follow from them. Like `fem.errors`, all packages may import this
module; it needs only the standard library.
"""

import importlib
import math
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import Field, dataclass, field, fields
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any, Generic, TypeVar, dataclass_transform

from tireroad.fem.errors import InputError

OnlyFor = tuple[str, tuple[str, ...]] | None


@dataclass(frozen=True)
class Limits:
    """A closed range; None: no limit. The lower limit of a size is the least sensible value."""

    least: float | None = None
    most: float | None = None

    def __str__(self) -> str:
        low = f"≥ {self.least:g}" if self.least is not None else ""
        high = f"≤ {self.most:g}" if self.most is not None else ""
        return ", ".join(part for part in (low, high) if part) or "any"

    def check(self, value: float, unit: str) -> None:
        """Raises ValueError for a value outside the range."""
        inside = (self.least is None or value >= self.least) and (
            self.most is None or value <= self.most
        )
        if not inside:
            # The "g" format overflows for very large integers.
            written = f"{value:g}" if isinstance(value, float) else described(value)
            shown = f"{written} {unit}".rstrip(" -")
            raise ValueError(f"must be {self}{f' {unit}' if unit != '-' else ''}, not {shown}")


@dataclass(frozen=True, kw_only=True)
class Key:
    """One parameter: how to read a value, its unit, meaning and allowed values.

    `values` describes in words what is allowed, unless `choices` lists the allowed words; `limits`:
    range of numbers; `optional`: may be absent (None); `is_file`: a file name; `is_whole`: an integer;
    `only_for`: (name of the selecting key, its values) for a parameter that only some kinds of its
    table have.
    """

    read: Callable[[Any], Any]
    unit: str = "-"
    doc: str
    values: str = ""
    optional: bool = False
    only_for: OnlyFor = None
    limits: Limits | None = None
    choices: Iterable[str] = ()
    is_file: bool = False
    is_whole: bool = False

    @property
    def allowed(self) -> str:
        """The allowed values, in words."""
        return self.values or ", ".join(self.choices)


def key_of(item: Field) -> Key | None:
    """The description of a field; None if it is not a parameter."""
    return item.metadata.get("key")


def keys(of: type) -> Iterator[tuple[Field, Key]]:
    """The parameters of a dataclass, in order."""
    for item in fields(of):
        key = key_of(item)
        if key is not None:
            yield item, key


def described(value: Any) -> str:
    """A value as the user wrote it, shortened for a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value[:60]}"'
    if isinstance(value, dict):
        return "a table"
    return str(value)[:60]


def plain(value: Any) -> Any:
    """A scalar or 0-d array of numpy as Python's own number; another value as it is."""
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def whole(value: Any) -> int:
    """A whole number, also of numpy, as an int (not bool); else raises ValueError."""
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise ValueError(f"must be a whole number, not {described(value)}")
    return int(value)


def finite(value: Any) -> float:
    """A finite real number, also of numpy, as a float (not bool); else raises ValueError."""
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ValueError(f"must be a number, not {described(value)}")
    try:
        result = float(value)
    except OverflowError:
        raise ValueError("is too large a number") from None
    if not math.isfinite(result):
        raise ValueError(f"must be a finite number, not {described(value)}")
    return result


class ParameterError(InputError):
    """A parameter of wrong type or out of range: `parameter` is its name, `reason` the fault."""

    def __init__(self, parameter: str, reason: str, owner: str = "") -> None:
        super().__init__(f"{owner}: {parameter} {reason}" if owner else f"{parameter} {reason}")
        self.parameter, self.reason = parameter, reason


@dataclass_transform(frozen_default=True, kw_only_default=True)
@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Base of dataclasses of parameters: the constructor checks each value, then calls `validate`.

    Raises ParameterError (an InputError) that names the parameter, its value and its range.
    """

    owner = ""  # what the parameters belong to, for messages

    def __post_init__(self) -> None:
        for item, key in keys(type(self)):
            value = getattr(self, item.name)
            if value is None and key.optional:
                continue
            try:
                object.__setattr__(self, item.name, key.read(value))
            except ValueError as error:
                raise ParameterError(item.name, str(error), self.owner) from None
        try:
            self.validate()
        except ParameterError as error:
            raise ParameterError(error.parameter, error.reason, self.owner) from None

    def validate(self) -> None:
        """Check conditions between parameters; raises ParameterError(name, reason)."""


def parameter(key: Key, default: Any) -> Any:
    """A dataclass field with the given description."""
    return field(default=default, metadata={"key": key})


def number(
    default: float | str | None,
    unit: str,
    doc: str,
    *,
    least: float | None = None,
    most: float | None = None,
    word: str | None = None,
    only_for: OnlyFor = None,
) -> Any:
    """A finite real number, or the single `word` if given. A default of None makes it optional."""
    limits = Limits(least, most)

    def read(value: Any) -> float | str:
        if word is not None and value == word:
            return word
        if word is not None and isinstance(value, str):
            raise ValueError(f'must be a number or "{word}", not {described(value)}')
        result = finite(value)
        limits.check(result, unit)
        return result

    allowed = f'{limits} or "{word}"' if word else str(limits)
    optional = default is None
    key = Key(
        read=read,
        unit=unit,
        doc=doc,
        values=allowed,
        optional=optional,
        only_for=only_for,
        limits=limits,
    )
    return parameter(key, default)


def integer(
    default: int | None, doc: str, *, least: int, most: int, only_for: OnlyFor = None
) -> Any:
    """An integer between least and most. A default of None makes it optional."""
    limits = Limits(least=least, most=most)

    def read(value: Any) -> int:
        result = whole(value)
        limits.check(result, "-")
        return result

    optional = default is None
    key = Key(
        read=read,
        doc=doc,
        values=str(limits),
        optional=optional,
        only_for=only_for,
        limits=limits,
        is_whole=True,
    )
    return parameter(key, default)


def flag(default: bool | None, doc: str, *, only_for: OnlyFor = None) -> Any:
    """A boolean, true or false. A default of None makes it optional."""

    def read(value: Any) -> bool:
        if not isinstance(value, bool):
            raise ValueError(f"must be true or false, not {described(value)}")
        return value

    return parameter(Key(read=read, doc=doc, values="true, false", only_for=only_for), default)


def choice(
    default: str | None,
    choices: tuple[str, ...],
    doc: str,
    *,
    only_for: OnlyFor = None,
    dropped: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """One of several words. A default of None makes it optional.

    `dropped`: words of earlier versions, and what to take in their place.
    """
    words = ", ".join(choices)

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in choices:
            known = isinstance(value, str) and value in dropped
            advice = f"; dropped: {dropped[value]}" if known else ""
            raise ValueError(f"must be one of {words}, not {described(value)}{advice}")
        return value

    optional = default is None
    key = Key(read=read, doc=doc, optional=optional, only_for=only_for, choices=choices)
    return parameter(key, default)


def text(default: str | None, doc: str, *, only_for: OnlyFor = None) -> Any:
    """A text that is not empty. A default of None makes it optional."""
    optional = default is None
    key = Key(read=_read_text, doc=doc, values="text", optional=optional, only_for=only_for)
    return parameter(key, default)


def numbers(
    doc: str,
    unit: str,
    limits: Limits,
    default: tuple[float, ...] | None = (),
    *,
    size: int | None = None,
) -> Any:
    """A list of finite numbers, each within the limits, of any length or `size`. A default of None makes it optional."""
    many = "" if size is None else f"{size} "

    def read(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or size not in (None, len(value)):
            raise ValueError(f"must be a list of {many}numbers, not {described(value)}")
        result = tuple(finite(part) for part in value)
        for part in result:
            limits.check(part, unit)
        return result

    key = Key(
        read=read,
        unit=unit,
        doc=doc,
        values=f"{many}numbers, {limits}",
        limits=limits,
        optional=default is None,
    )
    return parameter(key, default)


def factors(doc: str, limits: Limits, *, only_for: OnlyFor = None) -> Any:
    """A table of finite numbers by free names, each within the limits; absent by default."""

    def read(value: Any) -> dict[str, float]:
        if not isinstance(value, dict):
            raise ValueError(f"must be a table of numbers by name, not {described(value)}")
        result = {}
        for name, number in value.items():
            try:
                result[name] = finite(number)
                limits.check(result[name], "-")
            except ValueError as error:
                raise ValueError(f'"{name}" {error}') from None
        return result

    key = Key(
        read=read,
        doc=doc,
        values=f"numbers by name, {limits}",
        optional=True,
        only_for=only_for,
    )
    return parameter(key, None)


def texts(doc: str, *, only_for: OnlyFor = None) -> Any:
    """A list of texts, or a single one; empty by default."""

    def read(value: Any) -> tuple[str, ...]:
        if isinstance(value, str):
            value = (value,)
        if not isinstance(value, list | tuple):
            raise ValueError(f"must be a text or a list of texts, not {described(value)}")
        return tuple(_read_text(part) for part in value)

    return parameter(Key(read=read, doc=doc, values="texts", only_for=only_for), ())


def filename(doc: str, *, only_for: OnlyFor = None) -> Any:
    """The name of a file, in a scene relative to the scene file. Absent by default."""
    key = Key(
        read=_read_file, doc=doc, values="file", optional=True, is_file=True, only_for=only_for
    )
    return parameter(key, None)


def _read_text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip() or "\0" in value:
        raise ValueError(f"must be a text, not {described(value)}")
    return value


def _read_file(value: Any) -> str:
    return _read_text(str(value) if hasattr(value, "__fspath__") else value)


def vector(
    default: tuple[float, ...],
    unit: str,
    doc: str,
    *,
    least: float | None = None,
    most: float | None = None,
    absent: bool = False,
) -> Any:
    """A list of finite numbers, as many as the default has; `absent`: None is what it has instead."""
    limits = Limits(least=least, most=most)
    return numbers(doc, unit, limits, None if absent else default, size=len(default))


T = TypeVar("T", bound=Parameters)


class Registry(Generic[T]):
    """Parameter classes by name.

    `label` says what they are ("road kind"). The modules of `package` are imported when a name is
    first looked up, so that a file added there is found.
    """

    def __init__(self, label: str, package: str, base: type[T]) -> None:
        self.label = label
        self._package, self._base = package, base
        self._classes: dict[str, type[T]] = {}
        self._docs: dict[str, str] = {}
        self._found = False

    def register(self, name: str, doc: str) -> Callable[[type], type]:
        """Decorator that makes the class a frozen keyword-only dataclass known by `name`.

        `doc` is its line in the key reference. Raises InputError if the name is taken or the class
        is not derived from the registry's base.
        """

        def decorate(of: type) -> type:
            if not issubclass(of, self._base):
                raise InputError(f"{self.label} {name}: must be derived from {self._base.__name__}")
            registered = dataclass(frozen=True, kw_only=True)(of)
            known = self._classes.get(name)
            if known is not None and known.__qualname__ != registered.__qualname__:
                raise InputError(f"{self.label} {name}: is taken by {known.__qualname__}")
            self._classes[name], self._docs[name] = registered, doc
            return registered

        return decorate

    def forget(self, name: str) -> None:
        """Remove a variant: for notebooks and tests that register their own."""
        self._classes.pop(name, None)
        self._docs.pop(name, None)

    def _find(self) -> None:
        if self._found:
            return
        self._found = True
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{self._package}.{module.name}")

    def __getitem__(self, name: str) -> type[T]:
        self._find()
        if name not in self._classes:
            raise InputError(f"{self.label} {name!r} is unknown: take one of {', '.join(self)}")
        return self._classes[name]

    def make(self, name: str, **values: Any) -> T:
        """The variant `name` with these parameters, the others at their defaults."""
        return self[name](**values)

    def __contains__(self, name: object) -> bool:
        self._find()
        return name in self._classes

    def __iter__(self) -> Iterator[str]:
        self._find()
        return iter(sorted(self._classes))

    def doc(self, name: str) -> str:
        """One-line description of the variant."""
        self._find()
        return self._docs[name]

    def owners(self, parameter: str) -> list[str]:
        """The variants that have a parameter of this name."""
        return [name for name in self if parameter in {item.name for item in fields(self[name])}]


def second_digit(value: float) -> float:
    """The unit of the second digit of a positive number: 1e-4 for 0.0028."""
    return float(10.0 ** (math.floor(math.log10(value)) - 1))
