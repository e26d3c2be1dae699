"""The inner face's traces against closed forms, finite differences, and Gauss's theorem."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem import cavity
from tireroad.fem.cavity import CavityTrace, _bead_ends, inflated, rim_cone
from tireroad.fem.matrices.operators import Operators, Support, rigid_motions

R, B, HALF = 0.22, 0.088, np.radians(120)  # centre circle and inner radius of the torus of conftest
AIR = inflated(2e5, 293.15)


def segment():
    """Section, first moment over the axle's distance, and second, of a circle cut at the beads."""
    area = B**2 * (HALF - np.sin(HALF) * np.cos(HALF))
    above = 2 / 3 * (B * np.sin(HALF)) ** 3  # about the circle's centre, upwards
    return area, R * area + above


def test_round_cavity_has_the_area_and_volume_of_its_closed_form(make_body):
    area, moment = segment()
    found = CavityTrace(make_body(segments=24, arc=12), 6).profile()
    assert found.area[0] / (2 * np.pi) == pytest.approx(area, rel=1e-4)
    assert found.volume[0] / (2 * np.pi) == pytest.approx(moment, rel=1e-4)
    assert np.abs(found.area[1:]).max() < 1e-6 * found.area[0]


def test_ends_of_the_inner_face_do_not_depend_on_the_order_of_its_edges(make_body):
    """A deck lists its elements as it likes."""
    body = make_body(segments=16, arc=6)
    ends = _bead_ends(body)
    inner = body.lattice.tire.section.inner
    turned = np.random.default_rng(1).permutation(inner)
    assert np.abs(turned - inner).any()
    section = replace(body.lattice.tire.section, inner=turned)
    tire = SimpleNamespace(section=section)
    lattice = SimpleNamespace(tire=tire, section=body.lattice.section)
    assert _bead_ends(SimpleNamespace(lattice=lattice)) == ends


def bend(body, size=0.01):
    """A shape without any symmetry; the rim stays where it is."""
    x, y, z = body.lattice.points(np.arange(body.lattice.size)).T
    away = 1 + y / 0.2 + z / 0.4
    shape = np.stack([np.sin(7 * z), np.cos(5 * x + 3 * y), away * np.cos(6 * x)], axis=-1)
    shape[body.everywhere(_on_rim(body)) > 0] = 0.0
    return size * shape


def _on_rim(body):
    on = np.zeros(body.nodes)
    on[body.rim[body.rim < body.nodes]] = 1.0
    return on


def test_flux_is_the_derivative_of_the_moments_of_volume(make_body):
    """Central differences about a deformed state, all waves at once."""
    body, step = make_body(segments=16, arc=6), 1e-4
    state, direction = bend(body), bend(body, 1.0)[::-1] * (bend(body, 1.0) != 0)
    moments = []
    for sign in (1, -1):
        body.set_displacement(state + sign * step * direction)
        moments.append(CavityTrace(body, 5).profile().volume)
    body.set_displacement(state)
    operators = Operators(body, 2e5)
    columns = CavityTrace(body, 5).columns(operators.unknowns)
    displaced = columns.T @ operators.restrict(direction[body.ids])
    expected = (moments[0] - moments[1]) / (2 * step)
    assert displaced == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())
    assert np.abs(expected).min() > 1e-4 * np.abs(expected).max()


def test_wall_and_rim_together_obey_gauss(make_body):
    """Deformed: closed int chi n dS is that of the areas, int chi' e_theta A dtheta: the pressure's force on
    all of the enclosure is the rate of the air's momentum; a moment too: none about the axle."""
    body = make_body(segments=16, arc=6)
    body.set_displacement(bend(body))
    trace = CavityTrace(body, 4)
    unknowns = Operators(body, 2e5, Support("free")).unknowns
    rigid = rigid_motions(body.lattice.points(body.ids) + body.owned(body.u.x.array))
    motions = np.vstack([rigid[unknowns.free], np.linalg.inv(unknowns.rim.coordinates)])
    closed = trace.columns(unknowns).T @ motions
    fine = CavityTrace(body, 12).profile()
    expected = cavity.momentum_of_waves(fine)[:, :9]
    assert pytest.approx(expected, abs=1e-3 * np.abs(expected).max()) == closed[:, :3].T
    assert np.abs(closed[0]).max() < 1e-6 * np.abs(closed).max()


def test_cone_of_the_rim_closes_a_cylinder():
    """Closed form: unit pressure cos theta on a cylinder of radius r and width b pushes z by pi r b."""
    force = rim_cone((0.19, -0.08), (0.19, 0.08), 2)
    assert force[2, 1] == pytest.approx(np.pi * 0.19 * 0.16)
    assert force[0, 2] == pytest.approx(-np.pi * 0.19 * 0.16)
    assert np.abs(force[:, 0]).max() < 1e-12
    tilted = rim_cone((0.18, -0.08), (0.20, 0.08), 1)
    assert tilted[1, 0] == pytest.approx(np.pi * (0.20**2 - 0.18**2))


def test_a_tire_175_to_205_wide_has_its_first_pair_near_223_hz(make_body):
    """The torus inside: n c / (2 pi r) with r its own centroid's distance, 0.1 %."""
    area, moment = segment()
    profile = CavityTrace(make_body(segments=24, arc=10), 12).profile()
    own = cavity.modes(profile, AIR, 500.0)
    expected = AIR.sound_speed * area / moment / (2 * np.pi)
    assert own.frequency[:2] == pytest.approx([expected, expected], rel=1e-3)


@pytest.mark.mpi
def test_the_same_on_any_number_of_processes(make_body):
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        body = make_body(segments=10, arc=4, comm=comm)
        body.set_displacement(bend(body))
        trace, operators = CavityTrace(body, 3), Operators(body, 2e5)
        flux = trace.columns(operators.unknowns).T @ operators.restrict(bend(body, 1.0)[body.ids])
        found.append(np.concatenate([*trace.profile().__dict__.values(), comm.allreduce(flux)]))
    assert found[0] == pytest.approx(found[1], abs=1e-10 * np.abs(found[0]).max())
