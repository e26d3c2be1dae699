"""Line charts and bars of the report, as data URIs, thinned without losing peaks.

Uses matplotlib's Figure objects only: no window, no global state.
"""

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tireroad.contact.results.spectra import SILENT, nominal

DRAWN = 600  # bins of a long series; each keeps its minimum and maximum
COMPONENTS = ("x, forward", "y, along the axle", "z, up")
# Okabe and Ito's colours, distinguishable for colour-blind readers.
CYCLE = ("#0072b2", "#009e73", "#d55e00", "#cc79a7", "#e69f00", "#56b4e9")
COLOURS = CYCLE[:3]
MUTED = "#9aa5b1"
STYLE = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#7b8794",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e7eb",
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "svg.hashsalt": "tireroad",
    "path.simplify_threshold": 0.5,
}
styled = matplotlib.rc_context(STYLE)  # decorator for every figure
WIDE = 6.3  # inches: widest figure whose text is still readable when a phone shows it in full
NARROW = 4.2  # inches: of the same on a phone, where pages have room for both
RANGE_DB = 100.0  # dB: lines further below the highest one of a spectrum are not drawn
LEAST_RANGE_DB = 20.0  # dB: on a smaller range, tiny differences between bars look large
FEWEST_BANDS = 3  # of a chart: fewer are said in numbers


def envelope(x: NDArray, y: NDArray, bins: int = DRAWN) -> tuple[NDArray, NDArray]:
    """Minimum and maximum of y (n) in each of `bins` blocks of samples, in order, with their x.

    A peak of one sample stays visible, which plain subsampling would not ensure. Short series are
    returned unchanged.
    """
    width = len(y) // bins
    if width <= 2:
        return x, y
    whole = width * bins
    blocks = np.nan_to_num(y[:whole]).reshape(bins, width)
    ends = np.sort(np.stack((blocks.argmin(axis=1), blocks.argmax(axis=1)), -1), axis=1)
    order = np.append((ends + width * np.arange(bins)[:, None]).ravel(), np.arange(whole, len(y)))
    return x[order], y[order]


def peak_hold(frequency: NDArray, level: NDArray, bins: int = DRAWN) -> tuple[NDArray, NDArray]:
    """The highest line in each of `bins` bands equal on a logarithmic axis; frequency (n) > 0."""
    if len(frequency) <= bins:
        return frequency, level
    low, high = np.log(frequency[[0, -1]])
    edges = np.linspace(low, high, bins)
    first = np.unique(np.searchsorted(np.log(frequency), edges[:-1]))
    highest = np.maximum.reduceat(level, first)
    return frequency[first], highest


@dataclass(frozen=True)
class Drawing:
    """A figure as data URIs, `wide` and `narrow` for a phone, with its caption."""

    wide: str
    narrow: str
    caption: str


def drawing(draw: Callable[[float], str], caption: str, wide: float = WIDE) -> Drawing:
    """The figure that `draw` makes of a width in inches, in both widths."""
    return Drawing(draw(wide), draw(NARROW), caption)


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **more: Any) -> tuple:
    """Figure of width × height inches and its axes (rows, columns), laid out without overlap."""
    figure, axes = bare_canvas(width, height, rows, columns, **more)
    figure.set_layout_engine("constrained")
    return figure, axes


