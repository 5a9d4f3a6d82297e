"""Load error of the bias extension with fibres at 30° to 60°.

``--part references`` computes and stores converged loads on fibre-aligned meshes.  The
other parts compare the default formulation on irregular meshes with them.
"""

import argparse
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, TypeAlias

import numpy as np

from ..common.figures import File, colour_of, legend, panels_of, style_of
from ..common.tables import (
    furthest,
    markdown_table,
    median,
    percent,
)
from ..study import Part, Row, Study
from .cases import (
    ACROSS,
    ANGLES,
    CHOOSING,
    INCLINATIONS,
    JUDGING,
    LAWS,
    LIMITS,
    MESHES,
    RATIOS,
    SPECIMENS,
    Case,
    Reference,
    Specimen,
    agree,
    judged,
    limit,
    stored,
)

#: Ply, shear angle, element shape, and number of edges across.
Key: TypeAlias = tuple[Specimen, int, str, int]

#: Element shapes, and numbers of edges across.
KINDS = tuple(product(MESHES, ACROSS))

_CHECKS = "apart", "halving"

# Half-width in degrees of the horizontal offset between the lines of a panel.
_SPREAD = 3.0


def errors(rows: Sequence[Row]) -> dict[Key, list[float]]:
    """Relative load errors of the seeds."""
    by_key: dict[Key, list[float]] = {}
    for row in rows:
        mesh = row["elements"], row["across"]
        key = Specimen.of(row), row["shear_angle"], *mesh
        by_key.setdefault(key, []).append(row["load_over_reference"] - 1)
    return by_key


def summary(rows: Sequence[Row]) -> str:
    """Largest median error by inclination, and counts of medians within limits."""
    lines, all_medians = [], _medians(errors(rows))
    for inclination in INCLINATIONS:
        line = [f"{inclination:g}°"]
        for elements, across in KINDS:
            medians = {
                key: middle
                for key, middle in all_medians.items()
                if (key[0].inclination, *key[2:]) == (inclination, elements, across)
            }
            most = 100 * limit(inclination, across)
            met = f"{_n_within(medians)} of {len(medians)} within {most:g} %"
            line += [percent(furthest(medians.values())), met]
        lines.append(line)
    head = ["fibres"]
    for elements, across in KINDS:
        head += [f"{elements}, {across} across: largest median error", "met by"]
    return markdown_table(head, lines)


def in_words(converged: Sequence[Row], compared: Sequence[Row]) -> dict[str, str]:
    """The results quoted on pages, by name."""
    errors_by_key = errors(compared)
    medians = _medians(errors_by_key)
    apart = furthest(row[key] for row in converged for key in _CHECKS)
    single = furthest(error for off in errors_by_key.values() for error in off)
    words = {
        "met": f"{_n_within(medians)} of {len(medians)}",
        "single": percent(abs(single), ".1f"),
        "references": percent(abs(apart), ".2f"),
        "lost_most": percent(max(1 - row["load"] for row in converged), ".0f"),
    }
    for n in ACROSS:
        words |= {f"limit_{n}": percent(LIMITS[n], "g")}
        words |= {f"limit_steep_{n}": percent(2 * LIMITS[n], "g")}
    return words


def _medians(errors_by_key: Mapping[Key, Sequence[float]]) -> dict[Key, float]:
    """Medians of the known errors; nan if none is known."""
    return {key: median(off) for key, off in errors_by_key.items()}


def _n_within(medians: Mapping[Key, float]) -> int:
    """Number of medians within their limits."""
    return sum(
        abs(middle) <= limit(key[0].inclination, key[3])
        for key, middle in medians.items()
    )


