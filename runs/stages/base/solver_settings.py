"""Settings of the solvers of each stage, for log.txt: method, tolerances, factorisation."""

from __future__ import annotations

from collections.abc import Callable

from tireroad.runs.scene.tables.scene import Scene

_MUMPS = "MUMPS through PETSc, ICNTL(14) = 100 %"


def solver_settings(stage: str, scene: Scene) -> str:
    """One line about the solvers that a stage of the scene uses; "" if it has none.

    Options given after `--` are logged where they are taken and change those of their prefix.
    """
    told = _TOLD.get(stage)
    return f"{stage:9s} solver: {told(scene)}" if told else ""


def _static(scene: Scene) -> str:
    from tireroad.fem.static.equilibrium import MOST_STEPS, TOLERANCE
    from tireroad.fem.static.load_steps import LOAD_TOLERANCE

    return (
        f"Newton's method, residual at most {TOLERANCE:g} of the force scale, at most {MOST_STEPS} "
        f"tangents a load step; load to {LOAD_TOLERANCE:g}; tangents factorised by {_MUMPS}, options -static_…"
    )


def _modes(scene: Scene) -> str:
    from tireroad.modal.rotation_shapes import TOLERANCE as shapes
    from tireroad.modal.solver.slicing import BLOCK, TOLERANCE
    from tireroad.modal.solver.undamped import ORTHONORMALITY_TOLERANCE, RESIDUAL_TOLERANCE

    return (
        f"block Lanczos, {BLOCK} vectors a block, on (A - sigma I)^-1 of each slice to {TOLERANCE:g}; counted by "
        f"the inertia of L D L^T, {_MUMPS}; residual at most {RESIDUAL_TOLERANCE:g}, orthonormal to "
        f"{ORTHONORMALITY_TOLERANCE:g}; rotation shapes of {shapes:g} and more"
    )


def _rotating(scene: Scene) -> str:
    if scene.rotation is None or scene.rotation.method == "projected":
        from tireroad.modal.rotating import LIMITS

        return f"LAPACK on the modal basis; residual at most {LIMITS[0]:g}, identities to {LIMITS[1]:g}"
    from tireroad.modal.solver.quadratic import ITERATIONS, RESIDUAL_TOLERANCE, TOLERANCE

    return (
        f"SLEPc PEP nearest to 0 by shift-and-invert to {TOLERANCE:g}, at most {ITERATIONS} restarts, {_MUMPS}, "
        f"options -rotating_…; residual at most {RESIDUAL_TOLERANCE:g}"
    )


def _greens(scene: Scene) -> str:
    if scene.greens.residual == "none":
        return "none: states alone"
    from tireroad.fem.matrices.direct import RESIDUAL_TOLERANCE

    return f"static shapes by {_MUMPS}; residual at most {RESIDUAL_TOLERANCE:g}"


def _contact(scene: Scene) -> str:
    from tireroad.contact.solver.conditions import TOLERANCE

    assert scene.contact is not None, "the stage runs with [contact] only"
    parts = [f"{scene.contact.solver}, complementarity to {TOLERANCE:g} of the scale"]
    if scene.contact.solver == "snes-vi":
        from tireroad.contact.solver.snes_vi import MAX_ITERATIONS

        parts.append(f"PETSc SNES vinewtonrsls, at most {MAX_ITERATIONS} iterations")
    if scene.contact.rubs:
        from tireroad.contact.solver.stick_slip import TOLERANCE as change
        from tireroad.contact.solver.stick_slip import TURNS

        parts.append(f"friction to {change:g} of the largest force in at most {TURNS} iterations")
    return "; ".join([*parts, f"scheme {scene.time.scheme}"])


_TOLD: dict[str, Callable[[Scene], str]] = {
    "static": _static,
    "modes": _modes,
    "rotating": _rotating,
    "greens": _greens,
    "contact": _contact,
}
