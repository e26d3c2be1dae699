"""modes.h5: frequencies, traces on the outer face, small matrices; no fields on all unknowns."""

from __future__ import annotations

import numpy as np

from tireroad.fem.axle import Axle
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.runs.files.store import put
from tireroad.runs.stages.build import cavity, corner

_UNITS = {
    "squares": "1/s2",
    "gyroscopic": "1/rad",
    "convective": "1/rad2",
    "body": "1/rad",
    "body_convective": "1/rad2",
    "momentum": "kg^1/2",
    "loss_factor": "-",
}


def fill(file, basis: ModalBasis, points: np.ndarray) -> None:
    """Write a basis; `points` (s, 3) m: the undeformed nodes of the outer face."""
    m, modes, labels = len(basis.frequency), basis.modes, basis.labels
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
    if labels is not None:
        put(file, "wave_number", labels.wave, "-")
        put(file, "section_mode", labels.section, "-")
        put(file, "wave_share", labels.share, "-")
    for name, unit in _UNITS.items():
        if getattr(basis.projection, name) is not None:
            put(file, f"projected/{name}", getattr(basis.projection, name), unit)
    cavity.fill(file, basis.projection.air)
    corner.fill(file, basis.projection.corner)
    file.attrs["inertia_count"] = modes.inertia_count
    file.attrs["rigid_modes"] = modes.rigid


def read(file, axle: Axle | None) -> ModalBasis:
    """The basis of a wheel on an `axle`, without its fields on all unknowns."""
    parts = [file["surface/shape"][:]]
    if "turning/shape" in file:
        parts = [np.concatenate([parts[0], file["turning/shape"][:]])]
    if "rim" in file:
        parts += [file["rim/translation"][:], file["rim/rotation"][:]]
    shape = np.hstack([part.reshape(len(part), -1) for part in parts]).T.copy()
    matrices = {name: values[:] for name, values in file["projected"].items()}
    return ModalBasis(
        frequency=file["frequency"][:],
        shape=shape,
        projection=Projection(
            **matrices,
            shapes=len(shape.T) - len(file["frequency"]),
            air=cavity.read(file),
            corner=corner.read(file, axle),
        ),
    )
