"""Page of the command ``fit``: data, laws, residuals, validation, laws to copy."""

import re
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import fabric as fabrics
from ..calibration.bands import CONFIDENCE
from ..calibration.choice import Choice, Test
from ..calibration.fitting import FabricFit
from ..calibration.report import title_of
from ..calibration.validation import Validation
from ..cases.fabrics import fabric_tables
from ..fabric import Fabric, TwoLaws
from ..mesh.user_input import printable
from .page import Row, rows, say_rows, sources, write_page

#: File of the page.
REPORT = "report.html"

# Largest number of parameters in the table of correlations.
_MOST_CORRELATIONS = 12

_PERCENT = f"{100 * CONFIDENCE:g} %"

# Largest relative error of the force of a testing machine of class 1 (ISO 7500-1).
# Deviations below it are not marked.
_MACHINE = 0.01

# Length of a line of Python.
_WIDTH = 76


class Reported(NamedTuple):
    """Reports of a fit: laws by title, data, joint parameters and predictions."""

    laws: Mapping[str, Mapping[str, Any]]
    data: Sequence[Mapping[str, Any]]
    joint: Mapping[str, Any]
    validation: Mapping[str, Any]

    def notes(self) -> list[str]:
        """Notes of all reports, each once."""
        every = [note for one in self.laws.values() for note in one["notes"]]
        return list(dict.fromkeys([*every, *self.validation["notes"]]))

    def verdict(self) -> list[Row]:
        """Rows: errors of laws and predictions, and whether they are within noise."""
        found = [_law_row(title, one) for title, one in self.laws.items()]
        return found + [_prediction_row(one) for one in self.validation["rows"]]

    def say(self) -> None:
        """Print the content of the page without its tables of numbers."""
        for test in self.data:
            say_rows([(test["name"], "", test["test"])])
            say_rows(("", "", text) for text in (*test["read"], *test["prepared"]))
        for title, one in self.laws.items():
            say_rows([_law_row(title, one)])
            say_rows((f"  {p[0]}", "", " ".join(p[1:])) for p in _parameters(one))
        say_rows(self.verdict()[len(self.laws) :])
        say_rows(("Note", "", note) for note in self.notes())


def write_fit_page(
    folder: Path,
    reported: Reported,
    fabric: Fabric,
    tables: Sequence[str],
    pictures: Mapping[str, Mapping[str, str]],
    no_pictures: str,
    inputs: Mapping[str, Any],
    choice: Choice | None = None,
) -> None:
    """Write the page into a folder.

    Parameters
    ----------
    folder
        Existing folder.
    reported
        The reports.
    fabric, tables
        The fabric, and tables of a case file with the laws that are known.
    pictures, no_pictures
        See `pictures_of`, or the reason why there are none.
    inputs
        Options of the command.
    choice
        Chosen laws of a fit to files of tests, which Python can repeat.
    """
    kinds = [*dict.fromkeys(one["of"] for one in reported.laws.values())]
    write_page(
        *(folder, REPORT, "fit.html"),
        title=f"Fit of {', '.join(kinds[:-1])}{' and ' * (len(kinds) > 1)}{kinds[-1]}",
        percent=_PERCENT,
        verdict=reported.verdict(),
        notes=reported.notes(),
        laws=[_law(title, one) for title, one in reported.laws.items()],
        data=[
            {**one, "title": _title(i, one["name"])}
            for i, one in enumerate(reported.data)
        ],
        residuals=_residuals(reported.laws),
        correlations=_correlations(reported.joint),
        choices=list(_choices(reported.laws)),
        validation=_validation(reported.validation),
        toml=_toml(fabric, tables),
        python=_python(fabric, tables),
        repetition="" if choice is None else _repetition(choice, inputs),
        pictures=defaultdict(dict, pictures),
        no_pictures=no_pictures,
        inputs=rows(inputs),
    )


