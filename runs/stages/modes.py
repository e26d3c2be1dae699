"""Stage modes: the lowest modes about the static state, and rotation matrices projected on them.

Their fields on all unknowns are kept in the shared cache beside modes.h5, so that a family with
attachment modes or large motions solves them once. They are not in the result folder: 38 MB for 157 modes of 30,240
unknowns. Those above LARGEST are solved again by each member.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from tireroad.fem.cavity import Column
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.model import SmallMotions
from tireroad.fem.static.state import StaticState
from tireroad.fem.wheel import Axle
from tireroad.greens.residuals import residual_of
from tireroad.modal.basis import ModalBasis, Projection, same_fields
from tireroad.modal.damping import Damping, StrainEnergy, ratios
from tireroad.modal.rotation_shapes import up_to
from tireroad.modal.solver.slicing import Modes, how_many
from tireroad.modal.standing import named, projected, solved, with_fields
from tireroad.modal.waves import ModeNames
from tireroad.runs.files.store import put
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.surroundings import available_memory
from tireroad.runs.scene.estimate import estimate
from tireroad.runs.scene.physics import damping_of, shapes_of
from tireroad.runs.stages import cavity, corner
from tireroad.runs.stages.checkpoint import checkpointed, forget_checkpoint
from tireroad.runs.stages.matrices import memoize
from tireroad.runs.stages.stage import MUMPS, Computed, Job, Record, Result, Shared

_UNITS = {
    "squares": "1/s2",
    "gyroscopic": "1/rad",
    "convective": "1/rad2",
    "body": "1/rad",
    "body_convective": "1/rad2",
    "momentum": "kg^1/2",
    "losses": "1/s",
    "rise": "1/s2",
    "band_rise": "1/s2",
    "parts": "1/s2",
}
NAME = "fields"
LARGEST = 300e6  # bytes: each process holds all of them while they are written or read
_KEPT = ("orthonormality", "inertia_count", "counted_below", "rigid", "slices", "segments")
_NAMED = 10  # modes shown by name


def fill(file, basis: ModalBasis, points: np.ndarray, damping: np.ndarray) -> None:
    """Write a basis; `points` (s, 3) m: the undeformed nodes of the outer face; `damping` ratios (m,)."""
    m, modes, names = len(basis.frequency), basis.modes, basis.names
    put(file, "frequency", basis.frequency, "Hz")
    put(file, "residual", modes.residual, "-")
    if basis.projection.loss_factor is not None:
        put(file, "loss_factor", basis.projection.loss_factor[:m], "-")
    put(file, "surface/points", points, "m")
    face = 3 * len(points)
    shapes = basis.shape[:face].T.reshape(m + basis.projection.shapes, -1, 3)
    put(file, "surface/shape", shapes[:m], "kg^-1/2")
    if len(shapes) > m:
        put(file, "turning/shape", shapes[m:], "kg^-1/2")
    if len(basis.shape) > face:
        put(file, "rim/translation", basis.shape[face : face + 3].T, "kg^-1/2")
        put(file, "rim/rotation", basis.shape[face + 3 :].T, "rad/(m kg^1/2)")
    fill_names(file, names)
    put(file, "damping", damping, "-")
    put(file, "effective_mass", basis.projection.effective_mass.T, "kg, kg m2")
    fill_projection(file, basis.projection)
    file.attrs["inertia_count"] = modes.inertia_count
    file.attrs["rigid_modes"] = modes.rigid


def fill_names(file, names: ModeNames) -> None:
    """Write the names of modes or states, and the waves that they are named by."""
    put(file, "name", names.name, "-")
    put(file, "motion", names.motion, "-")
    put(file, "wave_number", names.wave, "-")
    put(file, "wave_share", names.share, "-")
    put(file, "nodal_lines", names.order, "-")


def fill_projection(file, projection: Projection) -> None:
    """Write the projected matrices, with those of the air and of the rim's motions."""
    for name, unit in _UNITS.items():
        if getattr(projection, name) is not None:
            put(file, f"projected/{name}", getattr(projection, name), unit)
    cavity.fill(file, projection.air)
    corner.fill(file, projection.corner)


def read_projection(file, axle: Axle | None, shapes: int) -> Projection:
    """The projection on the coordinates, the last of which are `shapes`."""
    matrices = {name: values[:] for name, values in file["projected"].items()}
    air, rim = cavity.read(file), corner.read(file, axle)
    return Projection(**matrices, shapes=shapes, air=air, corner=rim)


