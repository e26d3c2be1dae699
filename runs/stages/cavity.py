"""The air in the tire: built on the static state, stored with the modes, reported in figures."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

import h5py
import numpy as np

from tireroad.fem.cavity import Duct
from tireroad.fem.model import SmallMotions
from tireroad.fem.tire.material import KELVIN
from tireroad.modal.basis import Air, ModalBasis
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import put
from tireroad.runs.scene.tables.scene import has_air
from tireroad.runs.stages.stage import Job, Record, Result, Shared

if TYPE_CHECKING:
    from tireroad.fem.cavity import Column


_SHOWN = 4
_MOSTLY = 0.3  # share of a state's energy above which it counts as an air resonance
_UNITS = {
    "circular": "rad/s",
    "pressure": "m^1/2/kg^1/2 s",
    "gyroscopic": "1/rad",
    "convective": "1/rad2",
    "momentum": "kg^1/2",
    "loss": "1/s",
}
_STATES = {
    "eigenvalue": "1/s",
    "right": "-",
    "left": "s",
    "block": "1/s",
    "block_right": "-",
    "block_left": "s",
    "residual": "-",
    "left_residual": "-",
}


def inputs(job: Job) -> dict | None:
    """Inputs of the air besides the static state; None without air."""
    return asdict(job.scene.tire.cavity) if has_air(job.scene) else None


def make_air(job: Job, motions: SmallMotions) -> Column | None:
    """The air inside the deformed wall, or None. Collective."""
    if not has_air(job.scene):
        return None
    from tireroad.fem.cavity import make_column

    cavity, static = job.scene.tire.cavity, motions.static
    return make_column(
        motions.body,
        motions.operators.unknowns,
        static.inflation,
        cavity.temperature or job.scene.temperature + KELVIN,
        job.speed,
        cavity.up_to,
        cavity.loss_factor,
    )


@dataclass(frozen=True, kw_only=True)
class AirColumn(Shared["Column | None"]):
    """The air at the wall, from the modes' computation, or rebuilt if they are reused."""

    name: ClassVar[str] = "air"
    modes: Result[ModalBasis]
    motions: Result[SmallMotions]

    def make(self) -> Column | None:
        """The air column. Collective."""
        basis = self.modes.product
        if basis.column is not None:
            return basis.column
        return make_air(self.job, self.motions.product)


def describe_air(record: Record, air: Air) -> None:
    """Record the modes of the air that join those of the tire."""
    record.headline |= {
        "air, rigid walls": (_listed(air.duct.frequency[:_SHOWN]), "Hz"),
        "volume of air": (1e3 * air.duct.volume, "l"),
    }
    record.indicators["modes of the air"] = (len(air.duct.circular), "-")


def _listed(values: np.ndarray) -> str:
    return " / ".join(f"{value:.4g}" for value in values)


def fill(file: h5py.File, air: Air | None) -> None:
    """Write the air into the file of the modes."""
    if air is None:
        return
    put(file, "cavity/frequency", air.duct.frequency, "Hz")
    for name, unit in _UNITS.items():
        put(file, f"cavity/{name}", getattr(air.duct, name), unit)
    put(file, "cavity/coupling", air.coupling, "1/s")
    file["cavity"].attrs["density"] = air.duct.density
    file["cavity"].attrs["volume"] = air.duct.volume


def read(file: h5py.File) -> Air | None:
    """The air from a file of modes; None if it has none."""
    if "cavity" not in file:
        return None
    group = file["cavity"]
    parts: dict[str, Any] = {name: group[name][:] for name in _UNITS}
    parts |= {f.name: float(group.attrs[f.name]) for f in fields(Duct) if f.name not in parts}
    return Air(Duct(**parts), group["coupling"][:])


def fill_states(file: h5py.File, rolling: RollingModes) -> None:
    """Write the states of a non-rotating tire with air, which no earlier stage has computed."""
    states = rolling.states
    for name, unit in _STATES.items():
        put(file, f"states/{name}", getattr(states, name), unit)
    put(file, "states/frequency", states.eigenvalue.imag / (2 * np.pi), "Hz")
    put(file, "states/air_share", share(rolling), "-")
    file["states"].attrs["basis_condition"] = states.condition
    file["states"].attrs["rigid_states"] = states.rigid


def share(rolling: RollingModes) -> np.ndarray:
    """Share (q,) of the air in each state's kinetic energy."""
    return rolling.basis.projection.air.share(rolling.states.right)


def describe(record: Record, rolling: RollingModes) -> None:
    """Record the lowest states with a large share of air: the cavity resonances."""
    frequency, part = rolling.states.eigenvalue.imag, share(rolling)
    above = np.flatnonzero(frequency > 0)
    lowest = above[np.argsort(frequency[above])]
    first = lowest[part[lowest] >= min(_MOSTLY, part[lowest].max())][:_SHOWN]
    record.headline |= {
        "states with most air": (_listed(frequency[first] / (2 * np.pi)), "Hz"),
        "share of air in these states": (_listed(part[first]), "-"),
    }
