"""Curves with matplotlib: loads, laws, and singular fibres over an outline."""

import os
from collections.abc import Mapping, Sequence
from itertools import cycle, product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import ArrayLike

from ..fabric.law import BiaxialLaw, Law, domain_of
from .drawing import legend_below, new_figure
from .layout import POINT, TITLE, default_width, text_width, wrapped

if TYPE_CHECKING:
    from ..outlines import Outline, SingularFibres

# Okabe and Ito's colours, distinct for any kind of colour vision.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

# Minimum height of a figure in inches. Chosen by eye: room for the legend.
_LEAST_HEIGHT = 2.5

# Largest number of panels side by side.  Chosen by eye.
_IN_A_ROW = 3

# Largest number of columns of a legend; widths of the line and gap before each label,
# and of the gap after it, in font sizes (matplotlib's defaults).
_MOST_COLUMNS, _LINE, _BETWEEN = 3, 2.8, 2.0

# Opacity of a band, and its labels by the number of entries of a curve.
_PALE, _BANDS = 0.25, {3: "error interval", 4: "samples of the fabric"}


def curves(
    panels: Mapping[str, Mapping[str, tuple[ArrayLike, ...]]],
    xlabel: str,
    ylabel: str,
    filename: str | os.PathLike[str] | None = None,
    same_scales: bool = False,
) -> Figure:
    """Plot curves in panels, up to three in a row; a label has one colour in all.

    Parameters
    ----------
    panels
        For each panel title, curves ``(x, y)`` by label, or ``(x, y, half_width)`` with
        an error interval, or ``(x, y, low, high)`` with a band of samples.
    xlabel, ylabel
        Labels of the axes, with units.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).
    same_scales
        True if all panels have the same axes.

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> figure = curves({"Fig. 5": {"aligned": ([0, 1], [0, 2])}}, "mm", "N")
    >>> [axes.get_title() for axes in figure.axes]
    ['Fig. 5']
    """
    with new_figure(filename) as figure:
        labels = dict.fromkeys(label for lines in panels.values() for label in lines)
        colour = dict(zip(labels, cycle(COLOURS), strict=False))
        columns = min(_IN_A_ROW, len(panels))
        rows, width = -(-len(panels) // columns), default_width(columns) / 25.4
        height = max(_LEAST_HEIGHT, 0.8 * width / columns)
        figure.set_size_inches(width, rows * height)
        for i, (title, lines) in enumerate(panels.items(), start=1):
            first = figure.axes[0] if same_scales and figure.axes else None
            axes = figure.add_subplot(rows, columns, i, sharex=first, sharey=first)
            for label, (x, y, *band) in lines.items():
                axes.plot(x, y, "o-", label=label, color=colour[label], markersize=2)
                if band:
                    half, y = np.asarray(band[0]), np.asarray(y)
                    low, high = (y - half, y + half) if len(band) == 1 else band
                    axes.fill_between(x, low, high, color=colour[label], alpha=_PALE)
            axes.set(title=title, xlabel=xlabel, ylabel=ylabel)
            axes.grid(alpha=0.3)
        handles: list[Artist] = [
            Line2D([], [], marker="o", markersize=4, color=c, label=k)
            for k, c in colour.items()
        ]
        lengths = {len(line) for lines in panels.values() for line in lines.values()}
        handles += [
            Patch(color="grey", alpha=_PALE, label=_BANDS[n])
            for n in sorted(lengths & set(_BANDS))
        ]
        names = [str(one.get_label()) for one in handles]
        legend_below(figure, handles, columns_of(names, width * 25.4))
    return figure


def columns_of(labels: Sequence[str], width: float) -> int:
    """Number of columns of a legend that fit a width in mm."""
    size = TITLE * POINT
    for n in range(_MOST_COLUMNS, 1, -1):
        columns = np.array_split([text_width(label, TITLE) for label in labels], n)
        widest = [column.max(initial=0.0) for column in columns]
        if sum(widest) + n * (_LINE + _BETWEEN) * size <= width:
            return n
    return 1


# Dashes of lines, each for all colours, so that many lines are distinct.
_DASHES = "-", "--", ":", "-."

# Largest number of values with a tick each.
_MOST_TICKS = 6

# Smallest range of an ordinate relative to its largest value.  Chosen: smaller
# differences are within the error of most meshes, and do not fill a panel.
_LEAST_RANGE = 0.05

# Largest number of lines in a panel, if rows of panels can show another quantity.
# Chosen by eye.
_MOST_LINES = 6

# Share of the width of a panel that its axis has at least.
_SHARE = 0.8

# Labels of the marks of runs that did not apply the whole load.
_EARLY, _NONE = "stopped early: at its last state", "refused: no state"


def compared_runs(
    values: Mapping[str, Sequence[Any]],
    figures: Mapping[str, ArrayLike],
    complete: ArrayLike,
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Plot figures of several runs over their values, a panel for each figure.

    The quantity with the most values is the abscissa; each combination of the others is
    a line, which joins runs that applied the whole load; other runs are marked.  If
    there are more than six lines, rows of panels show the first of the others.

    Parameters
    ----------
    values
        Values of each run by quantity with its unit, numbers or words.
    figures
        Figure of each run by name with its unit, shape (n_runs,), not finite for a run
        without a state; or also half-widths of error intervals, not finite if there is
        none, shape (2, n_runs).
    complete
        True for runs that applied the whole load, shape (n_runs,).
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> figure = compared_runs(
    ...     {"Friction": [0.0, 0.1]}, {"Force (N)": [10.0, 12.0]}, [True, True]
    ... )
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_title()
    ('Friction', 'Force (N)')
    """
    along = max(values, key=lambda name: len(set(map(repr, values[name]))))
    x, ticks = _places(values[along])
    of_rows, of_lines = _rows_and_lines(values, along)
    rows, lines = _grouped(values, of_rows), _grouped(values, of_lines)
    done = np.asarray(complete, dtype=bool)
    known = [np.atleast_2d(np.asarray(y, dtype=float)) for y in figures.values()]
    found = np.array([np.vstack([y, np.full_like(y, np.nan)])[:2] for y in known])
    states = np.isfinite(found[:, 0]).any(axis=0)
    shown = dict(zip(lines, cycle((c, d) for d in _DASHES for c in COLOURS)))
    with new_figure(filename) as figure:
        n = len(figures)
        width = default_width(n) / 25.4
        figure.set_size_inches(width, len(rows) * max(_LEAST_HEIGHT, width / n))
        panels = product(rows.items(), zip(figures, found, strict=True))
        for i, ((row, in_row), (name, y)) in enumerate(panels, start=1):
            axes = figure.add_subplot(len(rows), n, i)
            axes.set_xlabel("\n".join(wrapped(along, _SHARE * width * 25.4 / n, TITLE)))
            axes.set_title("\n".join(filter(None, (row, name))))
            for label, of_line in lines.items():
                runs = [run for run in of_line if run in in_row]
                _draw_line(axes, x[runs], y[:, runs], done[runs], shown[label])
            axes.grid(alpha=0.3)
            low, high = axes.get_ylim()
            wide = 0.5 * max(high - low, _LEAST_RANGE * max(abs(low), abs(high)))
            axes.set_ylim(0.5 * (low + high) - wide, 0.5 * (low + high) + wide)
            if ticks:
                axes.set_xticks([*ticks], [*ticks.values()])
        handles: list[Artist] = [
            Line2D([], [], label=label, color=c, ls=d, marker="o", markersize=3)
            for label, (c, d) in shown.items()
            if label
        ]
        for mark, name, runs in (("x", _EARLY, states), ("v", _NONE, ~states)):
            if (runs & ~done).any():
                look: dict[str, Any] = {"c": "black", "ls": "", "mfc": "none"}
                handles.append(Line2D([], [], label=name, marker=mark, **look))
        if np.isfinite(found[:, 1]).any():
            bar: dict[str, Any] = {"c": "black", "ls": "", "marker": "|"}
            handles.append(Line2D([], [], label=_BANDS[3], **bar))
        if handles:
            names = [str(one.get_label()) for one in handles]
            legend_below(figure, handles, columns_of(names, width * 25.4))
    return figure


def _rows_and_lines(
    values: Mapping[str, Sequence[Any]], along: str
) -> tuple[list[str], list[str]]:
    """Quantities that distinguish rows of panels, and the lines within a panel."""
    of_lines, of_rows = [name for name in values if name != along], []
    while len(of_lines) > 1 and len(_grouped(values, of_lines)) > _MOST_LINES:
        of_rows.append(of_lines.pop(0))
    return of_rows, of_lines


def _grouped(
    values: Mapping[str, Sequence[Any]], names: Sequence[str]
) -> dict[str, list[int]]:
    """Numbers of the runs with equal values of some quantities, by these values."""
    groups: dict[str, list[int]] = {}
    for run in range(len(next(iter(values.values())))):
        label = ", ".join(_with_unit(name, values[name][run]) for name in names)
        groups.setdefault(label, []).append(run)
    return groups


def _draw_line(
    axes: Axes, x: np.ndarray, y: np.ndarray, done: np.ndarray, look: tuple[str, str]
) -> None:
    """Draw runs of one line in ascending order, and mark those that are not complete.

    ``y`` are figures and half-widths, shape (2, n_runs).  Runs without a state are at
    the bottom.
    """
    colour, dash = look
    order = np.argsort(x, kind="stable")
    x, (y, half), done = x[order], y[:, order], done[order]
    if np.isfinite(half).any():
        axes.errorbar(x, y, half, fmt="none", ecolor=colour, elinewidth=0.8, capsize=2)
    whole = np.where(done, y, np.nan)
    axes.plot(x, whole, "o", ls=dash, color=colour, markersize=3)
    axes.plot(x[~done], y[~done], "x", color=colour, markersize=6)
    none = x[~done & ~np.isfinite(y)]
    if none.size:
        at = axes.get_xaxis_transform()
        axes.plot(
            none, np.full_like(none, 0.04), "v", c=colour, mfc="none", transform=at
        )


def _places(values: Sequence[Any]) -> tuple[np.ndarray, dict[float, str]]:
    """Abscissas of values, and labels at few of them or at words."""
    words = list(dict.fromkeys(map(str, values)))
    x = np.array([float(words.index(str(value))) for value in values])
    numbers = all(
        isinstance(x, int | float) and not isinstance(x, bool) for x in values
    )
    if numbers:
        x = np.array(values, dtype=float)
    if numbers and len(words) > _MOST_TICKS:
        return x, {}
    return x, dict(zip(x.tolist(), map(_short, values), strict=True))


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _with_unit(name: str, value: Any) -> str:
    """Quantity and value, such as "Friction 0.2" or "Fibres 45°"."""
    words, _, unit = name.partition(" (")
    text = f"{words} {_short(value)} {unit.removesuffix(')')}".strip()
    return text.replace(" °", "°")


# Largest argument for laws without a default range or a finite domain: fibre strain,
# shear angle in radians, and curvature in 1/mm.
_STRAIN, _ANGLE, _CURVATURE = 0.02, np.radians(60.0), 0.02

_N_POINTS = 401

# Ratios of weft to warp strain for which biaxial laws are plotted.
_STRAIN_RATIOS = (-0.5, 0.0, 0.5, 1.0)

# Axis labels by the quantity of the law, and the factor from the argument of the law to
# the unit of the axis.
_AXES: dict[str | None, tuple[str, str, float]] = {
    "tension": ("fibre strain ε (-)", "tension T (N/mm)", 1.0),
    "shear": ("shear angle Γ (deg)", "shear moment (N mm/mm²)", 180.0 / np.pi),
    "bending": ("curvature κ (1/mm)", "bending moment (N mm/mm)", 1.0),
    None: (
        "fibre strain (-), shear angle (rad) or curvature (1/mm)",
        "tension or moment (N/mm, or N mm/mm in bending)",
        1.0,
    ),
}


def plot_law(
    law: Law | BiaxialLaw,
    axes: Axes | None = None,
    of: Literal["tension", "shear", "bending"] | None = None,
) -> Axes:
    """Plot the value of a law against its argument, with units.

    Parameters
    ----------
    law
        Any law. The curve of a table includes its points. For a `BiaxialLaw` use
        `plot_tensions`.
    axes
        Axes of the plot; by default, of a new pyplot figure.
    of
        Quantity of the law, which determines labels and units; by default ``law.of``.
        Without either, labels name all quantities.

    Returns
    -------
    matplotlib.axes.Axes
        Axes: fibre strain (-) and tension (N/mm), shear angle (deg) and shear moment (N
        mm/mm²), or curvature (1/mm) and bending moment (N mm/mm).

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from skfem_textile import Sin2
    >>> axes = plot_law(Sin2(0.5), Figure().subplots())
    >>> axes.get_xlabel()
    'shear angle Γ (deg)'
    """
    if isinstance(law, BiaxialLaw):
        return plot_tensions(law, axes)
    axes = _axes(axes)
    quantity = of or getattr(law, "of", None)
    x_label, y_label, unit = _AXES[quantity]
    reach = {"tension": _STRAIN, "shear": _ANGLE, "bending": _CURVATURE}
    low, high = _ends(law, reach[quantity or "shear"])
    x = np.linspace(low, high, _N_POINTS)
    with np.errstate(all="ignore"):  # gaps where values are not finite
        (line,) = axes.plot(unit * x, law.value(x))
    points = getattr(law, "points", None)
    if points is not None:
        axes.plot(unit * points[0], points[1], "o", color=line.get_color())
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.grid(alpha=0.3)
    return axes


def plot_tensions(
    law: BiaxialLaw,
    axes: Axes | None = None,
    ratios: Sequence[float] = _STRAIN_RATIOS,
) -> Axes:
    """Plot the tensions of a biaxial law for constant strain ratios.

    Parameters
    ----------
    law
        A `BiaxialLaw`.
    axes
        Axes of the plot; by default, of a new pyplot figure.
    ratios
        Ratios of weft to warp strain. Each ratio has a solid line for the warp tension
        and a dashed line for the weft tension.

    Returns
    -------
    matplotlib.axes.Axes
        Axes: warp strain (-) and tension (N/mm).
    """
    axes = _axes(axes)
    low, high = law.shown or (-_STRAIN, _STRAIN)
    x = np.linspace(low, high, _N_POINTS)
    for ratio in ratios:
        with np.errstate(all="ignore"):  # gaps where values are not finite
            warp, weft = law.value(np.array([x, ratio * x]))
        (line,) = axes.plot(x, warp, label=f"warp, weft strain {ratio:g} ε")
        axes.plot(x, weft, "--", color=line.get_color())
    axes.set(xlabel="warp strain ε (-)", ylabel="tension T (N/mm), weft dashed")
    axes.grid(alpha=0.3)
    axes.legend()
    return axes


def _axes(axes: Axes | None) -> Axes:
    """The given axes, or axes of a new figure."""
    if axes is not None:
        return axes
    from matplotlib import pyplot  # slow to import

    return pyplot.subplots(layout="constrained")[1]


def _ends(law: Law, reach: float) -> tuple[float, float]:
    """Limits of the plot: the default range, or the finite part of the domain."""
    shown = getattr(law, "shown", None)
    if shown is not None:
        return shown
    low, high = domain_of(law)
    low = low if np.isfinite(low) else min(-reach, high - 2 * reach)
    high = high if np.isfinite(high) else max(reach, low + 2 * reach)
    return low, high


# Lines by kind, distinct in grey: by their dashes and widths in points.
_LINES: dict[str, dict[str, Any]] = {
    "warp": {"color": COLOURS[0], "lw": 1.2, "ls": "-"},
    "weft": {"color": COLOURS[1], "lw": 1.2, "ls": (0, (5, 2))},
    "weak": {"color": "0.35", "lw": 0.9, "ls": (0, (1, 1.5))},
    "border": {"color": "black", "lw": 0.8, "ls": "-."},
    "held": {"color": "black", "lw": 3.5, "ls": "-"},
}
_LABELS = {
    "warp": "warp, shear angle may jump",
    "weft": "weft, shear angle may jump",
    "weak": "its derivative may jump",
    "border": "border",
    "held": "held or driven",
}

# Colour of the ply.
_PLY = "0.93"

# Largest height over the width of the picture.
_HIGHEST = 1.6


def singular_fibres(
    outline: "Outline",
    lines: "SingularFibres",
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Plot singular fibres over the outline of a ply.

    Warp is solid, weft dashed; fibres across which only the derivative of the shear
    angle may jump are dotted, and held edges thick.

    Parameters
    ----------
    outline
        The outline.
    lines
        Its singular fibres.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> import skfem_textile as st
    >>> outline = st.Outline([[0, 100, 100, 0], [0, 0, 200, 200]])
    >>> fabric = st.Fabric(1e5, 0.5, warp=(1, 1), weft=(-1, 1))
    >>> lines = st.singular_fibres(outline, fabric, {"held": st.Condition("bottom")})
    >>> axes = singular_fibres(outline, lines).axes[0]
    >>> axes.get_xlabel()
    'x (mm)'
    """
    with new_figure(filename) as figure:
        drawn = [("weak", fibre.points) for fibre in lines.weak]
        drawn += [("border", line) for line in lines.borders]
        drawn += [("held", piece) for piece in lines.held]
        drawn += [(("warp", "weft")[f.family], f.points) for f in lines.fibres]
        width = default_width(1) / 25.4
        span = np.ptp(outline.polygon, axis=1)
        height = width * float(np.clip(span[1] / span[0], 0.3, _HIGHEST)) + 0.8
        figure.set_size_inches(width, height)
        axes = figure.add_subplot()
        rings = [np.vstack([ring.T, ring.T[:1]]) for ring in outline.rings]
        ply = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(ply, facecolor=_PLY, edgecolor="black", lw=0.6))
        for kind, points in drawn:
            axes.plot(*points, solid_capstyle="butt", **_LINES[kind])
        for x, y in outline.points.values():
            axes.plot(x, y, "o", color="black", markersize=3)
        axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        kinds = [kind for kind in _LINES if kind in {k for k, _ in drawn}]
        handles = [Line2D([], [], label=_LABELS[k], **_LINES[k]) for k in kinds]
        legend_below(figure, handles, handlelength=3.5)
    return figure
