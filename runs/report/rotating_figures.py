"""Figures of the rolling tire's eigenvalues: in the complex plane, and over speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tireroad.modal.states import growing
from tireroad.runs.report import live
from tireroad.runs.report.figures import COLOURS, MUTED, WIDE, canvas, encode, line_canvas, styled

_ORDERS = range(1, 9)


@styled
def eigenvalues(eigenvalue: NDArray) -> str:
    """Growth rate Re s over frequency Im s / 2π of eigenvalues (n) 1/s, for Im s >= 0."""
    figure, axes = line_canvas(WIDE, 3.0)
    here = axes[0, 0]
    shown = eigenvalue[eigenvalue.imag >= 0.0]
    unstable = growing(eigenvalue)[eigenvalue.imag >= 0.0]
    for group, colour, label in (
        (shown[~unstable], COLOURS[0], "decaying"),
        (shown[unstable], COLOURS[2], "growing: unstable"),
    ):
        if group.size:
            place = group.imag / (2 * np.pi)
            here.plot(place, group.real, ".", ms=4, color=colour, label=label)
    here.axhline(0.0, color="#7b8794", lw=0.8)
    here.set(xlabel="frequency in Hz", ylabel="Re s in 1/s")
    here.legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return encode(figure)


@styled
def campbell(
    speed: NDArray, damped: NDArray, undamped: NDArray | None, radius: float | None
) -> str:
    """Branches (v, b) Hz over speed (v,) rad/s, in km/h if the rolling `radius` (m) is known.

    Also the lines n Omega / 2 pi, n = 1, 2, ..., at which a stationary road excites.
    """
    figure, ((axes,),) = canvas(WIDE, 4.2)
    x, label, scale = _axis(speed, radius)
    highest = 1.05 * np.nanmax(damped if undamped is None else np.fmax(damped, undamped))
    for n in _ORDERS:
        axes.plot(x, n * speed / (2 * np.pi), color=MUTED, lw=0.6, ls=":")
    if undamped is not None:
        axes.plot(x, undamped, color=COLOURS[2], lw=0.9, ls="--")
        axes.plot([], [], color=COLOURS[2], lw=0.9, ls="--", label="undamped")
    axes.plot(x, damped, color=COLOURS[0])
    axes.plot([], [], color=COLOURS[0], label="damped, Im s / 2π")
    axes.plot([], [], color=MUTED, lw=0.6, ls=":", label="n Ω / 2π")
    axes.set(xlabel=label, ylabel="frequency in Hz", ylim=(0.0, highest))
    axes.margins(x=0)
    if scale:
        other = axes.secondary_xaxis("top", functions=(lambda v: v / scale, lambda w: w * scale))
        other.set_xlabel("speed of the wheel in rad/s")
    axes.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    return encode(figure)


def campbell_live(
    speed: NDArray, damped: NDArray, undamped: NDArray | None, radius: float | None
) -> dict:
    """The same as an interactive chart that names the branch under the pointer."""
    x, label, _ = _axis(speed, radius)
    curves = {f"branch {k + 1}, damped": column for k, column in enumerate(damped.T)}
    colours = [COLOURS[0]] * len(curves)
    dashed: list[str] = []
    if undamped is not None:
        dashed = [f"branch {k + 1}, undamped" for k in range(undamped.shape[1])]
        curves |= dict(zip(dashed, undamped.T, strict=True))
        colours += [COLOURS[2]] * len(dashed)
    curves |= {f"{n} Ω / 2π": n * speed / (2 * np.pi) for n in _ORDERS}
    colours += [MUTED] * len(_ORDERS)
    labels = label, "frequency in Hz"
    return live.charts(
        live.chart(x, curves, labels, colours, dashed=dashed, legend=False, height=380)
    )


def _axis(speed: NDArray, radius: float | None) -> tuple[NDArray, str, float]:
    """Speeds in km/h, axis label and km/h per rad/s; without a radius rad/s, and 0."""
    if not radius:
        return speed, "speed of the wheel in rad/s", 0.0
    return 3.6 * radius * speed, "travelling speed in km/h", 3.6 * radius
