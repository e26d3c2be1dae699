"""Report section about the modes of the rolling tire: eigenvalues in the plane and over speed."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError
from tireroad.modal.states import growing
from tireroad.runs.report import live
from tireroad.runs.report.figures import COLOURS, MUTED, WIDE, canvas, encode, line_canvas, styled
from tireroad.runs.report.read import Absent, Results, Section, TextTable, attributes, quantity
from tireroad.runs.report.sections import tire
from tireroad.runs.report.sections.tire import LISTED

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
def campbell_figure(
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


def rotating(results: Results) -> Section:
    """The section on eigenvalues of the rolling tire (rotating.h5)."""
    name = "rotating.h5"
    section = Section("Modes of the rolling tire", "Eigenvalues s of the rotating, damped tire.")
    value = results.array(name, "eigenvalue")
    # Including those of the near-defective block.
    block = results.optional(name, "block")
    every = value if block is None else np.concatenate([value, np.linalg.eigvals(block)])
    beyond = every[growing(every)]
    section.facts = attributes(results, name, (("speed", "rad/s"), ("basis_condition", "")))
    section.facts.append(("growing", quantity(len(beyond))))
    if len(beyond):
        worst = beyond[beyond.real.argmax()]
        section.warnings.append(
            f"The rolling tire is unstable: {len(beyond)} eigenvalues have Re s > 0, the worst "
            f"{quantity(float(worst.real), '1/s')} at "
            f"{quantity(float(abs(worst.imag) / 2 / np.pi), 'Hz')}."
        )
    rising = np.flatnonzero(value.imag > 0)
    rising = rising[np.argsort(value.imag[rising])]
    columns = {"residual": results.optional(name, "residual")}
    columns["left residual"] = results.optional(name, "left_residual")
    present = {key: column for key, column in columns.items() if column is not None}
    rows = [
        (
            quantity(float(value[q].imag / 2 / np.pi), "Hz"),
            quantity(float(value[q].real), "1/s"),
            f"{-100.0 * value[q].real / abs(value[q]):.3g} %".replace("-", "−"),
            *(quantity(float(column[q])) for column in present.values()),
        )
        for q in rising[:LISTED]
    ]
    section.table = TextTable(("frequency", "Re s", "of critical damping", *present), rows)
    tire.resonances(results, section, name, "air_share", value)
    if len(rising) > LISTED:
        listed = f"The table lists {LISTED} of {len(rising)} pairs, by frequency."
        section.notes.append(listed)
    campbell(results, section)
    section.show(eigenvalues(value), "Eigenvalues with Im s ≥ 0.")
    return section


def campbell(results: Results, section: Section) -> None:
    """Add the branches over speed, damped and undamped, if the run has computed them."""
    speed = results.optional("rotating.h5", "campbell/speed")
    if speed is None:
        return
    radius: float | None = None
    with suppress(Absent, InputError):  # that file's own section reports the problem
        radius = float(results.attribute("static.h5", "rolling_radius") or 0.0)
    damped = results.array("rotating.h5", "campbell/frequency")
    undamped = results.optional("rotating.h5", "campbell/undamped")
    given = speed, damped, undamped, radius
    text = "Branches followed over speed, on one static state. Solid: damped, as the tire rings"
    if undamped is not None:
        text += (
            "; dashed: the same tire without damping (what is damped beyond critical has only this)"
        )
    text += "; dotted: n Ω/2π, n = 1 to 8, at which a standing road excites."
    section.show(campbell_figure(*given), text, campbell_live(*given))
