"""The modes on all unknowns, in the shared cache beside modes.h5.

A family with attachment modes thus solves them once. Not in the result folder: 38 MB for 157 modes
of 30,240 unknowns. Those above LARGEST are solved again by each member.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from tireroad.fem.matrices.operators import Operators
from tireroad.modal.basis import ModalBasis, same_fields
from tireroad.modal.solver.slicing import Modes
from tireroad.runs.files.store import put
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base.job import Job

NAME = "fields"
LARGEST = 300e6  # bytes: each process holds all of them while they are written or read
_KEPT = ("orthonormality", "inertia_count", "counted_below", "rigid", "slices", "segments")


def keep(job: Job, key: str, operators: Operators, modes: Modes) -> None:
    """Store the fields of the modes with the hash `key` in the cache, if any. Collective."""
    body = operators.body
    if job.cache.folder is None or _size(operators, len(modes.squares)) > LARGEST:
        return
    whole = body.everywhere(operators.spread(modes.vectors))

    def fill(file: Any) -> None:
        put(file, "field", whole, "kg^-1/2")
        put(file, "square", modes.squares, "1/s2")
        put(file, "residual", modes.residual, "-")
        file.attrs.update({name: getattr(modes, name) for name in _KEPT})
        file.attrs["sectors"], file.attrs["symmetries"] = modes.sectors, list(modes.symmetries)

    path = job.path(NAME)
    job.write(path, job.provenance(NAME, key), fill)

    def move() -> None:
        job.cache.keep(NAME, key, path, {})
        path.unlink()

    on_root(job.comm, move)


def kept(job: Job, key: str, operators: Operators, basis: ModalBasis) -> Modes | None:
    """The modes of a basis with the hash `key`, with fields, from the cache; else None.

    None also if they belong to another solution: fields and modes.h5 enter the cache separately,
    from runs on any number of processes. Collective.
    """
    count = basis.projection.own
    if job.fresh or job.cache.folder is None or _size(operators, count) > LARGEST:
        return None
    path = job.path(NAME)
    if on_root(job.comm, lambda: job.cache.fetch(NAME, key, path)) is None:
        return None
    found = job.read(path, _read)

    def remove() -> None:
        with suppress(OSError):
            path.unlink()

    on_root(job.comm, remove)
    whole = found.pop("field")
    vectors = operators.restrict(np.ascontiguousarray(whole[operators.body.ids]))
    return (
        Modes(vectors=vectors, **found)
        if same_fields(operators.trace(vectors), basis.shape)
        else None
    )


def _read(file: Any) -> dict[str, Any]:
    given = file.attrs
    found = {name: given[name].item() for name in _KEPT}
    found |= {"squares": file["square"][:], "residual": file["residual"][:]}
    found |= {"sectors": tuple(int(n) for n in given["sectors"])}
    return found | {"symmetries": tuple(map(str, given["symmetries"])), "field": file["field"][:]}


def _size(operators: Operators, count: int) -> float:
    return 24.0 * operators.body.lattice.size * count
