"""Rolling resistance: elements about the inflated tire against Fourier series around, and the road's forces against the losses."""

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu

from tireroad.fem.matrices.compliance import add_part, on_own_rows, solve_all
from tireroad.fem.matrices.rolling_loss import rolling_loss
from tireroad.fem.model import SmallMotions
from tireroad.fem.sections.inflated import InflatedRing, patch_share
from tireroad.fem.sections.radial import radial
from tireroad.tests.validation import mobility

SIZE, PRESSURE, SPEED, ALONG = "205/60 R15", 2.2e5, 72.0, 10
WIDE, LONG, LOAD = 0.05, np.radians(12.0), 100.0  # half of a patch, m and rad; N


def by_series(ring: InflatedRing, waves: int = 40) -> float:
    """Power, W, that a load on a patch at rest loses in the rubber of a ring that passes it, of first order in the losses:

    Omega sum_n n s_n u_n . K_n'' u_n,  K_n u_n = q_n with static moduli."""
    load, lost = ring._radial(ring.patch(0.0, WIDE)), 0.0
    for wave in range(1, waves + 1):
        moved = splu(ring._inside(ring._tangent(wave, PRESSURE)).astype(complex)).solve(load)
        for kind, share in ring._kinds.items():
            part = ring._inside(ring._of_kind(wave, share))
            own = kind.modulus(wave * SPEED / (2 * np.pi)).imag
            lost += patch_share(wave, LONG) * wave * own * (moved.conj() @ (part @ moved)).real
    return float(SPEED * LOAD**2 * lost)


def by_elements(monkeypatch, segments: int) -> float:
    """The same of three-dimensional elements, by their stresses around.

    What elements that are not quite round lose by the inflation (0.03 W), and what is of odd order in the load, is taken off."""
    monkeypatch.setattr(mobility, "AROUND", segments)
    monkeypatch.setattr(mobility, "ALONG", ALONG)
    bench = mobility.Bench()
    motions = SmallMotions(bench.tire, bench.static)
    operators = motions.operators
    stiffness = operators.stiffness.copy()
    for compound in operators.compounds():
        add_part(stiffness, compound.kind.static - 1, compound.stiffness)
    probe = sparse.csr_matrix(bench.patch(0.0, 0.0, (WIDE, LONG)))
    moved = LOAD * solve_all(stiffness, on_own_rows(operators, probe))
    stiffness.destroy()
    body = motions.body
    whole, lost = _everywhere(operators, moved), []
    for times in (1.0, -1.0, 0.0):
        body.set_displacement(bench.static.displacement + times * whole)
        lost.append(rolling_loss(body, SPEED).whole)
    return (lost[0] + lost[1]) / 2 - lost[2]


def _everywhere(operators, moved: np.ndarray) -> np.ndarray:
    return operators.body.everywhere(operators.spread(moved)[:, :, 0])


@pytest.mark.slow
def test_a_small_load_loses_what_fourier_series_around_say(monkeypatch):
    """Two codes that share the section and its compounds alone."""
    exact = by_series(InflatedRing(radial(SIZE), ALONG, 2, PRESSURE))
    coarse, fine = (by_elements(monkeypatch, segments) / exact for segments in (24, 36))
    assert abs(coarse - 1) < 0.04
    assert abs(fine - 1) < 0.04
