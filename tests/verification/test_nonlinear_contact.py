"""The nonlinear tire on a road that rises by millimetres and stays: the static solver's state."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.loop import Drive, roll
from tireroad.contact.patch import Patch
from tireroad.contact.rolling import make_loop
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.fem import transient
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.probe import nodes
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.transient import FullTire, NonlinearTire
from tireroad.runs.pipeline import run_scene
from tireroad.runs.scene.load import load
from tireroad.runs.stages.setup import probes
from tireroad.runs.validation.full_elements import Elements
from tireroad.tests.validation.cases import thesis_torus
from tireroad.tests.validation.large_rolling import Case

INFLATION, STEP = 2e5, 2e-4
DAMPING = (400.0, 0.0)
RISE, FAR = 4e-3, 15e-3  # m


def pressed(deflection: float):
    """A loader at a deflection of a standing tire of few elements."""
    section = thesis_torus(segments=16, elements_arc=6, footprint_size=0.3)
    body = Body(
        MPI.COMM_SELF,
        section,
        compound("neo-hookean", 1200.0, youngs_modulus=4.8e7, poisson_ratio=0.45),
    )
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(INFLATION)
    loader.deflect(deflection)
    return loader


def patch_of(state, reach=0.012) -> Patch:
    """Every node of the outer face within the reach (m) of the road."""
    near = np.flatnonzero(state.gap < reach)
    none = np.zeros(len(near), dtype=int)
    return Patch(
        index=near,
        points=state.positions[near],
        half_sizes=state.half_sizes[near],
        force=state.force[near],
        gap=state.gap[near],
        edge=none.astype(bool),
        line=none,
    )


def risen(full, patch, rise=RISE, step=STEP, steps=500) -> float:
    """Load (N) long after the road has risen within 50 steps."""
    whole = 50 * step
    drive = Drive(lambda x, y: np.zeros(x.shape), lambda t: rise * min(t / whole, 1.0), 0.0)
    solver = ActiveSet(full.same_step)
    *_, last = roll(full, solver, patch, drive, step, steps)
    return float(last.force.sum())


def shaken(full, patch) -> np.ndarray:
    """Forces (n, 3 c) N of small shakes by a road with stick and slip."""
    count = len(patch.points)
    drive = Drive(lambda x, y: np.zeros(x.shape), lambda t: 1e-5 * np.sin(2 * np.pi * 100 * t), 0.0)
    solver = ActiveSet(full.same_step[:count, :count])
    brush = Brush(BrushLaw(1e5, 0.5, kind="spring"), patch.points[:, 0], patch.line, 0.0, STEP)
    friction = BrushFriction(brush, full.same_step, None)
    steps = roll(full, solver, patch, drive, STEP, 50, friction)
    return np.array([instant.change for instant in steps])


@pytest.mark.slow
def test_small_shakes_with_friction_are_those_of_the_linear_tire():
    loader = pressed(0.003)
    state = static_state(loader.equilibrium, loader.touch)
    patch = patch_of(state)
    operators = Operators(loader.body, INFLATION)
    points = sparse.vstack([nodes(patch.index, len(state.points), k) for k in (2, 0, 1)]).tocsr()
    full = NonlinearTire(
        operators=operators,
        inflation=INFLATION,
        damping=DAMPING,
        step=STEP,
        outputs=points,
        loads=points,
    )
    straight = shaken(
        FullTire(
            operators=operators,
            rotation=None,
            speed=0.0,
            damping=DAMPING,
            step=STEP,
            outputs=points,
            loads=points,
        ),
        patch,
    )
    bent = shaken(full, patch)
    count = len(patch.points)
    assert abs(straight[:, count:]).max() > 1e-3 * abs(straight).max()
    assert full.turns > 50
    assert np.linalg.norm(bent - straight) < 5e-3 * np.linalg.norm(straight)
    assert np.linalg.norm((bent - straight)[:, count:]) < 2e-2 * np.linalg.norm(straight[:, count:])


@pytest.mark.long
def test_a_road_that_has_risen_carries_the_static_load():
    loader = pressed(0.002)
    state = static_state(loader.equilibrium, loader.touch)
    patch = patch_of(state)
    operators = Operators(loader.body, INFLATION)
    points = nodes(patch.index, len(state.points))
    full = NonlinearTire(
        operators=operators,
        inflation=INFLATION,
        damping=DAMPING,
        step=STEP,
        outputs=points,
        loads=points,
    )
    straight = FullTire(
        operators=operators,
        rotation=None,
        speed=0.0,
        damping=DAMPING,
        step=STEP,
        outputs=points,
        loads=points,
    )
    further = pressed(0.002 + RISE)
    assert risen(full, patch) == pytest.approx(further.load(), rel=1e-4)
    assert abs(risen(straight, patch) / further.load() - 1) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("patience", [2, transient.PATIENT])
def test_a_rise_of_centimetres_in_long_steps_ends_at_the_static_load(monkeypatch, patience):
    """Without inertia that would help: with new factors of the present motion, and by secants of the static state's."""
    monkeypatch.setattr(transient, "PATIENT", patience)
    loader = pressed(0.002)
    state = static_state(loader.equilibrium, loader.touch)
    patch = patch_of(state, 0.03)
    points, step = nodes(patch.index, len(state.points)), 1e-3
    full = NonlinearTire(
        operators=Operators(loader.body, INFLATION),
        inflation=INFLATION,
        damping=(400.0, 0.0),
        step=step,
        outputs=points,
        loads=points,
    )
    found = risen(full, patch, FAR, step, 150)
    assert full.factors > 1 or patience > 2
    assert found == pytest.approx(pressed(0.002 + FAR).load(), rel=1e-4)


