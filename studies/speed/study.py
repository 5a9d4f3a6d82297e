"""Benchmarks, each in a separate process, on one thread.

A benchmark is a function of the settings, with results in a JSON file.  Each row of the
study is a benchmark with its results.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..common import provenance
from ..common.figures import File, colour_of, panels_of
from ..common.running import in_new_process
from ..common.tables import (
    having,
    markdown_table,
    minus,
    scientific,
    span,
    table,
    thousands,
)
from ..study import Part, Row, Study, Table
from . import (
    drapes,
    needs,
    plain_forms,
    processes,
    profile,
    small_runs,
    solving,
    whole_runs,
)
from .needs import COSTS, added
from .one_ply import UNUSED
from .solving import PARTS, Settings, two_commits

#: The benchmarks by name.
BENCHMARKS: dict[str, Callable[[Settings], Row]] = {
    "needs": needs.needs,
    "modules": needs.modules,
    "iteration": solving.iteration,
    "scaling": solving.scaling,
    "factorisation": solving.factorisation,
    "profile": profile.profile,
    "small_runs": small_runs.small_runs,
    "iterative": solving.iterative,
    "petsc": processes.processes,
    "whole_strip": solving.whole_strip,
    "whole_runs": whole_runs.whole_runs,
    "plain_forms": plain_forms.plain_forms,
    "overhead": solving.overhead,
    "by_turns": solving.by_turns,
    "drapes": drapes.drapes,
}

_PICTURES = "needs.png", "needs.svg"

# Colour of changes within their scatter.
_NONE = "#bbbbbb"

# Number of unknowns to which memory and time are extrapolated.
_TARGET = 10**8

# Gap between a bar and its number, and width of a number, relative to the scale.
_GAP, _ROOM = 0.03, 0.36


def unused_table(results: Row) -> str:
    """Relative costs of features declared as zero."""
    lines = [
        [
            f"{name}: {UNUSED[name]}",
            *(len(row["further_terms"]), len(row["further_modules"])),
            *map(_share, row["shares"].values()),
        ]
        for name, row in results["unused"].items()
    ]
    head = ["declared as zero", "further terms", "further modules", *list(COSTS)[1:]]
    return markdown_table(head, lines)


def modules_table(results: Row) -> str:
    """A line for each scene."""
    lines = [
        [name, f"{row['own']} of {results['modules']}", ", ".join(row["heavy"])]
        for name, row in results["scenes"].items()
    ]
    return markdown_table(["scene", "modules of this library", "heavy packages"], lines)


def iteration_table(results: Row) -> str:
    """A line for each code."""
    lines = []
    for name, code in results["codes"].items():
        parts = [f"{1e3 * part:.0f}" for part in code["parts"]]
        if len(parts) == 2:
            parts.append("included")
        total = f"{1e3 * code['seconds']['median']:.0f}"
        lines.append([name, *parts, total, f"{code['stock_over_this']:.2f}"])
    head = ["code", "assembly", "factorisation", "solution", "all, ms", "stock / this"]
    return markdown_table(head, lines)


def scaling_table(results: Row) -> str:
    """A line for each solver and size, and its exponents."""
    lines = []
    for name, solver in results["solvers"].items():
        for row in solver["sizes"]:
            measures = [*(f"{row[n]:.3g}" for n in PARTS), f"{row['linear_solves']}"]
            peaks = [f"{row[n]:.2f}" for n in ("peak_GiB", "step_peak_GiB")]
            lines.append([name, row["elements"], *measures, *peaks])
        powers = [f"{solver['exponents'][part]:.2f}" for part in PARTS]
        lines.append([name, "exponent", *powers, "", "", ""])
    parts = [*(f"{part}, s" for part in PARTS), "solves"]
    peaks = ["peak of an iteration, GiB", "peak of the step, GiB"]
    return markdown_table(["solver", "elements", *parts, *peaks], lines)


def choice_table(results: Row) -> str:
    """Time and memory of an iteration by size, and ten times beyond the largest one.

    Times grow by their exponent between the two largest sizes, memory by n log n.
    """
    solvers = {name: x["sizes"] for name, x in results["solvers"].items()}
    first = next(iter(solvers.values()))
    sizes = [row["elements"] for row in first]
    lines = [
        [thousands(n), *(_of_iteration(rows[i]) for rows in solvers.values())]
        for i, n in enumerate(sizes)
    ]
    if len(sizes) > 1:
        beyond = [_of_iteration(_beyond(*rows[-2:])) for rows in solvers.values()]
        lines.append([f"{thousands(10 * sizes[-1])}, extrapolated", *beyond])
    return markdown_table(["quadrilaterals", *(f"{x}: s, GiB" for x in solvers)], lines)


def _of_iteration(row: Row) -> str:
    return f"{row['iteration']:.2g}, {row['peak_GiB']:.2g}"


def _beyond(small: Row, large: Row) -> Row:
    """An iteration with ten times the elements of the larger of two sizes."""
    n = small["elements"], large["elements"]
    exponent = np.log(large["iteration"] / small["iteration"]) / np.log(n[1] / n[0])
    growth = 10 * np.log(10 * n[1]) / np.log(n[1])
    time, peak = large["iteration"] * 10**exponent, large["peak_GiB"] * growth
    return {"iteration": time, "peak_GiB": peak}


def factorisation_table(results: Row) -> str:
    """A line for each solver."""
    return table(
        results["solvers"],
        {
            "solver": "{solver}",
            "set-up, s": "{set_up:.2f}",
            "definite, s": "{definite[seconds]:.2f}",
            "indefinite, s": "{indefinite[seconds]:.2f}",
            "ratio": "{ratio:.2f}",
            "negative eigenvalues": "{indefinite[negative_eigenvalues]}",
            "backward error": lambda row: scientific(
                row["indefinite"]["backward_error"], 1
            ),
            "memory, GiB": "{GiB:.2f}",
        },
    )


def profile_table(results: Row) -> str:
    """A line for each part of the program."""
    commands = results["commands"]
    parts = [profile.IMPORT, *profile.PARTS]
    lines = [
        [part, *(f"{row['seconds'].get(part, 0):.2f}" for row in commands.values())]
        for part in parts
    ]
    total = ["total", *(f"{row['total']:.2f}" for row in commands.values())]
    return markdown_table(["s", *commands], [*lines, total])


def iterative_table(results: Row) -> str:
    """A line for each mesh and stiffness."""
    if "missing" in results:
        return f"{results['missing']}\n"
    return table(
        results["sizes"],
        {
            "E/G": "{E_over_G:g}",
            "elements": "{elements}",
            "iterations": "{iterations}",
            "iterative / direct": "{iterative_over_direct:.1f}",
        },
    )


def petsc_table(results: Row) -> str:
    """A line for each mesh and number of processes."""
    if "missing" in results:
        return f"{results['missing']}\n"
    parts = {
        "set-up": "set_up",
        "factorisation": "factorisation",
        "solution": "solution",
    }
    return table(
        results["runs"],
        {
            "elements": "{elements}",
            "solver": lambda row: {"superlu": "SuperLU"}.get(row["solver"], "PETSc"),
            "processes": "{processes}",
            "difference": lambda row: (
                scientific(row["difference"], 1) if row["solver"] == "petsc" else ""
            ),
            **{f"{name}, s": f"{{seconds[{k}]:.2f}}" for name, k in parts.items()},
            **{
                f"peak after {name}, MiB": f"{{peak_MiB[{k}]:.0f}}"
                for name, k in parts.items()
            },
        },
    )


def whole_strip_table(results: Row) -> str:
    """Times of this library and of plain Newton, and their ratio."""
    ours, stock = results["own"], results["stock"]
    steps = f"scikit-fem, plain Newton, {stock['steps']} steps"
    lines = [
        ["skfem_textile, one step", f"{ours['median']:.2f}", ours["linear_solves"]],
        [steps, f"{stock['seconds']:.0f}", stock["linear_solves"]],
        ["ratio", f"{results['stock_over_own']:.0f}", ""],
    ]
    return markdown_table(["", "seconds", "linear solves"], lines)


def overhead_table(results: Row) -> str:
    """A line for each mesh."""
    shares = "assembly", "factorisation_and_solution", "rest", "every_corner_once"
    return table(
        results["sizes"],
        {
            "elements": "{elements}",
            "linear solves": "{linear_solves}",
            "s per solve": "{seconds_of_a_solve:.3f}",
            **{name.replace("_", " "): f"{{{name}:.2%}}" for name in shares},
        },
    )


def by_turns_table(results: Row) -> str:
    """A line for each formulation."""
    columns = {"linear solve with its assembly": "{formulation}"}
    return table(results["turns"], {**columns, **two_commits(results)})


def _share(share: Mapping[str, float]) -> str:
    """Median and quartiles of a fraction in per cent."""
    middle, low, high = (_signed(100 * share[x]) for x in ("median", "low", "high"))
    return f"{middle} % ({low} to {high} %)"


def _signed(share: float) -> str:
    """A number with one decimal, and its sign unless zero."""
    rounded = round(share, 1)
    return minus(f"{rounded:+.1f}") if rounded else "0.0"


def two_digits(change: float, scatter: float = 0.0) -> str:
    """A signed change; ``≈ 0`` within its scatter.

    Examples
    --------
    >>> two_digits(0.123), two_digits(-321.4), two_digits(0.1, scatter=0.2)
    ('+0.12', '−321', '≈ 0')
    """
    if abs(change) < scatter:
        return "≈ 0"
    return minus(f"{change:+.2g}" if abs(change) < 100 else f"{change:+.0f}")


def _needs_in_words(results: Row) -> dict[str, str]:
    """Costs of bending declared as zero."""
    row = results["unused"]["bending"]
    costs = {x: _share(row["shares"][x]) for x in ("memory", "assembly", "solution")}
    costs["terms"] = str(len(row["further_terms"]))
    costs["modules"] = str(len(row["further_modules"]))
    return {f"bending_unused_{name}": text for name, text in costs.items()}


def _iteration_in_words(results: Row) -> dict[str, str]:
    """Time ratios: assembly to factorisation, and other codes to this library."""
    name = "assembly over factorisation"
    shares = [x for key, x in results["ratios"].items() if key.startswith(name)]
    words = {
        name: f"{results['ratios'][key]:.1f}"
        for name, key in _OTHER_CODES.items()
        if key in results["ratios"]
    }
    if shares:
        words["assembly_over_factorisation"] = span(shares, ".2f")
    return words


# Time ratios of other codes to this library, by name on pages.
_OTHER_CODES = {
    "dolfinx_over_required": "DOLFINx over skfem_textile, required",
    "dolfinx_over_cholmod": "DOLFINx over skfem_textile, cholmod",
    "felupe_over_cholmod": "FElupe with Pardiso over skfem_textile, cholmod",
}


def _whole_strip_in_words(results: Row) -> dict[str, str]:
    """Time ratio."""
    return {"strip_ratio": f"{results['stock_over_own']:.0f}"}


def _scaling_in_words(results: Row) -> dict[str, str]:
    """The largest mesh with the required solver: unknowns and memory."""
    last = results["solvers"]["rslab"]["sizes"][-1]
    growth = _TARGET / last["unknowns"]
    return {
        "extrapolated_peak": _rounded(last["peak_GiB"] * growth, "GiB"),
        "extrapolated_factorisation": _rounded(
            last["factorisation"] * growth**1.5 / 60, "min"
        ),
        "largest_unknowns": thousands(last["unknowns"]),
        "largest_peak": f"{last['peak_GiB']:.1f} GiB",
    }


def _iterative_in_words(results: Row) -> dict[str, str]:
    """Time ratios of conjugate gradients to the direct solver."""
    every = results["sizes"]
    stiff = max((row["E_over_G"] for row in every), default=0.0)
    ratios = [row["iterative_over_direct"] for row in having(every, E_over_G=stiff)]
    return {"iterative_ratios": span(ratios, ".0f")} if ratios else {}


def _rounded(value: float, unit: str) -> str:
    """A value with two digits."""
    return f"{thousands(round(float(f'{value:.2g}')))} {unit}"


_WORDS: dict[str, Callable[[Row], dict[str, str]]] = {
    "needs": _needs_in_words,
    "iteration": _iteration_in_words,
    "whole_strip": _whole_strip_in_words,
    "scaling": _scaling_in_words,
    "iterative": _iterative_in_words,
    "plain_forms": plain_forms.in_words,
    "drapes": drapes.in_words,
}


def draw_needs(rows: Sequence[Row], file: File = None) -> Any:
    """Draw the increment of each cost by each feature."""
    adds = added(rows[0])
    costs = {
        f"{cost.capitalize()}, {unit}": [x.get(cost, (0.0, 0.0)) for x in adds.values()]
        for cost, unit in COSTS.items()
    }
    return draw_waterfall(costs, list(adds), file)


def draw_waterfall(
    costs: Mapping[str, Sequence[tuple[float, float]]],
    names: Sequence[str],
    file: File = None,
) -> Any:
    """Draw a panel for each cost; bars extend from the cost without to with a feature.

    Parameters
    ----------
    costs
        Increments and scatter by panel title.  A change within its scatter is grey.
    names
        Feature names, from the top.
    file
        File of the figure.
    """
    with panels_of((6.3, 2.9), file, 8, [*costs], sharey=True) as (figure, grid):
        for axes, (title, changes) in zip(grid[0], costs.items(), strict=True):
            axes.set_title(title, fontsize=8)
            _draw_panel(axes, changes)
        grid[0, 0].set_yticks(range(len(names)), names)
        grid[0, 0].invert_yaxis()
    return figure


def _draw_panel(axes: Any, changes: Sequence[tuple[float, float]]) -> None:
    from matplotlib.ticker import MaxNLocator

    totals = [sum(change for change, _ in changes[:i]) for i in range(len(changes) + 1)]
    scale = max(totals)
    for row, (change, scatter) in enumerate(changes):
        if not change:
            continue
        before, after = totals[row], totals[row + 1]
        none = row > 0 and abs(change) < scatter
        colour = _NONE if none else colour_of(0 if change > 0 else 1)
        axes.barh(row, change, left=before, color=colour)
        if row + 1 < len(changes):
            axes.plot([after] * 2, [row - 0.4, row + 1.4], color="grey", linewidth=0.5)
        low, high = sorted((before / scale, after / scale))
        position, ha, more = (low + high) / 2, "center", {"color": "white"}
        if 1 - high >= _ROOM:  # right of the bar, left of it, or inside
            position, ha, more = high + _GAP, "left", {}
        elif low >= _ROOM:
            position, ha, more = low - _GAP, "right", {}
        text = two_digits(change, scatter if row else 0.0)
        axes.text(position * scale, row, text, ha=ha, va="center", fontsize=7, **more)
    axes.set_xlim(0, 1.05 * scale)
    axes.xaxis.set_major_locator(MaxNLocator(2))
    axes.tick_params(axis="y", length=0)


@dataclass(frozen=True)
class Benchmark:
    """A benchmark with its settings."""

    name: str
    settings: Settings

    def __str__(self) -> str:
        return self.name

    def rows(self) -> list[Row]:
        """Results of the benchmark and its machine, as one row."""
        results = in_new_process(BENCHMARKS[self.name], self.settings)
        return [{"case": self.name, "machine": provenance.machine(), **results}]


def _of_row(function: Callable[[Row], str]) -> Table:
    """A table of the single row of a benchmark."""
    return lambda rows: function(rows[0])


#: Table functions of each benchmark by file name.
TABLES: dict[str, dict[str, Callable[[Row], str]]] = {
    "needs": {"unused.md": unused_table},
    "modules": {"modules.md": modules_table},
    "iteration": {"iteration.md": iteration_table},
    "scaling": {"scaling.md": scaling_table, "choice.md": choice_table},
    "factorisation": {"factorisation.md": factorisation_table},
    "profile": {"profile.md": profile_table},
    "small_runs": {"small_runs.md": small_runs.small_runs_table},
    "iterative": {"iterative.md": iterative_table},
    "petsc": {"petsc.md": petsc_table},
    "whole_strip": {"whole_strip.md": whole_strip_table},
    "whole_runs": {"whole_runs.md": whole_runs.whole_runs_table},
    "plain_forms": {"plain_forms.md": plain_forms.plain_forms_table},
    "overhead": {"overhead.md": overhead_table},
    "by_turns": {"by_turns.md": by_turns_table},
    "drapes": {"drapes.md": drapes.drapes_table},
}


class Speed(Study[Benchmark]):
    """All benchmarks."""

    parts = tuple(
        Part(
            f"{name}.json",
            {file: _of_row(function) for file, function in tables.items()},
            dict.fromkeys(_PICTURES, draw_needs) if name == "needs" else {},
            cases=(name,),
        )
        for name, tables in TABLES.items()
    )
    timed = True

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        defaults = Settings()
        add = parser.add_argument
        add(
            "--most", type=int, default=defaults.most, help="maximum number of elements"
        )
        add("--solver", default=defaults.solver, help="for whole_strip")
        add("--before", type=Path, metavar="DIR", help="first checkout of two")
        add("--after", type=Path, metavar="DIR", help="second checkout of two")

    def cases(self, options: argparse.Namespace) -> list[Benchmark]:
        settings = Settings(*(getattr(options, name) for name in Settings._fields))
        compared = options.before and options.after
        two = "by_turns", "drapes"
        names = [name for name in BENCHMARKS if name not in two or compared]
        return [Benchmark(name, settings) for name in names]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        texts = self.tables(rows).items()
        return "\n".join(
            [f"{row['case']}:", *(x for name, x in texts if ".md" in name)]
        )

    def figures(self, rows: list[Row]) -> dict[str, str]:
        words: dict[str, str] = {}
        for row in rows:
            if row["case"] in _WORDS:
                words |= _WORDS[row["case"]](row)
        return words


STUDY = Speed()
