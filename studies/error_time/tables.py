"""Tables of the study of error against time, and its results in words."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

from ..common.tables import csv_table, markdown_table
from ..study import Row
from .fronts import (
    CRITERIA,
    SETS,
    Comparison,
    Criterion,
    Point,
    Spread,
    compared,
    fastest,
    fronts,
    methods,
    pairs,
)
from .reference import CELLS, CODE, FORMULATIONS, converged, extrapolated
from .timed_codes import GIVEN_UP, LONG, PATIENCE, ThisLibrary

#: Scenes as tables name them.
SCENES = {"strip": "strip", "bias_extension": "bias extension"}


def tables(rows: Sequence[Row]) -> dict[str, str]:
    """The text of each file by its name."""
    return {
        "error_time.csv": csv_table(rows),
        "meshes.csv": csv_table([*meshes(rows)]),
        "codes.csv": csv_table([*codes(rows)]),
        "ratios.md": ratios(rows),
        "elements.md": elements(rows),
        "same_mesh.md": same_mesh(rows),
        "reference.md": reference(rows),
        "failed.md": failed(rows),
    }


def ratios(rows: Sequence[Row]) -> str:
    """The fastest element and mesh of this library and of others, by error."""
    lines = []
    for criterion, solvers in product(CRITERIA.values(), SETS):
        by_code = fronts(rows, criterion, solvers)
        for error in criterion.levels:
            pair = compared(by_code, error)
            shares = pair.ratio, pair.solves, pair.per_solve
            lines.append(
                [
                    *(criterion.label, criterion.text(error), solvers),
                    *(_point(pair.own, criterion), _point(pair.other, criterion, True)),
                    *map(_factor, shares),
                ]
            )
    head = [
        *("criterion", "error at most", "solvers", "skfem_textile", "fastest other"),
        *("time ratio", "= ratio of solves", "× ratio of time per solve"),
    ]
    return markdown_table(head, lines)


def codes(rows: Sequence[Row]) -> Iterator[Row]:
    """Every code at each error of each criterion, with its fastest element and mesh."""
    for (name, criterion), solvers in product(CRITERIA.items(), SETS):
        by_code = fronts(rows, criterion, solvers)
        for error, code in product(criterion.levels, by_code):
            point, own = (
                fastest(by_code.get(who, []), error) for who in (code, ThisLibrary.code)
            )
            pair = Comparison(own, point)
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
    """Medians and ranges over the seeds on every mesh, for each criterion."""
    for name, criterion in CRITERIA.items():
        for series in methods(rows, criterion).values():
            for point in series:
                yield {"criterion": name} | _columns(point)


def elements(rows: Sequence[Row]) -> str:
    """The time of every element to the middle error of each criterion.

    An element that does not reach it has its finest mesh.
    """
    lines = [
        [_bold(code), element, *cells.values()]
        for (code, element), cells in _to_errors(rows).items()
    ]
    head = [f"{c.label}: {c.text(c.levels[1])}" for c in CRITERIA.values()]
    return markdown_table(["code", "element", *head], lines)


def _to_errors(rows: Sequence[Row]) -> dict[tuple[str, str], dict[str, str]]:
    """What `elements` says of each code and element, by the name of a criterion."""
    known = {name: methods(rows, criterion) for name, criterion in CRITERIA.items()}
    order = dict.fromkeys(method for series in known.values() for method in series)
    return {
        (code, element): {
            name: _to_the_error(known[name].get((code, element, solver)), criterion)
            for name, criterion in CRITERIA.items()
        }
        for code, element, solver in order
        if solver in SETS["fastest"] or "refined" in element
    }


def same_mesh(rows: Sequence[Row]) -> str:
    """Other codes over this library with the same element on the same mesh."""
    lines = []
    for scene, by_set in pairs(rows):
        one = by_set["SciPy"]
        assert one.own
        assert one.other
        lines.append(
            [
                *(SCENES[scene], one.own.element, one.other.code, one.own.across),
                f"{one.other.solves:g} : {one.own.solves:g}",
                *(_factor(by_set[name].per_solve) for name in SETS),
                *(_factor(by_set[name].ratio) for name in SETS),
            ]
        )
    head = [
        *("scene", "element", "code", "across", "solves : ours"),
        *(f"time per solve over ours, {name}" for name in SETS),
        *(f"time over ours, {name}" for name in SETS),
    ]
    return markdown_table(head, lines)


def reference(rows: Sequence[Row]) -> str:
    """The loads on the meshes along the fibres, and their extrapolation."""
    known = {(r["element"], r["across"]): r["load"] for r in rows if r["code"] == CODE}
    lines = []
    for element in FORMULATIONS:
        loads = [known.get((element, n)) for n in CELLS]
        there = [load for load in loads if load is not None]
        end = f"{extrapolated(there):.4f}" if len(there) == len(CELLS) else "-"
        cells = ["-" if load is None else f"{load:.4f}" for load in loads]
        lines.append([f"`{element}`", *cells, end])
    head = ["load, N", *(f"{n} cells" for n in CELLS), "extrapolated"]
    return markdown_table(head, lines)


def failed(rows: Sequence[Row]) -> str:
    """The runs without a result: scene, code, element, solver, meshes and seeds."""
    by: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if note := row.get("note"):
            why = note if not row["across"] else "failed"
            why = GIVEN_UP if GIVEN_UP in note else why
            method = SCENES[row["scene"]], row["code"], row["element"], row["solver"]
            by.setdefault((*method, why), []).append(row)
    lines = []
    for key, runs in by.items():
        across = sorted({run["across"] for run in runs if run["across"]})
        seeds = len({run["seed"] for run in runs})
        lines.append([*key, ", ".join(map(str, across)) or "-", seeds])
    head = ["scene", "code", "element", "solver", "result", "across", "seeds"]
    return markdown_table(head, lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Results for prose; see `ErrorTime.figures`."""
    seeds = {row["seed"] for row in rows if row.get("seed") is not None}
    words = {
        "seeds": str(len(seeds)),
        "long": f"{LONG:g} s",
        "patience": f"{PATIENCE:g} s",
    }
    for name, criterion in CRITERIA.items():
        for error in (*criterion.levels, *criterion.beside):
            text = criterion.text(error)
            words |= {f"{name}_{criterion.number(error)}": text}
    if end := converged(rows):
        off = 100 * end.uncertainty / end.load
        words |= {
            "reference": f"{end.load:.2f} N",
            "reference_share": f"{100 * end.load / end.inextensible:.2f} %",
            "reference_below": f"{100 - 100 * end.load / end.inextensible:.1f} %",
            "reference_uncertainty": f"{off:.1g} %",
            "inextensible": f"{end.inextensible:.2f} N",
        }
    for (name, criterion), solvers in product(CRITERIA.items(), SETS):
        by_code = fronts(rows, criterion, solvers)
        for error in (*criterion.levels, *criterion.beside):
            level = criterion.number(error)
            key = f"{name}_{level}_{solvers.lower()}"
            words |= _pair_in_words(key, compared(by_code, error), criterion)
        found = (compared(by_code, error).other for error in criterion.levels)
        others = dict.fromkeys(point.code for point in found if point)
        words |= {f"{name}_{solvers.lower()}_others": " or ".join(others)}
    for (code, element), cells in _to_errors(rows).items():
        if code == ThisLibrary.code:
            words |= {f"{name}_{_key(element)}": text for name, text in cells.items()}
    for pair in pairs(rows):
        for solvers, one in pair.by_set.items():
            assert one.other
            key = f"same_{pair.scene}_{solvers.lower()}"
            words |= {
                f"{key}_{_key(one.other.code)}_{_key(one.other.element)}": _factor(
                    one.ratio
                )
            }
    return words | _ranges(rows)


