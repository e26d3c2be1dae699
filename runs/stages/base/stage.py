"""A stage: a function of typed inputs whose frozen product is written to a file and read back."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record

P = TypeVar("P")


class Done(Generic[P]):
    """A product with the `key` (hash) of all its inputs; the key is "" if the product has no file.

    It is computed or read on first use, so that an unused product is never read. That use is
    collective.
    """

    def __init__(self, key: str, make: Callable[[], P]) -> None:
        self.key, self._make = key, make

    @cached_property
    def product(self) -> P:
        """The product itself."""
        return self._make()


@dataclass(frozen=True, kw_only=True)
class Part(ABC, Generic[P]):
    """A part of the pipeline. Apart from `job`, its fields are the parts it takes, by name."""

    name: ClassVar[str]
    job: Job

    @classmethod
    def taken(cls, job: Job, done: Mapping[str, Done]) -> Part | None:
        """The part with its inputs from `done`; None if a required input is missing."""
        given: dict[str, Any] = {}
        for item in fields(cls):
            if item.name == "job":
                continue
            if item.name in done:
                given[item.name] = done[item.name]
            elif item.default is MISSING:
                return None
        return cls(job=job, **given)


class Shared(Part[P]):
    """A part used by several stages, made on first use and not stored in a file."""

    @abstractmethod
    def make(self) -> P:
        """The product. Collective where its parts are."""


class Stage(Part[P]):
    """A part whose product is stored in `<name>.h5` and reused while its inputs are unchanged."""

    @abstractmethod
    def inputs(self) -> Mapping[str, Any]:
        """Everything the product depends on, including the keys of other products. Collective."""

    @abstractmethod
    def produce(self, key: str, record: Record) -> P:
        """Make the product and write its file; figures go into the record. Collective."""

    @abstractmethod
    def read(self, file: Any) -> Any:
        """The content of the product's file. Root process only."""

    def restored(self, held: Any) -> P:
        """The product from its file's content, by default that content. On every process."""
        return held

    def stored(self) -> P:
        """The product as stored in its file. Collective."""
        return self.restored(self.job.read(self.job.path(self.name), self.read))

    @classmethod
    def instead(cls, job: Job, done: Mapping[str, Done]) -> Done[P] | None:
        """What later parts receive if this stage is skipped; None: nothing."""
        return None


class Computed(Stage[P]):
    """A stage whose product is first computed, then written."""

    @abstractmethod
    def compute(self, record: Record) -> P:
        """Compute the product; figures go into the record. Collective."""

    @abstractmethod
    def write(self, file: Any, product: P) -> None:
        """Write the product into an empty file. Root process only."""

    def produce(self, key: str, record: Record) -> P:
        """Compute the product and write its file. Collective."""
        product = self.compute(record)
        provenance = self.job.provenance(self.name, key)
        self.job.write(self.job.path(self.name), provenance, lambda file: self.write(file, product))
        return product
