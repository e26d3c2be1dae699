"""modes: the lowest modes at the static state, and the rotation matrices on them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tireroad.modal.damping import StrainEnergy
from tireroad.modal.symmetry import Sites
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.stages import cavity
from tireroad.runs.stages.session import Session

_NAMED = 8  # modes of a round tire shown by name


@dataclass(frozen=True)
class ModalBasis:
    """`frequency` (m,) Hz, `shape` kg^-1/2 of the outer face (3 s, m), of a free rim after it (+ 6),
    and the small matrices.
    """

    frequency: np.ndarray
    shape: np.ndarray
    projection: object


def inputs(session: Session) -> dict:
    """The static state and the modal table; rotation matrices only when the wheel turns."""
    return {
        "static": session.hashes["static"],
        "modal": asdict(session.scene.modal),
        "rotating": session.speed != 0,
        "cavity": cavity.inputs(session),
    }


def compute(session: Session, path: Path) -> None:
    """Solve, project and store. Collective."""
    from tireroad.modal.basis import project

    record, operators = session.record, session.operators
    with record.timing("eigensolver"):
        modes = solve(session)
    rotation = session.rotation_matrices if session.speed else None
    with record.timing("projection"):
        loss = operators.loss_stiffness()
        projection = project(modes, rotation, operators.carried, session.comm, loss=loss)
        if loss is not None:
            loss.destroy()
        shape = operators.trace(modes.vectors)
        labels = _labels(session, modes.vectors)
    session.modes = modes
    session.modal = ModalBasis(modes.frequency, shape, projection)
    cavity.join(session, modes)
    record.headline |= {
        "modes": (len(modes.squares), "-"),
        "lowest": (float(modes.frequency[0]), "Hz"),
        "highest": (float(modes.frequency[-1]), "Hz"),
    }
    record.headline["damping"] = (_damping(session, projection), "-")
    if modes.segments > 1:
        record.headline["equal segments, solved by wave number"] = (modes.segments, "-")
    else:
        symmetries = ", ".join(modes.symmetries) or "none used"
        record.headline["symmetries"] = (symmetries, "-")
    record.indicators |= {
        "worst residual": (float(modes.residual.max()), "-"),
        "orthonormality": (modes.orthonormality, "-"),
        "modes by inertia count": (modes.inertia_count, "-"),
        "counted below": (float(np.sqrt(modes.counted_below) / (2 * np.pi)), "Hz"),
        "slices": (modes.slices, "-"),
        "rigid modes": (modes.rigid, "-"),
    }
    if labels is not None:
        _say_names(modes.frequency, labels)
    session.write(path, "modes", lambda file: _fill(file, session, modes, labels))


def _damping(session: Session, projection) -> str:
    """Which damping acts, in words."""
    given = session.damping
    if not isinstance(given, StrainEnergy):
        unused = "" if projection.loss_factor is None else "; the loss factors do not act"
        return f"γ1 = {given.mass:g} 1/s, γ2 = {given.stiffness:g} s{unused}"
    low, high = projection.loss_factor.min(), projection.loss_factor.max()
    return f"modal strain energy, loss factors {low:.3g} to {high:.3g}"


def _say_names(frequency: np.ndarray, labels) -> None:
    """The lowest modes of a round tire by name, each of a pair once."""
    named = zip(labels.wave, labels.section, frequency, strict=True)
    first = {(n, k): f for n, k, f in reversed(list(named)) if n >= 0}
    lowest = sorted(first.items(), key=lambda item: item[1])[:_NAMED]
    shown = ", ".join(f"({n}, {k}) {f:.4g}" for (n, k), f in lowest)
    observe.say(f"  (wave number, section mode) in Hz: {shown}")


def solve(session: Session):
    """The modes the scene wants, on all unknowns. Collective."""
    from tireroad.modal import undamped

    operators, wanted = session.operators, session.scene.modal
    return undamped.solve(
        operators.stiffness,
        operators.mass,
        None if wanted.up_to else wanted.count,
        up_to=wanted.up_to or np.inf,
        sites=sites(operators),
    )


def sites(operators) -> Sites:
    """Where this process's unknowns are: there mirrors and repeated segments are looked for."""
    return Sites(operators.unknowns.place, operators.unknowns.component)


def _labels(session: Session, vectors: np.ndarray):
    """Wave and section numbers of the modes without a road; None with one. Collective."""
    from tireroad.modal.waves import label

    if session.static.road_height is not None:
        return None
    body = session.body
    circles = body.lattice.circles(body.ids)
    nodal = session.operators.spread(vectors).reshape(-1, vectors.shape[1])
    points = body.lattice.points(body.ids)
    return label(session.comm, points, circles, body.nodal_mass(), nodal)


def _fill(file, session: Session, modes, labels) -> None:
    basis = session.modal
    m = len(basis.frequency)
    put(file, "frequency", basis.frequency, "Hz")
    put(file, "residual", modes.residual, "-")
    if basis.projection.loss_factor is not None:
        put(file, "loss_factor", basis.projection.loss_factor, "-")
    put(file, "surface/points", session.static.points, "m")
    face = 3 * len(session.static.points)
    put(file, "surface/shape", basis.shape[:face].T.reshape(m, -1, 3), "kg^-1/2")
    if len(basis.shape) > face:
        put(file, "rim/translation", basis.shape[face : face + 3].T, "kg^-1/2")
        put(file, "rim/rotation", basis.shape[face + 3 :].T, "rad/(m kg^1/2)")
    if labels is not None:
        put(file, "wave_number", labels.wave, "-")
        put(file, "section_mode", labels.section, "-")
        put(file, "wave_share", labels.share, "-")
    for name, unit in _UNITS.items():
        if getattr(basis.projection, name) is not None:
            put(file, f"projected/{name}", getattr(basis.projection, name), unit)
    cavity.fill(file, basis.projection.air)
    file.attrs["inertia_count"] = modes.inertia_count
    file.attrs["rigid_modes"] = modes.rigid


_UNITS = {
    "squares": "1/s2",
    "gyroscopic": "1/rad",
    "convective": "1/rad2",
    "body": "1/rad",
    "body_convective": "1/rad2",
    "momentum": "kg^1/2",
    "loss_factor": "-",
}


def reuse(session: Session, path: Path) -> None:
    """Read the basis back. Collective."""
    from tireroad.modal.basis import Projection

    def pick(file):
        parts = [file["surface/shape"][:]]
        if "rim" in file:
            parts += [file["rim/translation"][:], file["rim/rotation"][:]]
        shape = np.hstack([part.reshape(len(part), -1) for part in parts]).T.copy()
        matrices = {name: values[:] for name, values in file["projected"].items()}
        projection = Projection(**matrices, air=cavity.read(file))
        return ModalBasis(file["frequency"][:], shape, projection)

    session.modal = session.read(path, pick)
