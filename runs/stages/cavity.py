"""The air in the tire of a run: made at the static state, stored beside the modes, told in figures."""

from __future__ import annotations

from dataclasses import asdict, fields, replace

import h5py
import numpy as np

from tireroad.fem.cavity.duct import Duct
from tireroad.modal.air import Air
from tireroad.modal.rotating import StateModes
from tireroad.runs.files.store import put
from tireroad.runs.scene.cavity_table import has_air
from tireroad.runs.stages.session import Session

LIMIT = 1000.0  # Hz: beyond it the section is half a wavelength wide, and the duct no line
_SHOWN = 4
_MOSTLY = 0.3  # of a state's energy: then it is one of the air's
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


def inputs(session: Session) -> dict | None:
    """What the air depends on besides the static state; None without it."""
    return asdict(session.scene.tire.cavity) if has_air(session.scene) else None


def make(session: Session):
    """The air at the wall of the static state (fem.cavity.column), or None. Collective."""
    if not has_air(session.scene):
        return None
    from tireroad.fem.cavity.column import make_column

    wanted, operators = session.scene.tire.cavity, session.operators
    up_to = wanted.up_to or min(float(session.modal.frequency[-1]), LIMIT)
    with session.record.timing("air"):
        return make_column(
            session.body,
            operators.unknowns,
            session.scene.static.inflation,
            wanted.temperature,
            session.speed,
            up_to,
            wanted.loss_factor,
        )


def join(session: Session, modes) -> None:
    """Let the air join `session.modal`, the modes (all rows) of the tire, where there is any. Collective."""
    if not has_air(session.scene):
        return
    projection = session.wheel.with_air(session.modal.projection, modes)
    session.modal = replace(session.modal, projection=projection)
    duct = projection.air.duct
    session.record.headline |= {
        "air, rigid walls": (_listed(duct.frequency[:_SHOWN]), "Hz"),
        "volume of air": (1e3 * duct.volume, "l"),
    }
    session.record.indicators["modes of the air"] = (len(duct.circular), "-")


def _listed(values: np.ndarray) -> str:
    return " / ".join(f"{value:.4g}" for value in values)


def fill(file: h5py.File, air: Air | None) -> None:
    """Write the air beside the modes."""
    if air is None:
        return
    put(file, "cavity/frequency", air.duct.frequency, "Hz")
    for name, unit in _UNITS.items():
        put(file, f"cavity/{name}", getattr(air.duct, name), unit)
    put(file, "cavity/coupling", air.coupling, "1/s")
    file["cavity"].attrs["density"] = air.duct.density
    file["cavity"].attrs["volume"] = air.duct.volume


def read(file: h5py.File) -> Air | None:
    """The air of a file of modes, None where it has none."""
    if "cavity" not in file:
        return None
    group = file["cavity"]
    arrays = {name: group[name][:] for name in _UNITS}
    scalars = {f.name: float(group.attrs[f.name]) for f in fields(Duct) if f.name not in arrays}
    return Air(Duct(**arrays, **scalars), group["coupling"][:])


def fill_states(file: h5py.File, session: Session) -> None:
    """Write the states of a tire with air that stands, which no stage before had to find."""
    modes = session.state_modes
    for name, unit in _STATES.items():
        put(file, f"states/{name}", getattr(modes, name), unit)
    put(file, "states/frequency", modes.eigenvalue.imag / (2 * np.pi), "Hz")
    put(file, "states/air_share", share(session), "-")
    file["states"].attrs["basis_condition"] = modes.condition
    file["states"].attrs["rigid_states"] = modes.rigid


def read_states(file: h5py.File) -> StateModes:
    """The states `fill_states` wrote."""
    group = file["states"]
    return StateModes(
        condition=float(group.attrs["basis_condition"]),
        rigid=int(group.attrs["rigid_states"]),
        **{name: group[name][:] for name in _STATES},
    )


def share(session: Session) -> np.ndarray:
    """Part (q,) of each state's kinetic energy that is the air's."""
    return session.modal.projection.air.share(session.state_modes.right)


def describe(session: Session) -> None:
    """Tell the states that are the air's more than any others: the cavity's resonances."""
    modes, part = session.state_modes, share(session)
    first = np.argsort(-part * (modes.eigenvalue.imag > 0))[:_SHOWN]
    first = first[part[first] >= min(_MOSTLY, part[first[0]])]
    first = first[np.argsort(modes.eigenvalue.imag[first])]
    session.record.headline |= {
        "states mostly of air": (_listed(modes.eigenvalue.imag[first] / (2 * np.pi)), "Hz"),
        "their share of air": (_listed(part[first]), "-"),
    }
