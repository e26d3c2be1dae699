"""Stage greens: Green's functions between driven points, and between those of the patch."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import h5py
import numpy as np

from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel
from tireroad.greens.residuals import residual_of
from tireroad.greens.response import Response
from tireroad.greens.responses import LOST, Made, Wanted, band, judged, make_response, selected
from tireroad.modal.basis import ModalBasis
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import put
from tireroad.runs.scene.physics import turning_of
from tireroad.runs.scene.tables.scene import PointForceTable, has_air
from tireroad.runs.stages import cavity, corner, rotating
from tireroad.runs.stages.modes import fill_projection, read_projection
from tireroad.runs.stages.setup import Probes, components, points_of, probes
from tireroad.runs.stages.stage import MUMPS, UNKNOWN, Computed, Record, Result

_UNITS = {
    "eigenvalue": "1/s",
    "output": "kg^-1/2",
    "input": "s/kg^1/2",
    "block": "1/s",
    "block_output": "kg^-1/2",
    "block_input": "s/kg^1/2",
    "residual": "m/N",
    "momentum": "kg^1/2",
    "block_momentum": "kg^1/2",
}
# Of the rate of momentum, the last three rows of the slope, in s instead.
_KNOWN = {"left_out": "kg m/N", "moments": "-", "slope": "m s", "offset": "m"}
_ATTACHED = "attached"


def fill_response(file: h5py.File, name: str, response: Response, points: int) -> None:
    """Write a response as a group.

    For readers of the file, also the static flexibility of its first `points` outputs, which are
    displacements; readings of the wheel follow them.
    """
    for key, unit in _UNITS.items():
        put(file, f"{name}/{key}", getattr(response, key), unit)
    flexibility = (response.residual + response.static())[:points]
    put(file, f"{name}/static_flexibility", flexibility, "m/N")
    for key, unit in _KNOWN.items():
        if (value := getattr(response, key)) is not None:
            put(file, f"{name}/{key}", value, unit)
    file[name].attrs["rigid_states"] = response.rigid
    file[name].attrs["slow_states"] = response.relaxing
    file[name].attrs["pulse"] = response.pulse


def read_response(group: h5py.Group) -> Response:
    """The response in a group."""
    return Response(
        **{key: group[key][:] for key in _UNITS},
        pulse=int(group.attrs["pulse"]),
        rigid=int(group.attrs["rigid_states"]),
        relaxing=int(group.attrs["slow_states"]),
        **{key: group[key][:] for key in _KNOWN if key in group},
    )


def read_responses(file: h5py.File) -> dict[str, Response]:
    """All responses in a file, by name."""
    return {name: read_response(group) for name, group in file.items() if "output" in group}


@dataclass(frozen=True)
class Responses:
    """The responses of a scene, each None if the scene has none.

    `contact`: between the points of the patch, with the prescribed forces among its inputs;
    `force`: between the points of the prescribed forces. `attached`: the modes with their attachment
    modes, whose states these are, None without the latter; of their fields only what the probes read.
    """

    contact: Response | None = None
    force: Response | None = None
    attached: RollingModes | None = None

    def states(self, rolling: RollingModes) -> RollingModes:
        """The modes whose states the responses have: those `rolling`, or with the attachment modes that joined them."""
        return self.attached or rolling

    @property
    def named(self) -> dict[str, Response]:
        """The responses that exist, by name."""
        both = {"contact": self.contact, "force": self.force}
        return {name: made for name, made in both.items() if made is not None}


@dataclass(frozen=True, kw_only=True)
class GreensStage(Computed[Responses]):
    """The Green's functions with their residual flexibility, and the choice of dynamic states."""

    name: ClassVar[str] = "greens"
    reads: ClassVar[tuple[str, ...]] = ("greens",)
    static: Result[StaticState]
    wheel: Result[Wheel]
    fields: Result[ModalBasis]
    rotating: Result[RollingModes]
    setup: Result[ContactSetup | None]

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        scene = self.job.scene
        if not residual_of(scene.greens.residual).solves:
            return "none: states alone"
        from tireroad.fem.matrices.compliance import RESIDUAL_TOLERANCE

        return f"static shapes by {MUMPS}; residual at most {RESIDUAL_TOLERANCE:g}"

    def inputs(self) -> dict:
        """Also what is driven; the road enters only through the reach of the patch."""
        scene, setup = self.job.scene, self.setup.product
        return super().inputs() | {
            "axle": corner.inputs(self.job),
            "readings": corner.readings(self.job),
            "damping": repr(turning_of(self.job.scene, self.job.speed).damping),
            "forces": [_place(force) for force in scene.force],
            "points": setup.patch.index.tolist() if setup else [],
            "pitch": points_of(self.job, self.static.product) if setup else None,
            "components": components(self.job) if setup else (),
        }

    @property
    def _stands_with_air(self) -> bool:
        """Whether states are first reported here: at rest, those without air are the modes' own."""
        return self.job.speed == 0 and has_air(self.job.scene)

    @property
    def _contact_forces(self) -> int:
        """Number of force components on the nodes of the patch."""
        return len(components(self.job)) * len(self.setup.product.patch.index)

    @property
    def _wanted(self) -> Wanted:
        greens = self.job.scene.greens
        return Wanted(residual=greens.residual, dynamic=greens.dynamic, band=greens.band)

    def compute(self, record: Record) -> Responses:
        """The responses between all probes. Collective."""
        rolling, wanted = self.rotating.product, self._wanted
        if self._stands_with_air:
            cavity.describe(record, rolling)
        points = probes(self.job, self.static.product, self.setup.product)
        made = self._whole(record, rolling, points, wanted.residual)
        whole = made.response
        response = selected(whole, rolling, wanted, points.counted)
        seen, kept = (one.between(points.counted, points.counted) for one in (whole, response))
        record.indicators |= judged(points.name, seen, kept, rolling, wanted)
        if rolling.basis.projection.moves:
            loads, top = points.loads[points.counted], band(rolling, wanted)
            corner.check_blocked(record, rolling, loads, top)
        responses = self._apart(points.name, response)
        if made.attached is not None:
            responses = replace(responses, attached=as_read(made.attached, points))
        self._describe(record, responses)
        return responses

    def _whole(self, record: Record, rolling: RollingModes, points, residual: str) -> Made:
        """The response with all states. Collective."""
        if residual_of(residual).joins:
            with record.timing("modes once more"):
                _ = self.fields.product
        with record.timing("residual flexibility"):
            response = make_response(
                lambda: self.wheel.product,
                rolling,
                points.outputs,
                points.loads,
                residual,
                lambda: self.fields.product,
            )
        record.indicators |= response.figures
        record.warnings += response.warnings
        return response

    def _apart(self, name: str, whole: Response) -> Responses:
        """The contact's response, with prescribed forces as inputs (contact.loop), and theirs."""
        forces, more = len(self.job.scene.force), corner.readings(self.job)
        if name == "force" or not (forces or more):
            return Responses(contact=whole) if name == "contact" else Responses(force=whole)
        count = self._contact_forces
        inputs = count + forces
        contact = whole.between(slice(None), slice(inputs))
        if not forces:
            return Responses(contact=contact)
        held = 0 if self.job.axle else more
        readings = slice(inputs, inputs + 3 * forces + held)
        return Responses(contact=contact, force=whole.between(readings, slice(count, inputs)))

    def _describe(self, record: Record, responses: Responses) -> None:
        scene, setup = self.job.scene, self.setup.product
        record.headline["residual flexibility"] = (scene.greens.residual, "-")
        if setup:
            record.headline |= {
                "contact points": (len(setup.patch.points), "-"),
                "nodes that carry them": (len(setup.patch.index), "-"),
                "reach of the patch": (setup.reach, "m"),
                "rolling speed": (setup.rolled.speed, "m/s"),
            }
            _share_of_residual(record, "contact points", responses.contact)
            if LOST in record.indicators:
                drag = record.indicators[LOST][0] / setup.rolled.speed
                record.headline["rolling resistance"] = (100 * drag / self.static.product.load, "%")
                record.headline["error of the rolling resistance"] = (UNKNOWN, "-")
        if scene.force:
            record.headline["driven points"] = (len(scene.force), "-")
        for name, response in responses.named.items():
            states = len(response.eigenvalue) + len(response.block)
            record.headline[f"states, {name}"] = (states, "-")

    def write(self, file, product: Responses) -> None:
        """The responses by name, and the nodes of the patch."""
        for name, response in product.named.items():
            forces = len(self.job.scene.force)
            points = 3 * forces
            if name == "contact":
                points += self._contact_forces + forces
            fill_response(file, name, response, points)
        if self._stands_with_air:
            cavity.fill_states(file, self.rotating.product)
        if self.setup.product:
            put(file, "contact/index", self.setup.product.patch.index, "-")
        if product.attached is not None:
            group, basis = file.create_group(_ATTACHED), product.attached.basis
            put(group, "frequency", basis.frequency, "Hz")
            put(group, "reading", basis.shape, "kg^-1/2")
            fill_projection(group, basis.projection)
            rotating.fill(group.create_group("states"), product.attached)

    def read(self, file) -> Responses:
        """The responses."""
        found = read_responses(file)
        responses = Responses(contact=found.get("contact"), force=found.get("force"))
        if _ATTACHED not in file:
            return responses
        group = file[_ATTACHED]
        frequency, own = group["frequency"][:], len(group["projected/squares"])
        projection = read_projection(group, self.job.axle, own - len(frequency))
        shape = group["reading"][:]
        attached = RollingModes(
            basis=ModalBasis(frequency=frequency, shape=shape, projection=projection),
            states=rotating.read(group["states"]),
            turning=turning_of(self.job.scene, self.job.speed),
        )
        return replace(responses, attached=attached)


def as_read(rolling: RollingModes, points: Probes) -> RollingModes:
    """The modes with what the counted probes read of them in place of their fields, which on fine meshes take gigabytes."""
    wanted = points.loads[points.counted]
    shape = wanted[:, : len(rolling.basis.shape)] @ rolling.basis.shape[: wanted.shape[1]]
    return replace(rolling, basis=replace(rolling.basis, shape=shape))


def _share_of_residual(record, where: str, response: Response) -> None:
    """Record the largest share of the static flexibility that the modes lack (truncation error)."""
    diagonal = np.diag(response.residual)
    total = diagonal + np.diag(response.static())
    # A point of a coarse mesh may lie on the rim, where its flexibility is zero.
    part = np.divide(diagonal, total, out=np.zeros_like(total), where=total != 0)
    name = f"share of the residual in the static flexibility of the {where}"
    record.indicators[name] = (float(part.max()), "-")


def _place(force: PointForceTable) -> dict:
    """Where and in which direction a force acts; its course over time is no matter here."""
    return {k: v for k, v in asdict(force).items() if k not in ("amplitude", "frequency")}
