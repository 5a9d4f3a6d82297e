"""Effect of the constants of the solver, tools, outlines and nets.

Each numeric constant of a module is replaced by a quarter, half, twice and four times
its value in scenes of a fraction of a second, if these execute a line that reads it.
Compared with the unchanged run are the outcome, the linear solves and a few figures.
Values computed from a constant when its module is loaded do not change with it.
"""

import argparse
import re
import signal
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from types import FrameType
from typing import NamedTuple

from ..common.running import warnings_collected
from ..common.tables import grouped, having, markdown_table
from ..study import Part, Row, Study
from .replacing import Constant, constants, forget, read_by, replaced, users
from .scenes import SCENES, Scene

#: Packages of each subsystem.
PACKAGES = {
    "solve": ("solve", "ply", "forms"),
    "contact": ("contact",),
    "outlines": ("outlines",),
    "nets": ("nets", "surfaces"),
}

FACTORS = (0.25, 0.5, 2.0, 4.0)

# Processor time in seconds after which a scene ends, and relative change of a figure
# below which it is the tolerance of equilibrium.
_LONGEST, _SAME = 12.0, 1e-6

# Length of the text of an outcome, and most lines of a table.
_LENGTH, _LINES = 100, 30


class _TooLongError(BaseException):
    """Raised after `_LONGEST`; a base exception, which the package does not catch."""


class End(NamedTuple):
    """Error and warnings without their numbers, linear solves and figures of a run."""

    text: str
    solves: int
    figures: Mapping[str, float]


def ended(scene: Scene) -> End:
    """Run a scene."""

    def too_long(signum: int, frame: FrameType | None) -> None:
        raise _TooLongError

    forget()
    solves, error = 0, list[str]()
    figures: Mapping[str, float] = {}
    before = signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, _LONGEST)
    try:
        with warnings_collected() as texts, warnings.catch_warnings(action="ignore"):
            solves, figures = scene.run()
    except _TooLongError:
        error = ["takes too long"]
    except Exception as raised:
        error = [f"{type(raised).__name__}: {raised}"]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    # A worker process begins messages with the name of the case.
    own = {re.sub(r"^\w+(\.\w+)+: ", "", text) for text in texts}
    text = "; ".join(error or sorted(own))
    return End(re.sub(r"-?\d[\d.e×+-]*", "#", text)[:_LENGTH], solves, figures)


@cache
def unchanged(scene: Scene) -> tuple[End, frozenset[tuple[str, str]]]:
    """End of the unchanged run, and the names that it reads."""
    ended(scene)  # loads all modules
    read = read_by(lambda: ended(scene))
    return ended(scene), read


@dataclass(frozen=True)
class Case:
    """A constant of a subsystem."""

    subsystem: str
    constant: Constant

    def __str__(self) -> str:
        return str(self.constant)

    def rows(self) -> list[Row]:
        """A row for each factor; one without a factor if no scene reads the value."""
        constant, value = self.constant, self.constant.value
        head: Row = {
            "case": str(self),
            "subsystem": self.subsystem,
            "value": value if isinstance(value, int | float) else str(value),
            "meaning": constant.meaning,
        }
        reading = [scene for scene in SCENES[self.subsystem] if self._reads(scene)]
        if not reading:
            return [head | {"factor": None}]
        return [
            head | {"factor": factor, **self._changes(factor, reading)}
            for factor in FACTORS
            if constant.times(factor) != constant.value
        ]

    def _reads(self, scene: Scene) -> bool:
        if not self.constant.module.startswith(scene.of):
            return False
        _, read = unchanged(scene)
        return any((user, self.constant.name) in read for user in users(self.constant))

    def _changes(self, factor: float, scenes: Sequence[Scene]) -> Row:
        """Scenes with another outcome, and the largest changes in the others."""
        outcomes, solves, change, of = [], 1.0, 0.0, ""
        for scene in scenes:
            known, _ = unchanged(scene)
            with replaced(self.constant, self.constant.times(factor)):
                end = ended(scene)
            if end.text != known.text:
                outcomes.append(f"{scene.name}: {end.text or 'no warning'}")
            if not end.figures:
                continue
            ratio = end.solves / known.solves if known.solves else 1.0
            solves = max(solves, ratio, key=lambda x: max(x, 1 / x))
            off, figure = _largest_change(end.figures, known.figures)
            if off > change:
                change, of = off, f"{scene.name}: {figure}"
        return {
            "outcomes": " | ".join(outcomes),
            "solves": round(solves, 3),
            "change": float(f"{change:.2g}") if change > _SAME else 0.0,
            "of": of if change > _SAME else "",
        }