def _pair_in_words(key: str, pair: Comparison, criterion: Criterion) -> dict[str, str]:
    alone = pair.own and not pair.other
    words = {
        f"{key}_ratio": "not reached" if alone else _factor(pair.ratio),
        f"{key}_solves": _factor(pair.solves),
        f"{key}_per_solve": _factor(pair.per_solve),
        f"{key}_other_code": pair.other.code if pair.other else "none",
    }
    for who, point in zip(("ours", "other"), pair, strict=True):
        parts = ["none"] * 5
        if point:
            parts = [
                *(point.element, point.mesh, criterion.text(point.error.median)),
                *(f"{point.seconds.median:.2g} s", f"{point.solves:g}"),
            ]
        names = "", "_mesh", "_error", "_seconds", "_solves"
        words |= {
            f"{key}_{who}{name}": part for name, part in zip(names, parts, strict=True)
        }
    return words


def _ranges(rows: Sequence[Row]) -> dict[str, str]:
    """Smallest and largest ratio of times with the same element on the same mesh."""
    words = {}
    known = [*pairs(rows)]
    for scene, solvers in product(SCENES, SETS):
        ones = [pair.by_set[solvers] for pair in known if pair.scene == scene]
        for what in ("ratio", "solves", "per_solve"):
            values = [getattr(one, what) for one in ones]
            text = (
                f"{_factor(min(values))} to {_factor(max(values))}" if values else "-"
            )
            words[f"same_{scene}_{solvers.lower()}_{what}"] = text
    return words


def _columns(point: Point) -> dict[str, Any]:
    return {
        "code": point.code,
        "element": point.element,
        "solver": point.solver,
        "across": point.across,
        "tolerance": point.tolerance,
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
    """Element, mesh, error and time with their ranges."""
    if point is None:
        return "none"
    code = f"{point.code}, " if named else ""
    return (
        f"{code}{point.element}, {point.mesh}: "
        f"{_of_seeds(point.error, criterion)}, {_seconds(point.seconds)}"
    )


def _of_seeds(error: Spread, criterion: Criterion) -> str:
    least, most = (criterion.number(one) for one in error[1:])
    return f"{criterion.text(error.median)} ({least} to {most})"


def _seconds(seconds: Spread) -> str:
    median, least, most = (f"{one:.2g}" for one in seconds)
    return f"{median} s ({least} to {most})"


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


def _factor(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def _bold(code: str) -> str:
    return f"**{code}**" if code == ThisLibrary.code else code


def _key(text: str) -> str:
    """A part of the name of a result."""
    kept = "".join(c if c.isalnum() else "_" for c in text.lower())
    return "_".join(part for part in kept.split("_") if part)