def pictures_of(
    result: FabricFit, tests: Sequence[Test], found: Sequence[Validation]
) -> dict[str, dict[str, str]]:
    """Pictures of the page as data URLs, by group and caption.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    """
    from ..calibration.figure import (
        data_panel,
        draw_panels,
        law_panels,
        prediction_panel,
        residual_panel,
    )

    of_data = zip(_numbered(tests), map(data_panel, tests), strict=True)
    names = _numbered([one.specimen for one in found])
    titles = {title_of(part): part for part in result.parts}
    groups = {
        **{title: law_panels(result, part) for title, part in titles.items()},
        "data": {name: panel for name, panel in of_data if panel},
        "residuals": {t: residual_panel(result, part) for t, part in titles.items()},
        "validation": dict(zip(names, map(prediction_panel, found), strict=True)),
    }
    drawn = {}
    for group, panels in groups.items():
        with tempfile.TemporaryDirectory() as scratch:
            captions = draw_panels(panels, Path(scratch))
            drawn[group] = sources(Path(scratch), captions)
    return drawn


def _numbered(tests: Sequence[Test]) -> list[str]:
    """Titles of tests, whose files may have the same name."""
    return [_title(i, test.name) for i, test in enumerate(tests)]


def _title(i: int, name: str) -> str:
    return f"{i + 1}. {name}"


def _law_row(title: str, one: Mapping[str, Any]) -> Row:
    """Row of a law: its error, its range, and whether it follows the data."""
    kind, reach, what = one["name"], "", "load"
    if one["of"] == "bending":
        what = "stiffness" if "readings" in one else "moment"
        if "bending_moments" in one:
            reach = f", up to {_short(one['largest_curvature_per_mm'])} 1/mm"
        elif "readings" in one:
            kind = "mean of the readings"
    elif one["of"] == "shear":
        reach = f", up to {one['largest_angle_deg']:.1f}°"
    else:
        reach = f", up to a strain ln λ of {_short(one['largest_strain'])}"
    error = np.fmax.reduce([c["residual_rms_over_largest"] for c in one["curves"]])
    text = f"{_error(error, what)}: {kind}{reach}, "
    if one["systematic"]:
        off = max(map(_systematic, one["curves"]))
        names = ", ".join(one["systematic"])
        text += f"deviates systematically from {names} by {_percent(off)}"
        return title, "bad" if off > _MACHINE else "", text
    if one["specimens_differ_beyond_noise"]:
        return title, "", f"{text}the specimens differ beyond their noise"
    return title, "good", f"{text}follows the data within the noise"


def _systematic(curve: Mapping[str, Any]) -> float:
    """Smooth part of the residuals of a curve relative to its largest value.

    The covariance of neighbouring residuals is the variance of the smooth part, because
    noise is independent from point to point.
    """
    smooth = max(curve["correlation_of_neighbours"], 0.0)
    return float(curve["residual_rms_over_largest"] * np.sqrt(smooth))


def _prediction_row(one: Mapping[str, Any]) -> Row:
    share = f"{100 * one['inside_simultaneous']:.0f} %"
    inside = f"{share} of the smooth curve is inside the band of a whole curve"
    error, name = one["rms_over_largest_force"], f"Prediction of {one['name']}"
    text = _error(error, "load")
    if one["confirmed"]:
        return name, "good", f"{text}: confirmed, {inside}"
    mark = "bad" if error > _MACHINE else ""
    return name, mark, f"{text}: not confirmed, only {inside}"


def _error(error: float, what: str) -> str:
    return f"error of the {what} {_percent(error)} of its largest value, rms"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _law(title: str, one: Mapping[str, Any]) -> dict[str, Any]:
    """Section of a law: its parameters, and further tables."""
    tables: list[tuple[str, Sequence[str], list[list[Any]]]] = []
    head: Sequence[str]
    if one.get("moments"):
        head = (
            *("angle (°)", "C (N·mm/mm²)", f"{_PERCENT} of the mean"),
            *(f"{_PERCENT} of a specimen", "between specimens", "point by point"),
        )
        tables.append(("Shear moment", head, [_moment(m) for m in one["moments"]]))
    if one.get("bending_moments"):
        head = "curvature (1/mm)", "moment (N·mm/mm)", _PERCENT
        moments = [
            [*map(_short, row[:2]), _range(*row[2:])]
            for row in map(list, map(dict.values, one["bending_moments"]))
        ]
        tables.append(("Bending moment", head, moments))
    if one.get("readings"):
        head = (
            *("test", "overhang (mm)", "chord angle (°)"),
            *("D by elastica (N·mm)", "D by Peirce (N·mm)"),
        )
        readings = [[_cell(x) for x in r.values()] for r in one["readings"]]
        tables.append(("Readings", head, readings))
    head = ("parameter", "value", "unit", f"{_PERCENT} band")
    return {
        "title": title,
        "heading": title if one["name"] == "bending" else f"{title}: {one['name']}",
        "head": head,
        "parameters": _parameters(one),
        "tables": tables,
    }