def _largest_change(
    figures: Mapping[str, float], known: Mapping[str, float]
) -> tuple[float, str]:
    """Largest relative change of a figure, and its name."""
    return max(
        (abs(figures.get(key, 0.0) - x) / abs(x), key) for key, x in known.items()
    )


def _is_same(row: Row) -> bool:
    return not row["outcomes"] and row["solves"] == 1 and not row["change"]


def effects(rows: Sequence[Row], subsystem: str) -> str:
    """A line for each constant that changes a scene, and the names of the others."""
    cases = grouped(having(rows, subsystem=subsystem), "case")
    lines = []
    without: dict[str, list[str]] = {"Without an effect": [], "Not read": []}
    for name, of in cases.items():
        if of[0]["factor"] is None:
            without["Not read"].append(f"`{name}`")
        elif all(map(_is_same, of)):
            without["Without an effect"].append(f"`{name}`")
        else:
            cells = {row["factor"]: _cell(row) for row in of}
            meaning = of[0]["meaning"].replace("|", "\\|")
            first = [f"`{name}`", of[0]["value"], meaning]
            lines.append([*first, *(cells.get(factor, "-") for factor in FACTORS)])
    head = ["constant", "value", "meaning", *(f"× {factor:g}" for factor in FACTORS)]
    listed = [f"{k}: {', '.join(names)}." for k, names in without.items() if names]
    starts = range(0, len(lines), _LINES)
    tables = (markdown_table(head, lines[i : i + _LINES]) for i in starts)
    return "\n".join([*tables, *(f"{text}\n" for text in listed)])


def _cell(row: Row) -> str:
    """Compact text of a row, such as ``solves × 1.4, 2.0 % of strip: energy``."""
    if _is_same(row):
        return "="
    parts = [_brief(text) for text in (row["outcomes"] or "").split(" | ") if text]
    if row["solves"] != 1:
        parts.append(f"solves × {row['solves']:.2g}")
    if row["change"]:
        change = float(f"{100 * row['change']:.2g}")
        parts.append(f"{change:g} % of {row['of']}")
    return ", ".join(parts).replace("|", "/")


def _brief(outcome: str) -> str:
    """Name of the scene, and whether it fails, warns, or warns no more."""
    scene, _, text = outcome.partition(": ")
    if text in ("no warning", "takes too long"):
        return f"{scene} {text}"
    failed = re.match(r"\w+(Error|Exception)\b", text)
    return f"{scene} {'fails' if failed else 'warns'}"


class Constants(Study[Case]):
    """All numeric constants of the subsystems."""

    parts = (
        Part(
            "constants.csv",
            {f"{name}.md": partial(effects, subsystem=name) for name in PACKAGES},
        ),
    )
    shown = "× {factor}: solves × {solves}, {change} of {of}, {outcomes}"
    sample = "outlines.net._SHORTEST"

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return [
            Case(subsystem, constant)
            for subsystem, folders in PACKAGES.items()
            for constant in constants(folders)
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        cases = grouped(rows, "case").values()
        read = [of for of in cases if of[0]["factor"] is not None]
        same = [of for of in read if all(map(_is_same, of))]
        return {
            "constants": str(len(cases)),
            "read": str(len(read)),
            "same": str(len(same)),
        }


STUDY = Constants()