@pytest.mark.long
def test_rolling_it_tends_to_the_linear_tire(tmp_path):
    """Waves of 0.05 and 0.5 mm at 100 rad/s: what is off grows with them, from nearly none."""
    from tireroad.tests.validation.comparison import Tires
    from tireroad.tests.validation.excursion import _SINE, beside, scene_of

    mesh, found = {"segments": 16, "elements_arc": 6}, []
    tires = Tires(scene_of(_SINE.format(height=5e-5), mesh, 0.01), tmp_path)
    for height in (5e-5, 5e-4):
        tires.change(scene_of(_SINE.format(height=height), mesh, 0.01))
        found.append(beside(tires))
    assert found[0][0] < 0.2
    assert found[1][0] / found[0][0] == pytest.approx(10.0, rel=0.3)
    # Along the road the slope takes part: what is off grows as the square.
    assert found[1][1] / found[0][1] == pytest.approx(100.0, rel=0.5)
    assert found[1][6] < 10


@pytest.mark.long
def test_belts_on_a_bar_are_found_as_by_newtons_method(tmp_path, monkeypatch):
    """Of a passenger tire whose cords slacken: secants of one factor led its 46th step away from balance."""
    file = tmp_path / "scene.toml"
    file.write_text(Case(0.015, 0.050, 0.015).scene())
    given: dict[str, Any] = {"until": "greens", "fresh": False, "petsc_options": []}
    run = run_scene(load(file), tmp_path, MPI.COMM_SELF, **given)
    contact = run.job.scene.contact
    setup, _ = run.setup.equilibrated(run.greens.contact, run.static.normal_force, contact)
    seen = probes(run.job, run.static, run.setup)
    tire, step, _ = Elements(run, run.job, seen).nonlinear(STEP)
    loop = make_loop(contact, setup, tire, step)

    def rolled(first, last):
        steps = loop.roll(setup.drive, step, last, done=first, at_once=1)
        return np.concatenate([block.force for block in steps])

    rolled(0, 44)
    kept = loop.snapshot()
    found = rolled(44, 47)
    loop.restore(kept)
    monkeypatch.setattr(transient, "PATIENT", 1)
    assert abs(rolled(44, 47) - found).max() < 1e-4 * found.max()