def read(file, axle: Axle | None) -> ModalBasis:
    """The basis of a wheel on an `axle`, without its fields on all unknowns."""
    parts = [file["surface/shape"][:]]
    if "turning/shape" in file:
        parts = [np.concatenate([parts[0], file["turning/shape"][:]])]
    if "rim" in file:
        parts += [file["rim/translation"][:], file["rim/rotation"][:]]
    shape = np.hstack([part.reshape(len(part), -1) for part in parts]).T.copy()
    frequency = file["frequency"][:]
    projection = read_projection(file, axle, len(shape.T) - len(frequency))
    return ModalBasis(frequency=frequency, shape=shape, projection=projection)


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
    modes = job.read(path, _read)

    def remove() -> None:
        with suppress(OSError):
            path.unlink()

    on_root(job.comm, remove)
    whole = modes.pop("field")
    vectors = operators.restrict(np.ascontiguousarray(whole[operators.body.ids]))
    return (
        Modes(vectors=vectors, **modes)
        if same_fields(operators.trace(vectors), basis.shape)
        else None
    )


def _read(file: Any) -> dict[str, Any]:
    attrs = file.attrs
    values = {name: attrs[name].item() for name in _KEPT}
    values |= {"squares": file["square"][:], "residual": file["residual"][:]}
    values |= {"sectors": tuple(int(n) for n in attrs["sectors"])}
    return values | {"symmetries": tuple(map(str, attrs["symmetries"])), "field": file["field"][:]}


def _size(operators: Operators, count: int) -> float:
    return 24.0 * operators.body.lattice.size * count


@dataclass(frozen=True, kw_only=True)
class Motions(Shared[SmallMotions]):
    """The finite-element matrices about the static state, shared by all stages that need them."""

    name: ClassVar[str] = "motions"
    static: Result[StaticState]

    def make(self) -> SmallMotions:
        """No matrices yet: each is assembled when first used."""
        tire, static, modal = self.job.tire, self.static.product, self.job.scene.modes
        rim, road = modal.rim, modal.road
        key = self.static.key, rim, road
        return memoize("matrices", key, lambda: SmallMotions(tire, static, rim=rim, road=road))


@dataclass(frozen=True, kw_only=True)
class ModesStage(Computed[ModalBasis]):
    """The modes of the non-rotating tire."""

    name: ClassVar[str] = "modes"
    reads: ClassVar[tuple[str, ...]] = ("modes",)
    static: Result[StaticState]
    motions: Result[SmallMotions]

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        scene = self.job.scene
        from tireroad.modal.solver.searches import SEARCHES, resolved
        from tireroad.modal.solver.slicing import TOLERANCE
        from tireroad.modal.solver.undamped import ORTHONORMALITY_TOLERANCE, RESIDUAL_TOLERANCE

        how = SEARCHES[resolved(scene.modes.solver)]
        rotation = scene.rotation
        shapes = f"; rotation shapes of {rotation.shape_tolerance:g} and more" if rotation else ""
        return (
            f"{how} to {TOLERANCE:g}; counted by "
            f"the inertia of L D L^T, {MUMPS}; residual at most {RESIDUAL_TOLERANCE:g}, orthonormal to "
            f"{ORTHONORMALITY_TOLERANCE:g}{shapes}"
        )

    def inputs(self) -> dict:
        """Also viscous damping; whether the wheel turns, and the rotation shapes that join."""
        damping = damping_of(self.job.scene)
        return super().inputs() | {
            "rotating": self.job.speed != 0,
            "shapes": self._shapes,
            "cavity": cavity.inputs(self.job),
            "damping": None if isinstance(damping, StrainEnergy) else damping,
        }

    @property
    def _shapes(self) -> tuple[float, str, float] | None:
        """The speed (rad/s) up to which rotation shapes join the modes, their inertia and tolerance."""
        turning = shapes_of(self.job.scene, self.job.speed)
        return (up_to(turning.speed), turning.inertia, turning.shape_tolerance) if turning else None

    def compute(self, record: Record) -> ModalBasis:
        """Solve and project. Collective."""
        motions, table = self.motions.product, self.job.scene.modes
        with record.timing("matrices"):
            operators = motions.operators
        with (
            record.timing("eigensolver"),
            checkpointed(self, "count(s) and slice(s)") as journal,
        ):
            teams = self._teams(record)
            modes = solved(operators, **table.asked, teams=teams, journal=journal)
        with record.timing("air"):
            air = cavity.make_air(self.job, motions)
        with record.timing("projection and rotation shapes"):
            arguments = air, self.job.axle, shapes_of(self.job.scene, self.job.speed)
            basis = projected(motions, modes, self.job.speed != 0, *arguments)
            basis = named(basis, motions.lattice)
        _describe(record, modes, basis)
        if self._shapes:
            record.headline["rotation shapes"] = (basis.projection.shapes, "-")
        record.headline["damping"] = (_damping(damping_of(self.job.scene), basis.projection), "-")
        if air is not None:
            cavity.describe_air(record, basis.projection.air)
        _say_names(basis)
        return basis

    def end(self, key: str, product: ModalBasis) -> None:
        """Cache the fields for other members of a family. Collective."""
        scene = self.job.scene
        seen_whole = residual_of(scene.greens.residual).joins or scene.motion.kind != "linear"
        if seen_whole and product.modes is not None:
            keep(self.job, key, self.motions.product.operators, product.modes)
        forget_checkpoint(self.job, self.name)

    def _teams(self, record: Record) -> int:
        """Number of process teams: as many as free memory holds factors. Collective."""
        comm = self.job.comm
        if comm.size == 1:
            return 1
        parts = estimate(self.job.scene).memory
        needed = sum(parts[name] for name in ("matrices", "factor of the stiffness"))
        teams = how_many(comm, needed, available_memory())
        record.headline["teams of processes"] = (teams, "-")
        if teams < comm.size:
            console.say(
                f"  {teams} team(s) of processes, one factor each: a factor with its matrices takes about "
                f"{needed / 1e9:.2g} GB, and {comm.size} of them do not fit"
            )
        return teams

    def write(self, file, product: ModalBasis) -> None:
        """Frequencies, traces and the small matrices; not the fields on all unknowns."""
        damping = ratios(damping_of(self.job.scene), product.projection)
        fill(file, product, self.static.product.points, damping)

    def read(self, file) -> ModalBasis:
        """The basis without its fields on all unknowns."""
        return read(file, self.job.axle)


