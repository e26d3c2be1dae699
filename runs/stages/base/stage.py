"""A stage: a function of typed inputs whose frozen product goes to a file and comes back from it."""

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
    """A product, with the `key` (hash) of all that it was computed from; "" of what has no file.

    It is made or read when it is first asked for: what nobody needs is never read. Collective then.
    """

    def __init__(self, key: str, make: Callable[[], P]) -> None:
        self.key, self._make = key, make

    @cached_property
    def product(self) -> P:
        """The product itself."""
        return self._make()


@dataclass(frozen=True, kw_only=True)
class Part(ABC, Generic[P]):
    """A link of the pipeline. Its fields beside `job` are the parts it takes, by their names."""

    name: ClassVar[str]
    job: Job

    @classmethod
    def taken(cls, job: Job, done: Mapping[str, Done]) -> Part | None:
        """The part with what it takes of what is done; None where something it needs is not there."""
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
    """What several stages take, made when one asks for it, and kept in no file."""

    @abstractmethod
    def make(self) -> P:
        """The product. Collective where its parts are."""


class Stage(Part[P]):
    """A part whose product is kept in the file `<name>.h5` and reused while its inputs stay the same."""

    @abstractmethod
    def inputs(self) -> Mapping[str, Any]:
        """All the product depends on, the keys of other products among it. Collective."""

    @abstractmethod
    def produce(self, key: str, record: Record) -> P:
        """The product, its file written; figures of the computation go to the record. Collective."""

    @abstractmethod
    def read(self, file: Any) -> Any:
        """What a file holds of the product. Root process only."""

    def restored(self, held: Any) -> P:
        """The product from what its file holds; by default just that. On every process."""
        return held

    def stored(self) -> P:
        """The product as its file has it. Collective."""
        return self.restored(self.job.read(self.job.path(self.name), self.read))

    @classmethod
    def instead(cls, job: Job, done: Mapping[str, Done]) -> Done[P] | None:
        """What later parts take in the place of a stage that is skipped; None: they go without."""
        return None


class Computed(Stage[P]):
    """A stage that is computed first and written after."""

    @abstractmethod
    def compute(self, record: Record) -> P:
        """The product; figures of the computation go to the record. Collective."""

    @abstractmethod
    def write(self, file: Any, product: P) -> None:
        """Fill an empty file. Root process only."""

    def produce(self, key: str, record: Record) -> P:
        """Compute the product and write its file. Collective."""
        product = self.compute(record)
        provenance = self.job.provenance(self.name, key)
        self.job.write(self.job.path(self.name), provenance, lambda file: self.write(file, product))
        return product
