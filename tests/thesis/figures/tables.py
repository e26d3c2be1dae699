"""Tables B.1 to B.4: the thesis's parameters, and those of the scenes here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tireroad.runs.pipeline import Finished
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.runner import Scenes

Read = Callable[[Any], float]  # reads a value of a scene whose tables exist
# Entries of the tables: unit, where a scene has the value, and why it may differ.
KNOWN: dict[str, tuple[str, Read, str]] = {
    "elements": ("-", lambda scene: scene.tire.segments, ""),
    "E of the tire": ("Pa", lambda scene: scene.tire.material.law.youngs_modulus, ""),
    "ν of the tire": ("-", lambda scene: scene.tire.material.law.poisson_ratio, ""),
    "ρ": ("kg/m³", lambda scene: scene.tire.material.density, ""),
    "γ1": ("1/s", lambda scene: scene.damping.mass, ""),
    "γ2": ("s", lambda scene: scene.damping.stiffness, ""),
    "modes": ("-", lambda scene: scene.modes.count, ""),
    "Ω": ("rad/s", lambda scene: scene.rotation.speed if scene.rotation else 0.0, ""),
    "E of the half-space": ("Pa", lambda scene: scene.contact.law.youngs_modulus, ""),
    "ν of the half-space": ("-", lambda scene: scene.contact.law.poisson_ratio, ""),
    "K_b": ("N/m", lambda scene: scene.contact.brush_stiffness, ""),
    "Δt": ("s", lambda scene: scene.time.step, ""),
    "ξ": ("-", lambda scene: 0.0, "every step's contact problem is solved exactly: nothing has to be damped; (5.12) would read F − ξ (F − F_old)"),
}  # fmt: skip
MESH = "the elements here are quadratic; of the thesis's mesh only the number of nodes is printed, figure 2.2 is a picture"  # fmt: skip
CAPTION = "the caption of figure 6.5 says 500, and that is what the scene has"

RUBBER = {"ν of the tire": 0.45, "ρ": 1200.0, "γ2": 0.0}
TREAD = {
    "E of the half-space": 340e6,
    "ν of the half-space": 0.49,
    "ξ": 0.75,
    "Δt": 2.5e-5,
    "γ2": 0.0,
}


def _claims(run: Finished, table: str, printed: Mapping[str, float], because: Mapping[str, str]) -> list[Claim]:  # fmt: skip
    found = []
    for name, value in printed.items():
        unit, read, why = KNOWN[name]
        found.append(
            Claim(
                what=name,
                unit=unit,
                thesis=value,
                source=table,
                found=float(read(run.job.scene)),
                tolerance=1e-9,
                because=because.get(name, why),
            )
        )
    return found


def _nodes(run: Finished, table: str, value: float) -> Claim:
    found = len(run.static.displacement)
    return Claim(
        what="nodes", unit="-", thesis=value, source=table, found=float(found), because=MESH
    )


def _reproduced(claims: Sequence[Claim]) -> Reproduced:
    off = [claim.what for claim in claims if not claim.agrees]
    return Reproduced(
        shows=f"The scene's values; not the same: {', '.join(off)}." if off else "The same.",
        claims=tuple(claims),
    )


@figure("table-B.1", "Parameters of the full tire", "100 segments, E = 480 MPa, almost undamped.")
def full(scenes: Scenes) -> Reproduced:
    """For figures 4.2 to 4.5, whose captions give their own damping."""
    run = scenes.run("figure-4.2", "damping.mass=0.001", until="static")
    printed = {"elements": 100, "E of the tire": 480e6, "γ1": 0.001, **RUBBER}
    return _reproduced([_nodes(run, "table B.1", 7600), *_claims(run, "table B.1", printed, {})])


@figure(
    "table-B.2", "Parameters of the simplified tire", "Ten segments, E = 480 MPa, γ1 = 5000 1/s."
)
def simplified(scenes: Scenes) -> Reproduced:
    """For figures 6.2 and 6.3."""
    run = scenes.run("figure-6.2", until="static")
    printed = {"elements": 10, "E of the tire": 480e6, "γ1": 5000.0, **RUBBER}
    return _reproduced([_nodes(run, "table B.2", 760), *_claims(run, "table B.2", printed, {})])


@figure(
    "table-B.3",
    "Parameters of the validation of the contact",
    "1000 modes on a standing tire, γ1 = 5000 1/s.",
)
def validation(scenes: Scenes) -> Reproduced:
    """For figure 6.5."""
    run = scenes.run("figure-6.5", until="static")
    printed = {"Ω": 0.0, "modes": 1000, "γ1": 5000.0, "K_b": 199620.0, **TREAD}
    return _reproduced(_claims(run, "table B.3", printed, {"γ1": CAPTION}))


@figure(
    "table-B.4",
    "Parameters of the rolling tire in contact",
    "The full tire with E = 48 MPa, 500 modes, γ1 = 5000 1/s.",
)
def footprint(scenes: Scenes) -> Reproduced:
    """For figures 7.1 to 7.3."""
    run = scenes.run("figure-7.1", until="static")
    printed = {
        "elements": 100,
        "modes": 500,
        "γ1": 5000.0,
        "E of the tire": 48e6,
        **RUBBER,
        **TREAD,
    }
    return _reproduced([_nodes(run, "table B.4", 7600), *_claims(run, "table B.4", printed, {})])