def draw_loads(rows: Sequence[Row], file: File = None) -> Any:
    """Draw loads at the largest shear angle, a panel per element shape and mesh.

    Points are medians over the seeds; bars are ranges of the load.
    """
    from matplotlib.patches import Patch

    lines: dict[tuple[str, float], dict[str, Any]] = {
        (law, ratio): style_of(
            j,
            linestyle=("-", "--")[i],
            markerfacecolor=(colour_of(j), "white")[i],
            linewidth=1.0,
            markersize=4.5,
        )
        for i, law in enumerate(LAWS)
        for j, ratio in enumerate(RATIOS)
    }
    label, xlabel = f"Load over reference, {ANGLES[-1]}°", "Fibres to the clamps (°)"
    form: dict[str, Any] = {"sharex": True, "sharey": "row", "xlabel": xlabel}
    form |= {"titles": [*MESHES], "ylabels": [label] * len(ACROSS)}
    with panels_of((8.0, 6.4), file, 9, **form) as (figure, grid):
        for i, across in enumerate(ACROSS):
            for j, elements in enumerate(MESHES):
                _draw(grid[i, j], lines, rows, elements, across)
                grid[i, j].set_title(f"{elements}, {across} across")
        for axes in grid[-1]:
            axes.set_xticks(INCLINATIONS)
        names = (Specimen(0.0, *key).names[1:] for key in lines)
        labels = (f"{law}, E/G = {ratio}" for law, ratio in names)
        styles = dict(zip(labels, lines.values(), strict=True))
        legend(figure, styles, 4, [Patch(color="0.9", label="limit of medians")])
    return figure


def _draw(
    axes: Any, lines: Mapping, rows: Sequence[Row], elements: str, across: int
) -> None:
    for inclination in INCLINATIONS:
        sides = [inclination - _SPREAD, inclination + _SPREAD]
        widest = limit(inclination, across)
        axes.fill_between(sides, 1 - widest, 1 + widest, color="0.9")
    axes.axhline(1.0, color="grey", linewidth=0.8)
    beside = np.linspace(-_SPREAD, _SPREAD, len(lines) + 2)[1:-1]
    off = errors(rows)
    for (key, style), shift in zip(lines.items(), beside.tolist(), strict=True):
        loads = {}
        for inclination in INCLINATIONS:
            specimen = Specimen(inclination, *key)
            own = off.get((specimen, ANGLES[-1], elements, across), [])
            if known := [1 + error for error in own if np.isfinite(error)]:
                loads[inclination + shift] = known
        axes.plot(list(loads), [median(known) for known in loads.values()], **style)
        for x, known in loads.items():
            axes.vlines(x, min(known), max(known), style["color"], linewidth=0.8)
    axes.grid(alpha=0.3, axis="y")


REFERENCES = Part(
    "references.json",
    cases=("*E/G = ???",),
)
COMPARED = Part(
    "angles.csv", {"summary.md": summary}, {"angles.png": draw_loads}, ("*, seed *",)
)


class Angles(Study[Case]):
    """Reference loads, or the default formulation compared with them."""

    parts = REFERENCES, COMPARED
    sample = "45°, linear, E/G = 2e5, quads, 16 across, seed 1"

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--part",
            choices=("judging", "choosing", "references"),
            default="judging",
            help="validation of the default formulation (default), cases to choose its "
            "constants, or converged loads",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        if options.part == "references":
            return [Reference(specimen) for specimen in SPECIMENS]
        stored()  # raises early if the file is missing
        return list(judged(*(JUDGING if options.part == "judging" else CHOOSING)))

    def line(self, rows: list[Row]) -> str:
        key = "load" if REFERENCES.of(rows) else "load_over_reference"
        loads = ", ".join(f"{row[key]:.4f}" for row in rows)
        return f"{rows[0]['case']}: {loads}; {rows[-1].get('refused') or 'done'}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(REFERENCES.of(rows), COMPARED.of(rows))

    def complaint(self, rows: list[Row]) -> str:
        """Report references on which formulations or meshes do not agree."""
        doubtful = [row for row in REFERENCES.of(rows) if not agree(row)]
        if not doubtful:
            return ""
        first = self.line(doubtful[:1])
        return f"{len(doubtful)} load(s) are not converged, first: {first}"


STUDY = Angles()
