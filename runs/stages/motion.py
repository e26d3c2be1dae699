"""Stage motion: displacement of the outer face over time at the end of a run, for films."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tireroad.greens.basis import Basis
from tireroad.runs.files.store import dataset
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.stage import Record
from tireroad.runs.stages.whole_tire import PatchForces, WholeTire, replayed

_INSTANTS = 400  # at most; the last ones of the run
_PER_PERIOD = 8  # of the band's upper frequency


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Motion of the outer face at the instants `time` (g,) s.

    `displacement` (g, s, 3) m from the static state, of the nodes at `points` (s, 3) m, with the
    motion of the wheel. From the modes only: the residual flexibility is not included.
    """

    time: np.ndarray = dataset("s")
    displacement: np.ndarray = dataset("m")
    points: np.ndarray = dataset("m", "surface/points")


@dataclass(frozen=True, kw_only=True)
class MotionStage(WholeTire[Motion]):
    """Integrates the states once more under the forces of the run, which are known by now."""

    name: ClassVar[str] = "motion"
    kind: ClassVar[type] = Motion

    def compute(self, record: Record) -> Motion | None:
        """The outer face at the stored instants; None but on the root process. Collective."""
        made: list[Motion] = []
        basis, forces = self.taken_in()
        on_root(self.job.comm, lambda: made.append(self._seen(basis, forces())))
        if not made:
            return None
        size = float(np.linalg.norm(made[0].displacement, axis=2).max(initial=0.0))
        record.headline["instants"] = (len(made[0].time), "-")
        record.headline["largest displacement of the face"] = (size, "m")
        return made[0]

    def _seen(self, basis: Basis, forces: PatchForces) -> Motion:
        points = self.static.product.points
        stride = max(int(1 / (_PER_PERIOD * self.band * forces.step)), 1)
        kept = range(len(forces.time) - 1, -1, -stride)[:_INSTANTS][::-1]
        time, q = forces.time[kept], replayed(basis, forces, kept)
        field = (q @ basis.face(len(points)).T).reshape(len(time), -1, 3)
        return Motion(time=time, displacement=field.astype("f4"), points=points)
