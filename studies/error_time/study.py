"""Error against run time for this library and other codes.

All formulations and other codes load two scenes on successively finer meshes.  Run
times are from mesh and fabric in memory to full load, after one warm-up run.
"""

import argparse
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from ..common.figures import (
    PAGE,
    File,
    colour_of,
    figure_of,
    legend,
    panels_of,
    plain_numbers,
    style_of,
)
from ..common.tables import cell, csv_table, having, markdown_table, percent
from ..study import Part, Row, Study
from .cases import (
    CELLS,
    CODE,
    FORMULATIONS,
    LONG,
    PATIENCE,
    Reference,
    ThisLibrary,
    Timed,
    all_cases,
    converged,
    extrapolated,
)
from .fronts import (
    CRITERIA,
    SETS,
    Comparison,
    Criterion,
    Fronts,
    Point,
    Spread,
    compared,
    fastest,
    fronts,
    methods,
)
from .fronts import ratios as ratios_by_error

# Codes in the order of their colours, their names in figures, and labels of sets of
# solvers.
_CODES = (ThisLibrary.code, "scikit-fem", "FElupe", "DOLFINx", "scikit-fem-native")
_NAMES = {
    ThisLibrary.code: "this library",
    "scikit-fem": "scikit-fem (NumPy)",
    "scikit-fem-native": "scikit-fem (C++)",
}
_SET_NAMES = {"required": "required packages", "fastest": "fastest solvers"}

# Font size in points.
_LETTERS = 9

# Largest errors shown in figures.
_MOST = {"angle": 2.0, "force": 100.0, "load": 1.0}


def ratios(rows: Sequence[Row]) -> str:
    """The fastest element and mesh of this library and of other codes, by error."""
    lines = []
    for criterion in CRITERIA.values():
        by_code, required = (
            fronts(rows, criterion, solvers) for solvers in ("fastest", "required")
        )
        for error in criterion.levels:
            pair = compared(by_code, error)
            shares = pair.ratio, pair.solves, pair.per_solve
            lines.append(
                [
                    *(criterion.label, criterion.text(error)),
                    *(_point(pair.own, criterion), _point(pair.other, criterion, True)),
                    *map(factor_text, (*shares, compared(required, error).ratio)),
                ]
            )
    head = [
        *("criterion", "error at most", "skfem_textile", "fastest other", "time ratio"),
        *("= ratio of solves", "× ratio of times per solve", "with required packages"),
    ]
    return markdown_table(head, lines)


def codes(rows: Sequence[Row]) -> Iterator[Row]:
    """The fastest element and mesh of each code at each error of each criterion."""
    for (name, criterion), solvers in product(CRITERIA.items(), SETS):
        by_code = fronts(rows, criterion, solvers)
        for error, code in product(criterion.levels, by_code):
            point, this_library = (
                fastest(by_code.get(who, []), error) for who in (code, ThisLibrary.code)
            )
            pair = Comparison(this_library, point)
            yield {
                "criterion": name,
                "error_at_most": error,
                "solvers": solvers,
                **(_columns(point) if point else {"code": code}),
                "time_over_ours": pair.ratio,
                "solves_over_ours": pair.solves,
                "time_per_solve_over_ours": pair.per_solve,
            }


def meshes(rows: Sequence[Row]) -> Iterator[Row]:
    """Medians and ranges over the seeds on each mesh, for each criterion."""
    for name, criterion in CRITERIA.items():
        for series in methods(rows, criterion).values():
            for point in series:
                yield {"criterion": name} | _columns(point)


def elements(rows: Sequence[Row]) -> str:
    """The time of each element to reach the middle error of each criterion.

    If an element does not reach it, its finest mesh is given.
    """
    known = [(methods(rows, criterion), criterion) for criterion in CRITERIA.values()]
    order = dict.fromkeys(method for series, _ in known for method in series)
    lines = [
        [
            *(f"**{code}**" if code == ThisLibrary.code else code, element),
            *(_to_the_error(by.get((code, element, solver)), of) for by, of in known),
        ]
        for code, element, solver in order
        if solver in SETS["fastest"]
    ]
    head = [f"{c.label}: {c.text(c.levels[1])}" for c in CRITERIA.values()]
    return markdown_table(["code", "element", *head], lines)


