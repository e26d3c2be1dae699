"""Parameters of models: type, unit, range, meaning, and the check of values.

Dataclass fields are made by `number`, `integer`, `flag`, `choice`, `text`, `filename` or `vector`.
They are the only description of a parameter: the constructor, the scene file, `check`, the key
reference and the error messages follow from them. Like `fem.errors`, all packages may import this
module; it needs only the standard library.
"""

from dataclasses import dataclass, field
from typing import Any, dataclass_transform

from tireroad.fem.errors import InputError
from tireroad.fem.keys import Key, Limits, OnlyFor, described, finite, keys, whole


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


def flag(default: bool, doc: str, *, only_for: OnlyFor = None) -> Any:
    """A boolean, true or false."""

    def read(value: Any) -> bool:
        if not isinstance(value, bool):
            raise ValueError(f"must be true or false, not {described(value)}")
        return value

    return parameter(Key(read=read, doc=doc, values="true, false", only_for=only_for), default)


def choice(
    default: str | None, choices: tuple[str, ...], doc: str, *, only_for: OnlyFor = None
) -> Any:
    """One of several words. A default of None makes it optional."""
    words = ", ".join(choices)

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in choices:
            raise ValueError(f"must be one of {words}, not {described(value)}")
        return value

    optional = default is None
    key = Key(read=read, doc=doc, optional=optional, only_for=only_for, choices=choices)
    return parameter(key, default)


def text(default: str | None, doc: str, *, only_for: OnlyFor = None) -> Any:
    """A text that is not empty. A default of None makes it optional."""
    optional = default is None
    key = Key(read=_read_text, doc=doc, values="text", optional=optional, only_for=only_for)
    return parameter(key, default)


def numbers(doc: str, unit: str, limits: Limits, default: tuple[float, ...] = ()) -> Any:
    """A list of finite numbers of any length, each within the limits."""

    def read(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple):
            raise ValueError(f"must be a list of numbers, not {described(value)}")
        result = tuple(finite(part) for part in value)
        for part in result:
            limits.check(part, unit)
        return result

    key = Key(read=read, unit=unit, doc=doc, values=f"numbers, {limits}", limits=limits)
    return parameter(key, default)


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
    size = len(default)
    limits = Limits(least=least, most=most)

    def read(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or len(value) != size:
            raise ValueError(f"must be a list of {size} numbers, not {described(value)}")
        result = tuple(finite(part) for part in value)
        for part in result:
            limits.check(part, unit)
        return result

    allowed = f"{size} numbers, {limits}"
    key = Key(read=read, unit=unit, doc=doc, values=allowed, limits=limits, optional=absent)
    return parameter(key, None if absent else default)
