"""Named variants of a model: a new one is a decorated class in its own file or a user's script."""

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any, Generic, TypeVar

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Parameters

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
            made = dataclass(frozen=True, kw_only=True)(of)
            known = self._classes.get(name)
            if known is not None and known.__qualname__ != made.__qualname__:
                raise InputError(f"{self.label} {name}: is taken by {known.__qualname__}")
            self._classes[name], self._docs[name] = made, doc
            return made

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
        return [name for name in self if parameter in {one.name for one in fields(self[name])}]