def _parameters(one: Mapping[str, Any]) -> list[list[str]]:
    return [
        [
            *(p["name"], _short(p["value"], 5), p["unit"]),
            "at a bound" if p["at_bound"] else _range(p["low"], p["high"]),
        ]
        for p in one["parameters"]
    ]


def _moment(one: Mapping[str, Any]) -> list[Any]:
    further = "-", "-"
    if "specimen_low" in one:
        further = (
            _range(one["specimen_low"], one["specimen_high"]),
            _short(one["between_specimens"], 2),
        )
    return [
        *(_cell(one["angle_deg"]), _cell(one["moment"])),
        *(_range(one["low"], one["high"]), *further),
        ", ".join(map(_short, one["point_by_point"])) or "-",
    ]


# Units of the measured values of a curve, by the ends of their keys.
_RESIDUAL_UNITS = {"N": "N", "N_mm": "N·mm", "N_mm_per_mm": "N·mm/mm"}


def _residuals(laws: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Table of the noise and the residuals of each curve."""
    found = []
    for one in laws.values():
        for c in one["curves"]:
            key = next(x[6:] for x in c if x.startswith("noise_N"))
            unit = _RESIDUAL_UNITS[key]
            share = c["noise_over_largest"]
            found.append(
                [
                    *(c["name"], c["points"]),
                    f"{_short(c[f'noise_{key}'])} {unit}",
                    "no force" if np.isnan(share) else f"{100 * share:.1f} %",
                    f"{_short(c[f'residual_rms_{key}'])} {unit}",
                    f"{_short(c[f'residual_largest_{key}'])} {unit}",
                    f"{c['correlation_of_neighbours']:+.2f}",
                ]
            )
    head = (
        *("curve", "points", "noise", "of the largest", "rms residual"),
        *("largest residual", "correlation of neighbours"),
    )
    return {"head": head, "rows": found}


def _correlations(joint: Mapping[str, Any]) -> dict[str, Any]:
    """Table of the correlations of the parameters, at most the largest ones."""
    matrix, names = np.array(joint["correlations"]), joint["parameters"]
    if len(names) < 2:
        return {"rows": []}
    largest = np.abs(matrix - np.diag(np.diag(matrix))).max(axis=0)
    kept = np.sort(np.argsort(-largest, kind="stable")[:_MOST_CORRELATIONS])
    return {
        "head": ["", *(names[i] for i in kept)],
        "rows": [[names[i], *(_correlation(matrix[i, j]) for j in kept)] for i in kept],
        "left_out": len(names) > len(kept),
    }


def _correlation(number: float) -> str:
    """Correlation with two decimals; short zeros and ones show the others."""
    text = f"{number:+.2f}"
    return {"+1.00": "1", "+0.00": "0", "-0.00": "0"}.get(text, text)


def _choices(
    laws: Mapping[str, Mapping[str, Any]],
) -> Iterator[tuple[str, Sequence[str], list[list[Any]]]]:
    """Tables of the laws that were compared."""
    head = (
        *("law", "parameters", "zeros of the machine", "error", "standard error"),
        "not suitable because",
    )
    for title, one in laws.items():
        if one["candidates"]:
            compared = [
                [
                    *(c["name"], c["parameters"]),
                    "-" if c["reason"] else c["zeros"],
                    *(
                        "-" if c["reason"] else f"{100 * c[key]:.2f} %"
                        for key in ("error", "standard_error")
                    ),
                    c["reason"],
                ]
                for c in one["candidates"]
            ]
            yield title, head, compared


def _validation(report: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Rows of each predicted test by its title."""
    found = {}
    for i, one in enumerate(report["rows"]):
        share = 100 * one["largest_over_largest_force"]
        largest = f"{_short(one['largest_N'])} N, {share:.1f} % of the largest force"
        values = {
            "Points": one["points"],
            "Largest shear angle": f"{one['largest_angle_deg']:.1f}°",
            "Slack": f"{_short(one['slack_mm'], 3)} mm",
            "Root mean square of the differences": f"{_short(one['rms_N'])} N",
            "Largest difference": largest,
            "Inside the band of a point": f"{100 * one['inside_pointwise']:.0f} %",
            "Inside the band of the curve": f"{100 * one['inside_simultaneous']:.0f} %",
            "Noise of the test": f"{_short(one['noise_N'])} N",
            "Largest band of the parameters": f"± {_short(one['parameters_N'])} N",
            "Discretisation error": f"± {_short(one['discretisation_N'])} N",
            "Load lost to fibre stretch": f"{100 * one['lost_to_stretch']:.1f} %",
        }
        verdict = ("Verdict", *_prediction_row(one)[1:])
        found[_title(i, one["name"])] = [verdict, *rows(values)]
    return found


def _toml(fabric: Fabric, tables: Sequence[str]) -> str:
    import tomli_w

    return tomli_w.dumps(fabric_tables(fabric, tables, "fabric.json")).rstrip()


def _python(fabric: Fabric, tables: Sequence[str]) -> str:
    """Python that builds the fabric; from its file if a law is not a plain object."""
    tensions = fabric.tensions
    laws: dict[str, Any] = {"tension": tensions}
    if isinstance(tensions, TwoLaws):
        laws = {"warp": tensions.warp, "weft": tensions.weft}
    both = "tension" if len(laws) == 1 else "(warp, weft)"
    laws["shear"] = fabric.shear_law
    given = [f"tension={both}", "shear=shear"]
    for key in ("warp", "weft", "bending", "twist", "wrinkling_angle", "yarns"):
        if repr(value := getattr(fabric, key)) != repr(getattr(Fabric, key)):
            given.append(f"{key}={value!r}")
    lines = [f"{name} = {_source(law)}" for name, law in laws.items()]
    text = "\n".join([*lines, f"fabric = {_call('Fabric', given)}"])
    classes = sorted(set(re.findall(r"\b([A-Za-z]\w*)\(", text)))
    if not {*classes} <= {*dir(fabrics)}:
        read = 'fabric = read_fabric("fabric.json").fabric'
        return f"from skfem_textile.io import read_fabric\n\n{read}"
    return f"from skfem_textile.fabric import {', '.join(classes)}\n\n{text}"


def _repetition(choice: Choice, inputs: Mapping[str, Any]) -> str:
    """Python that repeats a fit to files of tests, with the fabric of `_python`."""
    names = ["Choice", "fit_tests", "read_tests"]
    given = [" + ".join(f"read_tests({path!r})" for path in inputs["data"])]
    given.append(_source(choice))
    if inputs["simulate"] is not None:
        names.insert(1, "Simulation")
        given.append(f"Simulation(fabric.tension, {inputs['simulate']})")
    head = f"from skfem_textile.calibration import {', '.join(names)}"
    return f"{head}\n\nfabric_fit = {_call('fit_tests', given)}"


def _source(of: Any) -> str:
    """Call that builds a dataclass, without arguments that have their defaults."""
    given = []
    for one in fields(of):
        value = getattr(of, one.name)
        if one.default is MISSING or repr(value) != repr(one.default):
            given.append(f"{one.name}={value!r}")
    return _call(type(of).__name__, given)


def _call(name: str, arguments: Sequence[str]) -> str:
    line = f"{name}({', '.join(arguments)})"
    if len(line) <= _WIDTH:
        return line
    return "\n".join([f"{name}(", *(f"    {one}," for one in arguments), ")"])


def _short(number: float, digits: int = 4) -> str:
    return f"{number:.{digits}g}"


def _range(low: float, high: float) -> str:
    return f"{_short(low)} to {_short(high)}"


def _cell(value: Any) -> Any:
    """Number of a table with four significant digits; texts as they are."""
    return float(_short(value)) if isinstance(value, float) else printable(value)
