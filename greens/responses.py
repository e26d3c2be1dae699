"""Responses with the residual flexibility asked for, and the error that truncated modes leave.

Every truncated mode is faster than the last one kept, w_c. With a damping rate d, its static
response differs from its true one by at most the share
b(w) = |w^2 - i w d| / |w_c^2 - w^2 + i w d|.  Hence

    none          |G_t| (1 + b) / |H|     G_t: upper half of the modes, for the tail
    dirac, static |G_res| b / |H|         a bound for a standing wheel
    attachment    (|H_x(w) - H_x(0)| + |G_res|) b / |H|, H_x the states beyond w_c,

in Frobenius norms over all outputs and forces. The axle force, the sum of the loads less the second
rate of the first moment, lacks  w^2 |m_r| (1 + b)  per unit load, m_r being the static moment
outside the states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from scipy import sparse

from tireroad.fem.errors import ConvergenceError, NearlySingular
from tireroad.greens.coupling import FASTEST, Basis, Wheel, between, together
from tireroad.greens.residuals import residual_of
from tireroad.greens.response import Response, keep
from tireroad.greens.rolling_loss import standing
from tireroad.greens.slow import lowest, slowed
from tireroad.modal.basis import ModalBasis
from tireroad.modal.damping import beyond
from tireroad.modal.rolling import RollingModes, rolling_modes

Figures = dict[str, tuple[float, str]]
Answer = TypeVar("Answer")
# Points and frequencies at which the truncation error is estimated: enough for its magnitude.
_SAMPLE = 40
_FREQUENCIES = 25
LOST = "power lost in the rubber by the static state as it rolls"


@dataclass(frozen=True)
class Cutoff:
    """The highest kept mode, `circular` rad/s, and the damping `rate` 1/s of those beyond it."""

    circular: float
    rate: float

    def share(self, frequency: np.ndarray) -> np.ndarray:
        """b at the frequencies (f,) Hz; infinite at and beyond the cutoff."""
        omega = 2 * np.pi * frequency
        damped = 1j * omega * self.rate
        b = np.abs(omega**2 - damped) / np.abs(self.circular**2 - omega**2 + damped)
        return np.where(omega < self.circular, b, np.inf)


def estimate(response: Response, option: str, cutoff: Cutoff, frequency: np.ndarray) -> np.ndarray:
    """Estimated relative error (f,) of the receptance at the frequencies in Hz."""
    H = response.receptance(frequency)
    share = cutoff.share(frequency)
    beyond = np.abs(response.eigenvalue) > cutoff.circular
    kind = residual_of(option)
    if not kind.solves:
        upper = np.abs(response.eigenvalue) > np.median(np.abs(response.eigenvalue))
        off = _size(response.static() - response.keeping(~upper).static()) * (1 + share)
    elif kind.static:
        off = _size(response.residual) * share
    else:
        lagging = H - response.keeping(~beyond).receptance(frequency)
        off = (_size(lagging) + _size(response.residual)) * share
    return relative(off, _size(H))


def relative(off: np.ndarray, size: np.ndarray) -> np.ndarray:
    """off / size (f,); 0 where both are, as for points that the road holds."""
    return np.divide(off, size, out=np.where(off > 0, np.inf, 0.0), where=size > 0)


def estimate_axle(response: Response, cutoff: Cutoff, frequency: np.ndarray) -> np.ndarray | None:
    """Estimated error (f,) of the axle force per unit load, root mean square over the loads.

    None where the static moment outside the states is unknown. At 0 Hz a load reaches the axle
    entirely.
    """
    if response.left_out is None:
        return None
    inertia, *rest = np.split(response.left_out, len(response.left_out) // 3)
    s = 2j * np.pi * frequency[:, None, None]
    felt = s**2 * inertia + (s * rest[0] if rest else 0.0)
    lacking = _size(felt) / np.sqrt(response.left_out.shape[1])
    share = np.where(frequency > 0, cutoff.share(frequency), 0.0)
    return lacking * (1 + share)


def _size(matrices: np.ndarray) -> np.ndarray:
    return np.linalg.norm(matrices, axis=(-2, -1))


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """Options of a response.

    `residual`: how truncated modes are represented; `dynamic`: how many states stay dynamic (None:
    all); `band` (Hz) of interest (None: up to half the highest mode). InputError for an unknown
    residual.
    """

    residual: str = "static"
    dynamic: int | None = None
    band: float | None = None

    def __post_init__(self) -> None:
        residual_of(self.residual)


@dataclass(frozen=True)
class Made:
    """A `response` with `figures`, name: (value, unit), and `warnings`.

    `attached`: modes and attachment modes, whose states the response has; None without the latter.
    """

    response: Response
    figures: Figures = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    attached: RollingModes | None = None


def make_response(
    wheel: Callable[[], Wheel],
    rolling: RollingModes,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
    residual: str,
    fields: Callable[[], ModalBasis],
) -> Made:
    """The response (r, k) between probes `outputs` (r, 3 s) and `loads` (k, 3 s) with a residual.

    `wheel` returns the full matrices and `fields` the modes on all unknowns; each is called only if
    the residual needs it. InputError for an unknown residual. Collective.
    """
    if not residual_of(residual).solves:
        return _made(Basis.of(rolling).couple(outputs, loads))
    made = _solved(wheel, rolling, outputs, loads, residual, fields)
    rolled = standing(wheel(), lowest(rolling.basis.projection))
    if rolled is None:
        return made
    offset = outputs[:, : len(rolled.motion)] @ rolled.motion
    figures = made.figures | {LOST: (rolled.loss.whole, "W")}
    return replace(made, response=replace(made.response, offset=offset), figures=figures)


def _solved(
    wheel: Callable[[], Wheel],
    rolling: RollingModes,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
    residual: str,
    fields: Callable[[], ModalBasis],
) -> Made:
    """The response with a residual that is solved for. Collective."""
    kind, probes = residual_of(residual), (outputs, loads)
    relaxes = rolling.basis.projection.parts is not None and not rolling.full
    if relaxes:  # between all of them, where what relaxes is symmetric
        probes = (together(outputs, loads),) * 2
    if not kind.joins:
        basis = Basis.of(rolling)
        arguments = basis, None, *probes, residual
        response = _singular_named(wheel(), lambda: wheel().respond(*arguments))
        if not relaxes:
            return _made(response)
        response, figures = _relaxing(wheel(), basis, probes[0], response)
        return _made(between(response, outputs, loads), figures)
    found = fields()
    if found is not rolling.basis:  # a new solution: its states must be its own too
        rolling = rolling_modes(found, rolling.turning, wheel().operators.body.comm)
    assert found.modes is not None, "the modes on all unknowns"
    joined, figures = (Basis.of(rolling), found.modes, *probes), Figures()
    response, basis = _singular_named(wheel(), lambda: wheel().respond_attached(*joined))
    if relaxes:
        response, figures = _relaxing(wheel(), basis, probes[0], response)
        response = between(response, outputs, loads)
    attached = _attached(basis, rolling)
    highest = cutoff(rolling)
    limit = FASTEST * max(highest.circular, highest.rate)
    kept = response.keeping_where(lambda s: np.abs(s) <= limit)
    static = len(response.every) - len(kept.every)
    what = f"residual states faster than {FASTEST:g} times the highest mode, made static"
    slow = np.abs(attached.states.eigenvalue) <= limit
    attached = replace(attached, states=attached.states.among(slow))
    return replace(_made(kept, {what: (static, "-")} | figures), attached=attached)


def _relaxing(
    wheel: Wheel, basis: Basis, probes: sparse.csr_matrix, response: Response
) -> tuple[Response, Figures]:
    """The response with the slow moduli of rubber, and how much of it. Collective."""
    found = slowed(wheel, basis, probes, response)
    return found.response, {
        "states of slow rubber": (found.response.relaxing, "-"),
        "share of a point's flexibility that slow rubber lacks, at most": (found.left_out, "-"),
        "share of it that slow rubber would stiffen, at most": (found.stiffer, "-"),
    }


def _attached(basis: Basis, rolling: RollingModes) -> RollingModes:
    """The modes with their attachment modes and the states of both, as the wheel rolls."""
    projection = basis.projection
    modes = ModalBasis(frequency=projection.frequency, shape=basis.shape, projection=projection)
    return RollingModes(basis=modes, states=basis.states, turning=rolling.turning)


def _singular_named(wheel: Wheel, respond: Callable[[], Answer]) -> Answer:
    """The value of `respond`; the speed is named if K_Omega is singular. Collective."""
    try:
        return respond()
    except NearlySingular as error:
        if not wheel.speed:
            raise
        raise ConvergenceError(
            f"greens: the stiffness of the tire that turns at {wheel.speed:.6g} rad/s is singular or nearly so, as "
            f"at a critical speed ({error}). Lower the speed."
        ) from None


def _made(response: Response, figures: Figures | None = None) -> Made:
    """The response, with a warning if any of its states grow."""
    count, rate = response.growth
    warnings: tuple[str, ...] = ()
    if count:
        warnings = (
            f"{count} state(s) of the response are unstable, the fastest growing at {rate:.3g} 1/s: lower the "
            "speed, or take another greens.residual",
        )
    return Made(response, figures or {}, warnings)


def selected(
    whole: Response, rolling: RollingModes, wanted: Wanted, counted: slice = slice(None)
) -> Response:
    """The response with only the wanted states dynamic; without a residual the others are dropped.

    `counted`: the outputs and forces by which states are chosen.
    """
    if wanted.dynamic is None:
        return whole
    kept = keep(whole, wanted.dynamic, band(rolling, wanted), counted)
    return kept if residual_of(wanted.residual).solves else replace(kept, residual=whole.residual)


def band(rolling: RollingModes, wanted: Wanted) -> float:
    """Upper limit of the band of interest, Hz: as given, or half the highest mode."""
    return wanted.band or cutoff(rolling).circular / (4 * np.pi)


def cutoff(rolling: RollingModes) -> Cutoff:
    """The highest mode, or state of the full problem, and the damping of those beyond it."""
    mass, stiffness = beyond(rolling.turning.damping, rolling.basis.projection)
    return Cutoff(rolling.highest, mass + stiffness * rolling.highest**2)


def judged(
    name: str, whole: Response, response: Response, rolling: RollingModes, wanted: Wanted
) -> Figures:
    """Estimated error of the receptance in the band, from truncated modes and static states."""
    top, figures = band(rolling, wanted), dict[str, tuple[float, str]]()
    some = [slice(None, None, -(-n // _SAMPLE)) for n in whole.residual.shape]
    whole, response = whole.between(*some), response.between(*some)
    frequency = np.linspace(0, top, _FREQUENCIES)[1 if whole.rigid else 0 :]
    off = estimate(whole, wanted.residual, cutoff(rolling), frequency)
    label = f"up to {top:.4g} Hz, {name}"
    figures[f"estimated truncation error {label}"] = (float(off.max()), "-")
    if wanted.dynamic is not None:
        H = whole.receptance(frequency)
        lost = np.linalg.norm(response.receptance(frequency) - H, axis=(1, 2))
        lost = relative(lost, np.linalg.norm(H, axis=(1, 2)))
        figures[f"error of the states made static {label}"] = (float(lost.max()), "-")
    axle = estimate_axle(response, cutoff(rolling), frequency)
    if axle is not None:
        figures[f"estimated error of the axle force per N of load {label}"] = (
            float(axle.max()),
            "-",
        )
    return figures