def bare_canvas(width: float, height: float, rows: int = 1, columns: int = 1, **more: Any) -> tuple:
    """The same without layout: the caller places the axes."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **more)


def line_canvas(
    width: float, height: float, rows: int = 1, below: float = 0.42, **more: Any
) -> tuple:
    """The same for one column of line charts with fixed margins, in half the time.

    `below`: inches for the labels of the lowest axis.
    """
    figure, axes = bare_canvas(width, height, rows, **more)
    figure.subplots_adjust(
        left=0.66 / width,
        right=1 - 0.12 / width,
        bottom=below / height,
        top=1 - 0.27 / height,
        hspace=0.3 if rows > 1 else 0.2,
    )
    return figure, axes


def encode(figure: Figure, kind: str = "svg", dpi: int = 130) -> str:
    """The figure as a data URI: SVG for lines, PNG for coloured surfaces."""
    stream = BytesIO()
    metadata = {"Date": None} if kind == "svg" else {}
    figure.savefig(stream, format=kind, dpi=dpi, metadata=metadata)
    mime = "image/svg+xml" if kind == "svg" else "image/png"
    return f"data:{mime};base64,{b64encode(stream.getvalue()).decode()}"


def decibels(amplitude: NDArray) -> NDArray:
    """20 lg |a|, re 1 in its unit; zero and NaN give −6000 dB, far out of range."""
    return 20.0 * np.log10(np.maximum(np.nan_to_num(np.abs(amplitude)), 1e-300))


@styled
def forces(time: NDArray, contact: NDArray, axle: NDArray | None, active: NDArray | None) -> str:
    """Contact and axle force (nt, 3) N over time (nt) s, and the number of points in contact."""
    rows = 3 + (active is not None)
    figure, axes = line_canvas(WIDE, 1.45 * rows + 0.4, rows, sharex=True)
    for row, name in enumerate(COMPONENTS):
        here: Axes = axes[row, 0]
        here.plot(*envelope(time, contact[:, row]), color=COLOURS[0], label="contact", lw=0.8)
        if axle is not None:
            here.plot(*envelope(time, axle[:, row]), color=COLOURS[2], label="axle", lw=0.8)
        here.set_title(name)
        here.set_ylabel("force in N")
    axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)
    if active is not None:
        axes[3, 0].plot(*envelope(time, active), color="#52606d", lw=0.8)
        axes[3, 0].set(title="points in contact", ylabel="number")
    _over_time(axes[-1, 0], time)
    figure.align_ylabels()
    return encode(figure)


@styled
def spectrum(frequency: NDArray, axle: NDArray, of: str = "axle force") -> str:
    """Amplitude spectrum (nf, 3) N of a force, named `of`, over frequency (nf) Hz."""
    figure, axes = line_canvas(WIDE, 3.4)
    here, above_zero = axes[0, 0], frequency > 0
    levels = decibels(axle[above_zero])
    for column, name in enumerate(COMPONENTS):
        here.plot(
            *peak_hold(frequency[above_zero], levels[:, column]), color=COLOURS[column], label=name
        )
    here.set(xscale="log", xlabel="frequency in Hz", ylabel=f"{of} in dB re 1 N")
    _over_frequency(here, frequency[above_zero])
    _top_decibels(here, levels)
    here.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return encode(figure)


def level_range(level: NDArray) -> tuple[float, float]:
    """Lower end (a multiple of 10 dB) and upper end of the bars of levels in dB."""
    heard = level[level > SILENT]
    top = float(heard.max(initial=0.0))
    least = max(float(heard.min(initial=top)), top - RANGE_DB)
    return 10.0 * float(np.floor(min(least, top - LEAST_RANGE_DB) / 10.0)), top


@styled
def third_octaves(
    centre: NDArray,
    level: NDArray,
    error: NDArray | None,
    label: str,
    few: NDArray,
    names: Sequence[str] = COMPONENTS,
    chance: NDArray | None = None,
) -> str:
    """Third-octave levels (nb, n) dB as bars over band centres (nb) Hz, with errors (nb, n) dB as lines.

    Pale where a band has `few` (nb) lines. Boxes: bounds (nb, 2) dB of the levels by `chance`.
    """
    figure, axes = line_canvas(WIDE, 3.2, below=0.62)
    here, place = axes[0, 0], np.arange(len(centre))
    finite = np.where(level > SILENT, level, -np.inf)
    floor, _ = level_range(level)
    pitch = 0.84 / len(names)
    for column, name in enumerate(names):
        height = np.maximum(finite[:, column] - floor, 0.0)
        where = place + pitch * (column - (len(names) - 1) / 2)
        bars = here.bar(where, height, 0.93 * pitch, bottom=floor, color=CYCLE[column], label=name)
        for bar in np.array(bars.patches)[few]:
            bar.set_alpha(0.45)
        if chance is not None:
            boxed = (height > 0) & np.isfinite(chance).all(axis=1)
            low, high = chance[boxed].T
            bottom = (floor + height)[boxed] + low
            box = {"color": "none", "edgecolor": "#52606d", "lw": 0.7}
            here.bar(where[boxed], high - low, 0.55 * pitch, bottom=bottom, **box)
        if error is not None:
            known = np.isfinite(error[:, column]) & (height > 0)
            ends = where[known], (floor + height)[known], error[known, column]
            here.errorbar(*ends, fmt="none", ecolor="#1f2933", elinewidth=0.8, capsize=1.5)
    here.set_xticks(place, [f"{value:g}" for value in nominal(centre)], rotation=45)
    here.grid(axis="x", visible=False)
    here.set(xlabel="third-octave band in Hz", ylabel=label)
    here.set_xlim(-0.6, len(centre) - 0.4)
    here.legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return encode(figure)


@styled
def lines(
    x: NDArray, curves: Mapping[str, NDArray], labels: tuple[str, str], colours: Sequence[str]
) -> str:
    """Named curves (n,) dB over frequency x (n,) Hz > 0, on a logarithmic axis."""
    figure, ((here,),) = line_canvas(WIDE, 3.0)
    for (name, values), colour in zip(curves.items(), colours, strict=False):
        here.plot(*peak_hold(x, values), color=colour, label=name)
    here.set(xscale="log", xlabel=labels[0], ylabel=labels[1])
    _over_frequency(here, x)
    _top_decibels(here, np.column_stack(list(curves.values())))
    here.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return encode(figure)


@styled
def driven_points(time: NDArray, force: NDArray | None, moved: NDArray, names: list[str]) -> str:
    """Displacement (nt, k, 3) m, and force (nt, k) N, of k driven points over time (nt) s."""
    rows = len(names)
    figure, axes = canvas(WIDE, 1.9 * rows + 0.4, rows, sharex=True)
    for point, name in enumerate(names):
        here: Axes = axes[point, 0]
        for column, component in enumerate(COMPONENTS):
            drawn = envelope(time, 1e6 * moved[:, point, column])
            here.plot(*drawn, color=COLOURS[column], label=component)
        here.set_title(name)
        here.set_ylabel("displacement in µm")
        if force is not None and force[:, point].any():
            other = here.twinx()
            other.plot(*envelope(time, force[:, point]), color=MUTED, lw=0.8, ls="--")
            other.set_ylabel("force in N (dashed)", color="#52606d")
            other.grid(visible=False)
            other.spines["right"].set_visible(True)
    above = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.12)}  # the title, which may be long
    axes[0, 0].legend(ncols=3, **above, borderaxespad=0.0)
    _over_time(axes[-1, 0], time)
    return encode(figure)


@styled
def receptance(frequency: NDArray, pairs: Sequence[tuple[str, NDArray]]) -> str:
    """Magnitude (dB re 1 m/N) and phase (degrees) of named receptances (nf) m/N."""
    figure, axes = canvas(WIDE, 4.4, 2, sharex=True, gridspec_kw={"height_ratios": (2, 1)})
    above_zero = frequency > 0
    levels = decibels(np.stack([values[above_zero] for _, values in pairs]))
    for number, (name, values) in enumerate(pairs):
        colour = CYCLE[number % len(CYCLE)]
        axes[0, 0].plot(frequency[above_zero], levels[number], color=colour, label=name)
        axes[1, 0].plot(frequency[above_zero], np.angle(values[above_zero], deg=True), color=colour)
    axes[0, 0].set(xscale="log", ylabel="receptance in dB re 1 m/N")
    axes[0, 0].legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    axes[1, 0].set(ylabel="phase in °", xlabel="frequency in Hz", yticks=(-180, -90, 0, 90, 180))
    _over_frequency(axes[1, 0], frequency[above_zero])
    _top_decibels(axes[0, 0], levels)
    return encode(figure)


def _over_time(axes: Axes, time: NDArray) -> None:
    axes.set_xlabel("time in s")
    if len(time) > 1:  # matplotlib warns of a range without extent
        axes.set_xlim(time[0], time[-1])


def _over_frequency(axes: Axes, frequency: NDArray) -> None:
    if len(frequency) > 1:
        axes.set_xlim(frequency[0], frequency[-1])
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(which="minor", axis="x", color="#f1f3f5")


def _top_decibels(axes: Axes, level: NDArray) -> None:
    """Limit the axis to the upper RANGE_DB of the levels, or less if they span less."""
    top = level.max(initial=-RANGE_DB)
    axes.set_ylim(max(level.min(initial=top), top - RANGE_DB) - 3.0, top + 3.0)
