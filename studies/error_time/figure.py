"""Pareto fronts of codes, ratios of their times, and errors of every element."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from ..common.figures import colour_of, figure_of, legend, marker_of
from ..study import Row
from .fronts import CRITERIA, SETS, Criterion, Fronts, fronts, methods, ratios
from .reference import converged
from .timed_codes import ThisLibrary

# Codes in the order of their colours.
_CODES = (ThisLibrary.code, "scikit-fem", "FElupe", "DOLFINx", "scikit-fem-native")

# Width of a printed page in inches, and the size of letters in points.
_WIDTH, _LETTERS = 160 / 25.4, 9

# Errors shown are at most these: with larger ones an answer says little.
_MOST = {"angle": 2.0, "force": 100.0, "load": 1.0}


def drawn_fronts(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """The Pareto front of each code with the fastest solvers, for two criteria.

    Lines join medians, and bars are the ranges over the seeds.  The uncertainty of the
    reference is a grey band; errors below it are open markers at its edge.

    Parameters
    ----------
    rows
        The rows of the study.
    filename
        Where to write a picture.

    Raises
    ------
    ValueError, FileNotFoundError
        As from `picture_path`.
    """
    with figure_of((_WIDTH, 3.3), filename, _LETTERS) as figure:
        for axes, name in zip(figure.subplots(1, 2), ("angle", "load"), strict=True):
            criterion = CRITERIA[name]
            known = fronts(rows, criterion, "fastest")
            _front_panel(axes, known, criterion, _MOST[name], _floor(rows, name))
    return figure


def _front_panel(
    axes: Axes, by_code: Fronts, criterion: Criterion, most: float, floor: float
) -> None:
    factor, ends = criterion.factor, []
    for code, front in by_code.items():
        shown = [point for point in front if point.within <= most]
        if not shown:
            continue
        colour, thick = _look(code)
        x = np.array([point.seconds for point in shown])
        y = factor * np.array([point.worst for point in shown])
        clear = y[:, 0] > factor * floor
        y = np.maximum(y, factor * floor)
        axes.plot(x[:, 0], y[:, 0], color=colour, linewidth=thick, zorder=3)
        for filled, chosen in ((colour, clear), ("white", ~clear)):
            axes.plot(
                x[chosen, 0],
                y[chosen, 0],
                marker="o",
                linestyle="",
                color=colour,
                markerfacecolor=filled,
                markersize=3.5,
                zorder=4,
            )
        axes.errorbar(
            x[:, 0],
            y[:, 0],
            xerr=np.abs(x[:, 1:] - x[:, :1]).T,
            yerr=np.abs(y[:, 1:] - y[:, :1]).T,
            fmt="none",
            ecolor=colour,
            elinewidth=0.8,
            alpha=0.5,
        )
        ends.append((code, x[-1, 0], y[-1, 0], colour))
    _framed(axes, criterion, "run time (s)")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high)
    if factor * floor > low:
        axes.axhspan(low, factor * floor, color="0.85", zorder=0)
    _label_ends(axes, ends)


def _label_ends(axes: Axes, ends: Sequence[tuple[str, float, float, str]]) -> None:
    """Names at the ends of lines, moved apart where they would overlap."""
    low, high = np.log(axes.get_ylim())
    ends = sorted(ends, key=lambda end: end[2])
    wanted = [(np.log(y) - low) / (high - low) for _, _, y, _ in ends]
    at = _apart(wanted, 0.075)  # a line of text as a share of the height of the axes
    for i, (code, x, y, colour) in enumerate(ends):
        axes.annotate(
            code.replace("skfem_textile", "this library"),
            *((x, y), (1.02, at[i])),
            textcoords="axes fraction",
            color=colour,
            va="center",
            fontsize=_LETTERS,
            fontweight="bold" if code == ThisLibrary.code else "normal",
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "lw": 0.6,
                "relpos": (0, 0.5),
            },
            annotation_clip=False,
        )


def _apart(wanted: Sequence[float], least: float) -> list[float]:
    """Ascending places that are at least so far apart, near the wanted ones.

    Examples
    --------
    >>> _apart([0.0, 0.5, 0.5], 0.25)
    [0.0, 0.375, 0.625]
    """
    blocks: list[list[float]] = []  # of places less their distance from the first
    for i, place in enumerate(wanted):
        blocks.append([place - i * least])
        while len(blocks) > 1 and np.mean(blocks[-2]) > np.mean(blocks[-1]):
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    places = [float(np.mean(block)) for block in blocks for _ in block]
    return [place + i * least for i, place in enumerate(places)]


def drawn_ratios(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """Time of the fastest other code over that of this library, by the error.

    A panel for each criterion and a line for each set of solvers.  Below one the other
    code is faster.  A line ends at the smallest error that a timed run of another code
    reaches.
    """
    with figure_of((_WIDTH, 2.8), filename, _LETTERS) as figure:
        grid = figure.subplots(1, len(CRITERIA), sharey=True)
        for axes, (name, criterion) in zip(grid, CRITERIA.items(), strict=True):
            for i, solvers in enumerate(SETS):
                known = ratios(fronts(rows, criterion, solvers))
                shown = [pair for pair in known if pair[0] <= _MOST[name]]
                if not shown:
                    continue
                error, ratio = np.array(shown).T
                axes.step(
                    criterion.factor * error, ratio, where="pre", color=colour_of(i)
                )
                axes.plot(
                    criterion.factor * error[-1],
                    ratio[-1],
                    "o",
                    color=colour_of(i),
                    markersize=3,
                )
            axes.axhline(1, color="0.4", linewidth=0.8)
            _framed(axes, criterion, f"error ({criterion.unit})")
            axes.invert_xaxis()
        for i, words in enumerate(_SET_NAMES.values()):
            grid[0].text(
                *(0.04, 0.94 - 0.1 * i, words),
                transform=grid[0].transAxes,
                color=colour_of(i),
                va="center",
            )
        grid[0].set_ylabel("time, other over this library")
    return figure


_SET_NAMES = {"SciPy": "SciPy alone", "fastest": "fastest solvers"}


def drawn_elements(
    rows: Sequence[Row],
    name: str,
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Median errors of every element over its median times, with the fastest solvers.

    Colours are codes, markers are elements.  ``name`` is that of a criterion.  Much
    larger errors than those of fronts are left out.
    """
    criterion = CRITERIA[name]
    with figure_of((_WIDTH, 4.4), filename, _LETTERS) as figure:
        axes = figure.subplots()
        most = 10 * _MOST[name]
        known = {
            method: [point for point in series if point.error.median <= most]
            for method, series in methods(rows, criterion).items()
            if method[2] in SETS["fastest"] or "refined" in method[1]
        }
        elements = list(dict.fromkeys(element for _, element, _ in known))
        for (code, element, _), series in known.items():
            colour, thick = _look(code)
            axes.plot(
                [point.seconds.median for point in series],
                [criterion.factor * point.error.median for point in series],
                marker=marker_of(elements.index(element)),
                color=colour,
                linewidth=thick / 2,
                markersize=3.5,
            )
        _framed(axes, criterion, "run time (s)")
        codes = dict.fromkeys(code for code, _, _ in known)
        handles = [Line2D([], [], color=_look(code)[0], label=code) for code in codes]
        handles += [
            Line2D([], [], color="0.3", linestyle="", marker=marker_of(i), label=name)
            for i, name in enumerate(elements)
        ]
        legend(figure, handles, 4)
    return figure


def _framed(axes: Axes, criterion: Criterion, xlabel: str) -> None:
    """Logarithmic axes with plain numbers, a grid and the criterion as the title."""
    axes.set(xscale="log", yscale="log", xlabel=xlabel)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(_plain))
        axis.set_minor_formatter(NullFormatter())
    scene, _, error = criterion.label.partition(", ")
    title = f"{scene.capitalize()}:\n{error} ({criterion.unit})"
    axes.set_title(title, fontsize=_LETTERS, loc="left")
    axes.grid(alpha=0.25, linewidth=0.5)


def _plain(value: float, place: int | None) -> str:
    return f"{value:.12g}" if value > 1e-5 else f"{value:g}"


def _look(code: str) -> tuple[str, float]:
    """Colour and width of the line of a code."""
    return colour_of(_CODES.index(code)), 2.0 if code == ThisLibrary.code else 1.2


def _floor(rows: Sequence[Row], name: str) -> float:
    """Uncertainty of the reference of a criterion; zero if it is exact."""
    end = converged(rows)
    return end.uncertainty / end.load if name == "load" and end else 0.0