def reference(rows: Sequence[Row]) -> str:
    """Loads on fibre-aligned meshes, and their extrapolation."""
    known = {
        (row["element"], row["across"]): row["load"] for row in having(rows, code=CODE)
    }
    lines = []
    for element in FORMULATIONS:
        loads = [known[element, n] for n in CELLS if (element, n) in known]
        end = f"{extrapolated(loads):.4f}" if len(loads) == len(CELLS) else "-"
        cells = [
            f"{known[element, n]:.4f}" if (element, n) in known else "-" for n in CELLS
        ]
        lines.append([f"`{element}`", *cells, end])
    head = ["load, N", *(f"{n} cells" for n in CELLS), "extrapolated"]
    return markdown_table(head, lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Results for prose; see `ErrorTime.figures`."""
    seeds = {row["seed"] for row in rows if row.get("seed") is not None}
    words = {
        "seeds": str(len(seeds)),
        "long": f"{LONG:g} s",
        "patience": f"{PATIENCE:g} s",
    }
    if end := converged(rows):
        words |= {
            "reference": f"{end.load:.2f} N",
            "reference_uncertainty": percent(end.uncertainty / end.load, ".1g"),
            "inextensible": f"{end.inextensible:.2f} N",
        }
    for name in ("angle", "load"):
        criterion = CRITERIA[name]
        by_code = fronts(rows, criterion, "required")
        for error in criterion.levels:
            key, pair = f"{name}_{criterion.number(error)}", compared(by_code, error)
            alone = pair.own and not pair.other
            words[f"{key}_ratio"] = "not reached" if alone else factor_text(pair.ratio)
            if pair.other:
                words[f"{key}_other_code"] = pair.other.code
    return words


def _columns(point: Point) -> dict[str, Any]:
    return {
        "code": point.code,
        "element": point.element,
        "solver": point.solver,
        "across": point.across,
        "seeds": point.seeds,
        "steps": point.steps,
        "linear_solves": point.solves,
        **_spread("error", point.error),
        **_spread("error_here_and_finer", point.worst),
        **_spread("seconds", point.seconds),
    }


def _spread(name: str, spread: Spread) -> dict[str, float]:
    return {
        name: spread.median,
        f"{name}_least": spread.least,
        f"{name}_most": spread.most,
    }


def _point(point: Point | None, criterion: Criterion, named: bool = False) -> str:
    """Element, mesh, error and time: medians."""
    if point is None:
        return "none"
    code = f"{point.code}, " if named else ""
    error, seconds = criterion.text(point.error.median), f"{point.seconds.median:.2g} s"
    return f"{code}{point.element}, {point.mesh}: {error}, {seconds}"


def _to_the_error(series: Sequence[Point] | None, criterion: Criterion) -> str:
    if series is None:
        return "-"
    times = [p for p in series if p.within <= criterion.levels[1]]
    if times:
        best = min(times, key=lambda point: point.seconds.median)
        return f"{best.seconds.median:.2g} s, {best.mesh}"
    if not series:
        return "no result"
    last = series[-1]
    return f"not reached: {criterion.text(last.error.median)} at {last.mesh}"


def factor_text(value: float | None) -> str:
    """A ratio with two digits, or as an integer; ``-`` if it is unknown."""
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def draw_fronts(rows: Sequence[Row], file: File = None) -> Any:
    """The Pareto front of each code with the fastest solvers, for two criteria.

    Lines connect medians; bars are ranges over the seeds.  A grey band is the
    uncertainty of the reference; errors below it are open markers at its edge.
    """
    with figure_of((PAGE, 3.3), file, _LETTERS) as figure:
        for axes, name in zip(figure.subplots(1, 2), ("angle", "load"), strict=True):
            end = converged(rows) if name == "load" else None
            floor = end.uncertainty / end.load if end else 0.0
            known = fronts(rows, CRITERIA[name], "fastest")
            _draw_front(axes, known, CRITERIA[name], _MOST[name], floor)
    return figure


def _draw_front(
    axes: Any, by_code: Fronts, criterion: Criterion, most: float, floor: float
) -> None:
    ends, floor = [], criterion.factor * floor
    for code, front in by_code.items():
        visible = [point for point in front if point.within <= most]
        if not visible:
            continue
        colour, thick = _line_style(code)
        x = np.array([point.seconds for point in visible])
        y = criterion.factor * np.array([point.worst for point in visible])
        clear = y[:, 0] > floor
        y = np.maximum(y, floor)
        axes.plot(x[:, 0], y[:, 0], color=colour, linewidth=thick, zorder=3)
        for filled, chosen in ((colour, clear), ("white", ~clear)):
            style = {"color": colour, "markerfacecolor": filled, "markersize": 3.5}
            axes.plot(x[chosen, 0], y[chosen, 0], "o", zorder=4, **style)
        bars = [np.abs(values[:, 1:] - values[:, :1]).T for values in (x, y)]
        style = {"fmt": "none", "ecolor": colour, "elinewidth": 0.8, "alpha": 0.5}
        axes.errorbar(x[:, 0], y[:, 0], xerr=bars[0], yerr=bars[1], **style)
        ends.append((code, x[-1, 0], y[-1, 0], colour))
    _frame(axes, criterion, "run time (s)")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high)
    if floor > low:
        axes.axhspan(low, floor, color="0.85", zorder=0)
    _label_ends(axes, ends)


def _label_ends(axes: Any, ends: Sequence[tuple[str, float, float, str]]) -> None:
    """Write names at the ends of lines, without overlap."""
    low, high = np.log(axes.get_ylim())
    ends = sorted(ends, key=lambda end: end[2])
    wanted = [(np.log(y) - low) / (high - low) for _, _, y, _ in ends]
    at = _apart(wanted, 0.075)  # text height over axes height
    for i, (code, x, y, colour) in enumerate(ends):
        axes.annotate(
            _NAMES.get(code, code),
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
    """Ascending positions near the wanted ones, with a minimum spacing.

    Examples
    --------
    >>> _apart([0.0, 0.5, 0.5], 0.25)
    [0.0, 0.375, 0.625]
    """
    blocks: list[list[float]] = []  # positions minus minimum offsets
    for i, position in enumerate(wanted):
        blocks.append([position - i * least])
        while len(blocks) > 1 and np.mean(blocks[-2]) > np.mean(blocks[-1]):
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    centres = [float(np.mean(block)) for block in blocks for _ in block]
    return [position + i * least for i, position in enumerate(centres)]


def draw_ratios(rows: Sequence[Row], file: File = None) -> Any:
    """Draw the time ratio of the fastest other code to this library against the error.

    Panels are criteria, lines are sets of solvers.  Below one the other code is faster.
    A line ends at the smallest error reached by a timed run of another code.
    """
    form: dict[str, Any] = {
        "titles": [""] * len(CRITERIA),
        "ylabels": ["time, other over this library"],
    }
    with panels_of((PAGE, 2.8), file, _LETTERS, **form, sharey=True) as (figure, grid):
        for axes, (name, criterion) in zip(grid[0], CRITERIA.items(), strict=True):
            for i, solvers in enumerate(SETS):
                known = ratios_by_error(fronts(rows, criterion, solvers))
                visible = [pair for pair in known if pair[0] <= _MOST[name]]
                if not visible:
                    continue
                error, ratio = np.array(visible).T
                error, colour = criterion.factor * error, colour_of(i)
                axes.step(error, ratio, where="pre", color=colour)
                axes.plot(error[-1], ratio[-1], "o", color=colour, markersize=3)
            axes.axhline(1, color="0.4", linewidth=0.8)
            _frame(axes, criterion, f"error ({criterion.unit})")
            axes.invert_xaxis()
        first = grid[0, 0]
        for i, words in enumerate(_SET_NAMES.values()):
            anchor = {"transform": first.transAxes, "va": "center"}
            first.text(0.04, 0.94 - 0.1 * i, words, color=colour_of(i), **anchor)
    return figure


def draw_elements(rows: Sequence[Row], name: str, file: File = None) -> Any:
    """Draw median errors against median times, with the fastest solvers.

    Colours are codes, markers are elements.  ``name`` is the name of a criterion.
    Errors much larger than on the fronts are omitted.
    """
    criterion = CRITERIA[name]
    with figure_of((PAGE, 4.4), file, _LETTERS) as figure:
        axes = figure.subplots()
        known = {
            method: [x for x in series if x.error.median <= 10 * _MOST[name]]
            for method, series in methods(rows, criterion).items()
            if method[2] in SETS["fastest"]
        }
        elements = dict.fromkeys(element for _, element, _ in known)
        markers = {x: style_of(i)["marker"] for i, x in enumerate(elements)}
        for (code, element, _), series in known.items():
            colour, thick = _line_style(code)
            times = [point.seconds.median for point in series]
            errors = [criterion.factor * point.error.median for point in series]
            style = {"color": colour, "linewidth": thick / 2, "markersize": 3.5}
            axes.plot(times, errors, marker=markers[element], **style)
        _frame(axes, criterion, "run time (s)")
        styles: dict[str, dict[str, Any]] = {
            _NAMES.get(code, code): {"color": _line_style(code)[0]}
            for code, _, _ in known
        }
        for element, marker in markers.items():
            styles[element] = {"color": "0.3", "linestyle": "", "marker": marker}
        legend(figure, styles, 4)
    return figure


def _frame(axes: Any, criterion: Criterion, xlabel: str) -> None:
    """Set logarithmic axes with plain numbers, a grid and the criterion as title."""
    axes.set(xscale="log", yscale="log", xlabel=xlabel)
    plain_numbers(axes, ".12g")
    scene, _, error = criterion.label.partition(", ")
    title = f"{scene.capitalize()}:\n{error} ({criterion.unit})"
    axes.set_title(title, fontsize=_LETTERS, loc="left")
    axes.grid(alpha=0.25, linewidth=0.5)


def _line_style(code: str) -> tuple[str, float]:
    """Colour and width of the line of a code."""
    return colour_of(_CODES.index(code)), 2.0 if code == ThisLibrary.code else 1.2


class ErrorTime(Study[Timed | Reference]):
    """All codes on both scenes, and the converged load of one scene."""

    parts = (
        Part(
            "error_time.csv",
            {
                "meshes.csv": lambda rows: csv_table([*meshes(rows)]),
                "codes.csv": lambda rows: csv_table([*codes(rows)]),
                "ratios.md": ratios,
                "elements.md": elements,
                "reference.md": reference,
            },
            {
                **{f"fronts.{x}": draw_fronts for x in ("png", "svg")},
                **{f"ratios.{x}": draw_ratios for x in ("png", "svg")},
                "strip.png": lambda rows, file: draw_elements(rows, "angle", file),
                "bias_extension.png": (
                    lambda rows, file: draw_elements(rows, "load", file)
                ),
            },
        ),
    )
    folder = "error-time"
    timed = True
    sample = "reference, Quadratic(), 8 cells"

    def cases(self, options: argparse.Namespace) -> list[Timed | Reference]:
        return all_cases()

    def line(self, rows: list[Row]) -> str:
        result = "{seconds:.3g} s, load {load:.5g} N"
        return "\n".join(
            f"{row['case']}, {row['across']} across: "
            f"{row.get('note') or cell(row, result)}"
            for row in rows
        )

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Formatted results.

        ``CRITERION_ERROR_ratio`` is the ratio of times of the fastest other code, named
        by ``CRITERION_ERROR_other_code``, and this library with required solvers.
        """
        return in_words(rows)


STUDY = ErrorTime()