@dataclass(frozen=True, kw_only=True)
class Fields(Shared[ModalBasis]):
    """The modes with fields on all unknowns: of this run, of the shared cache, or solved again."""

    name: ClassVar[str] = "fields"
    modes: Result[ModalBasis]
    motions: Result[SmallMotions]
    air: Result[Column | None]

    def make(self) -> ModalBasis:
        """The basis with fields. Collective."""
        modes, basis = self.job.scene.modes, self.modes.product
        if basis.modes is not None:
            return basis
        motions, air = self.motions.product, self.air.product
        arguments = self.job, self.modes.key, motions.operators
        if (known := kept(*arguments, basis)) is not None:
            return replace(basis, modes=known, column=air)
        again = with_fields(
            basis,
            motions,
            **modes.asked,
            air=air,
            axle=self.job.axle,
            turning=shapes_of(self.job.scene, self.job.speed),
        )
        assert again.modes is not None, "they were solved just now"
        keep(*arguments, again.modes)
        return again


def _describe(record: Record, modes: Modes, basis: ModalBasis) -> None:
    record.headline |= {
        "modes": (modes.count, "-"),
        "lowest mode": (float(basis.frequency[0]), "Hz"),
        "highest mode": (float(basis.frequency[-1]), "Hz"),
    }
    if modes.segments > 1:
        record.headline["equal segments, solved by wave number"] = (modes.segments, "-")
    else:
        symmetries = ", ".join(modes.symmetries) or "none used"
        record.headline["symmetries"] = (symmetries, "-")
    record.indicators |= {
        "worst residual": (float(modes.residual.max()), "-"),
        "orthonormality": (modes.orthonormality, "-"),
        "modes by inertia count": (modes.inertia_count, "-"),
        "modes are counted below": (float(np.sqrt(modes.counted_below) / (2 * np.pi)), "Hz"),
        "slices": (modes.slices, "-"),
        "rigid modes": (modes.rigid, "-"),
    }


def _damping(damping: Damping, projection: Projection) -> str:
    """The damping in use, in words."""
    if not isinstance(damping, StrainEnergy):
        unused = "" if projection.loss_factor is None else "; the loss factors are not used"
        mass, stiffness = damping
        return f"γ1 = {mass:g} 1/s, γ2 = {stiffness:g} s{unused}"
    low, high = projection.loss_factor.min(), projection.loss_factor.max()
    return f"modal strain energy, loss factors {low:.3g} to {high:.3g}"


def _say_names(basis: ModalBasis) -> None:
    """Show the lowest modes by name."""
    assert basis.names is not None
    lowest = zip(basis.names.name[:_NAMED], basis.frequency, strict=False)
    console.say("  " + ", ".join(f"{name} {value:.4g} Hz" for name, value in lowest))
