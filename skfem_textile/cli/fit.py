"""The command ``fit``: identify laws of a fabric from tests."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from .. import __version__
from ..calibration import bending, biaxial, report
from ..calibration.bending import BendingFit
from ..calibration.biaxial import TensionFit
from ..calibration.preparing import BRANCHES, Preparation
from ..calibration.reading import Format, column_named
from ..calibration.shear import (
    ShearFit,
    Simulation,
    fit_by_simulation,
    fit_shear,
)
from ..calibration.specimens import read_specimens
from ..fabric import Fabric
from ..fabric.files import write_law
from ..mesh.user_input import printable
from ..scenes.shear_test import BiasExtension, PictureFrame, ShearTest
from . import words
from .interruption import held
from .output import say
from .progress import shown
from .result_folder import ResultFolder

# Options of a command: keywords of `argparse` by flag.
_Options: TypeAlias = dict[str, dict[str, Any]]


def _option(
    text: str, of: Any = None, metavar: str | None = None, **more: Any
) -> dict[str, Any]:
    """Keywords of an option; its help ends with its default, if any."""
    default = " (default: %(default)s)" if more.get("default") else ""
    keywords = {"help": text + default, "type": of, "metavar": metavar, **more}
    return {key: value for key, value in keywords.items() if value is not None}


def _repeated(text: str, of: Any, metavar: str) -> dict[str, Any]:
    """Keywords of an option that may be repeated."""
    return _option(text, of, metavar, action="append", default=[])


def _size(what: str) -> dict[str, Any]:
    """Option for a specimen size: one value for all files, or one for each."""
    return _option(
        f"{what} in mm: one value for all files, or one for each",
        float,
        "MM",
        nargs="+",
    )


_READING: _Options = {
    "--encoding": _option("encoding of the files (default: from their bytes)"),
    "--separator": _option(
        "separator of the columns: ; , | tab or space (default: from the rows)"
    ),
    "--decimal": _option(
        "decimal mark (default: from the numbers)", choices=(".", ",")
    ),
    "--column": _repeated(
        "column of a quantity, by number or heading (default: from the headings); may "
        "be repeated",
        words.column,
        "COLUMN=NUMBER",
    ),
    "--unit": _repeated(
        "unit of a quantity (default: from the headings); may be repeated",
        words.unit,
        "COLUMN=UNIT",
    ),
    "--sign": _repeated(
        "factor 1 or -1 of a quantity (default: forces are positive at the largest "
        "displacement); may be repeated",
        words.sign,
        "COLUMN=SIGN",
    ),
}

_BRANCH: _Options = {
    "--branch": _option(
        "rows that are fitted: loading, unloading or both",
        choices=BRANCHES,
        default="loading",
    ),
    "--cycle": _option(
        "number of the fitted cycle (default: the first one that reaches the largest "
        "displacement)",
        int,
        "N",
    ),
    "--keep-outliers": _option("fit also outliers", action="store_true"),
}

_PREPARING: _Options = {
    **_BRANCH,
    "--slack": _option(
        "displacement at which the fabric begins to carry load (default: estimated)",
        float,
        "MM",
    ),
    "--force-at-rest": _option(
        "force of the undeformed fabric, such as the weight of a clamp (default: "
        "estimated)",
        float,
        "N",
    ),
}

_FABRIC: _Options = {
    "--fabric": _option(
        "fabric.json of an earlier fit, whose other laws are kept", metavar="FILE"
    )
}

_COMMON: _Options = {
    **_READING,
    **_FABRIC,
    "--bound": _repeated(
        "lower and upper bound of a parameter; may be repeated",
        words.bound,
        "NAME=LOW,HIGH",
    ),
    "--points": _option(
        "number of points of a tabulated law, excluding 0", int, "N", default=8
    ),
    "--extrapolation": _option(
        "tabulated law beyond the data: refuse every state (default), or extrapolate "
        "linearly",
        choices=("refuse", "linear"),
    ),
}

_SHEAR: _Options = {
    "--law": _option(
        "shear law: polynomial (odd powers), linear, sin2, locking or tabulated",
        metavar="LAW",
        default="polynomial",
    ),
    "--degree": _option(
        "highest power of the polynomial, an odd number", int, "N", default=5
    ),
    "--up-to": _option(
        "largest shear angle of the fitted points (default: 40 for theoretical angles "
        "of bias extensions, the onset of slip for measured ones; no limit for picture "
        "frames or simulated tests)",
        words.degrees,
        "DEG",
    ),
    **_PREPARING,
    "--fibre-stiffness": _option(
        "fibre stiffness in N/mm for fabric.json and for simulated tests (default: "
        "from --fabric, else 1e5)",
        float,
        "E",
    ),
    **_COMMON,
}

#: Kinds of tests: help text and options.
TESTS: dict[str, tuple[str, _Options]] = {
    "picture-frame": (
        "a shear law from picture-frame tests",
        {
            "--frame-side": _size("side of the frame from hinge to hinge"),
            "--fabric-side": _size("side of the sheared square of fabric"),
            **_SHEAR,
        },
    ),
    "bias-extension": (
        "a shear law from bias-extension tests",
        {
            "--width": _size("width of the specimen"),
            "--height": _size("height of the specimen between the clamps"),
            "--warp": _option(
                "angle between fibres and clamps", words.degrees, "DEG", default=45.0
            ),
            **_SHEAR,
            "--simulate": _option(
                "fit by simulation of the tests, with this number of element edges "
                "across the width",
                int,
                "N",
            ),
        },
    ),
    "cantilever": (
        "a bending stiffness from cantilever tests, by the elastica (Peirce)",
        {
            "--weight": _option(
                "weight per area in N/mm2, such as 6e-6 for 0.6 kg/m2", float, "W"
            ),
            "--family": _option(
                "fibre family along the strips",
                default="warp",
                choices=("warp", "weft"),
            ),
            "--chord-angle": _option(
                "chord angle of all readings, for files without that column, such as "
                "41.5",
                words.degrees,
                "DEG",
            ),
            **_READING,
            **_FABRIC,
        },
    ),
    "biaxial": (
        "tension laws from biaxial tests, one file per strain ratio",
        {
            "--law": _option(
                "tension law: crimp-toe, linear or tabulated for each family, or "
                "crimp-interchange",
                metavar="LAW",
                default="crimp-toe",
            ),
            "--warp-width": _size("width of the specimen transverse to the warp force"),
            "--weft-width": _size("width of the specimen transverse to the weft force"),
            **_BRANCH,
            **_COMMON,
        },
    ),
}


# Default fibre stiffness in N/mm if no tension law is known.
_FIBRES = 1e5

# Notes on properties that no test has determined.
_NO_TENSION = (
    f"the fibre stiffness in fabric.json is the default, {_FIBRES:g} N/mm: pass "
    "--fibre-stiffness, or fit biaxial tests with --fabric and this fabric.json"
)
_NO_SHEAR = (
    "fabric.json contains no shear stiffness: fit a shear test, then repeat this fit "
    "with --fabric and the resulting fabric.json"
)

_NO_LAWS = (
    "fabric.json contains the default fibre stiffness and no shear stiffness: fit "
    "shear and tension tests, then repeat this fit with --fabric and the resulting "
    "fabric.json"
)

# Output files of a fit.
_FILES = (
    *("summary.json", "fabric.json", "report.md"),
    *("law.json", "warp_law.json", "weft_law.json"),
)
_PICTURE = "fit.png"


@dataclass(frozen=True)
class _FitOutcome:
    """Reports by title, fabric, laws by file name, and the fit."""

    reports: dict[str, dict[str, Any]]
    fabric: Fabric
    laws: dict[str, Any]
    fit: ShearFit | TensionFit | BendingFit


def run_fit(options: argparse.Namespace) -> int:
    """Fit laws to the data files and write them; returns the exit code."""
    from .. import io

    fits = {
        "picture-frame": _frame,
        "bias-extension": _bias,
        "cantilever": _bending,
        "biaxial": _tension,
    }
    with shown("fitting"):
        outcome = fits[options.test](options)
    text = report.report_text(outcome.reports)
    inputs = {k: v for k, v in vars(options).items() if k not in ("command", "out")}
    inputs["data"] = [str(path) for path in options.data]
    summary = {"reports": outcome.reports, "inputs": {"version": __version__, **inputs}}
    with held(), ResultFolder(options.out, (*_FILES, _PICTURE)) as folder:
        for name, law in outcome.laws.items():
            write_law(law, folder / name)
        io.write_fabric(folder / "fabric.json", outcome.fabric)
        (folder / "report.md").write_text(text, encoding="utf-8")
        io.write_summary(summary, folder / "summary.json")
    if not options.no_render:
        try:
            with ResultFolder(options.out, (_PICTURE,)) as folder:
                from ..calibration.figure import draw

                draw(outcome.fit, folder / _PICTURE)
        except ImportError as error:
            say(
                f"the picture was not drawn: {printable(error)}: pip install "
                "'skfem-textile[plot]'"
            )
    say(text, end="")
    say(f"results written to {printable(options.out)}")
    return 0


def _frame(options: argparse.Namespace) -> _FitOutcome:
    sizes = _sizes(options, "frame_side", "fabric_side")
    tests = [PictureFrame(frame, fabric) for frame, fabric in sizes]
    return _shear(options, tests, Fabric(_FIBRES))


def _bias(options: argparse.Namespace) -> _FitOutcome:
    theta = float(np.radians(options.warp))
    sizes = _sizes(options, "width", "height")
    tests = [BiasExtension(width, height, theta) for width, height in sizes]
    c, s = float(np.cos(theta)), float(np.sin(theta))
    plain = Fabric(_FIBRES, 0.0, (c, s), (-c, s))
    return _shear(options, tests, plain, options.simulate)


def _shear(
    options: argparse.Namespace,
    tests: Sequence[ShearTest],
    plain: Fabric,
    across: int | None = None,
) -> _FitOutcome:
    form, stiffness = _format(options), options.fibre_stiffness
    choices = Preparation(
        options.branch,
        options.cycle,
        options.slack,
        options.force_at_rest,
        not options.keep_outliers,
    )
    specimens = [
        specimen
        for path, test in zip(options.data, tests, strict=True)
        for specimen in read_specimens(path, test, form, choices)
    ]
    fabric = _base_fabric(options, plain)
    if stiffness is not None:
        fabric = replace(fabric, tension=stiffness)
    up_to = None if options.up_to is None else float(np.radians(options.up_to))
    how: dict[str, Any] = {"degree": options.degree, "up_to": up_to}
    how |= _of_table(options)
    if across is None:
        result = fit_shear(specimens, options.law, **how)
    else:
        simulation = Simulation(fabric.tension, across)
        result = fit_by_simulation(specimens, options.law, simulation, **how)
    law, shear = result.fit.law, report.shear_report(result)
    if options.fabric is None and stiffness is None:
        shear["notes"].append(_NO_TENSION)
    fabric = replace(fabric, shear=law)
    return _FitOutcome({"Shear": shear}, fabric, {"law.json": law}, result)


def _tension(options: argparse.Namespace) -> _FitOutcome:
    sizes, form = _sizes(options, "warp_width", "weft_width"), _format(options)
    choices = Preparation(
        options.branch, options.cycle, outliers=not options.keep_outliers
    )
    curves = [
        curve
        for path, size in zip(options.data, sizes, strict=True)
        for curve in biaxial.read_biaxial(path, size, form, choices)
    ]
    result = biaxial.fit_tension(curves, options.law, **_of_table(options))
    fabric, tension = _base_fabric(options, Fabric()), result.tension
    laws: dict[str, Any] = {"law.json": tension}
    if isinstance(tension, tuple):
        laws = dict(zip(("warp_law.json", "weft_law.json"), tension, strict=True))
    reports = {f"Tension, {k}": r for k, r in report.tension_report(result).items()}
    if options.fabric is None:
        for one in reports.values():
            one["notes"].append(_NO_SHEAR)
    return _FitOutcome(reports, replace(fabric, tension=tension), laws, result)


def _bending(options: argparse.Namespace) -> _FitOutcome:
    if options.weight is None:
        raise ValueError("--weight is missing: specify the weight per area in N/mm2")
    form, angle = _format(options), options.chord_angle
    fixed = None if angle is None else float(np.radians(angle))
    tests = [
        test
        for path in options.data
        for test in bending.read_cantilever(path, fixed, form)
    ]
    result = bending.fit_bending(tests, options.weight)
    fabric, known = _base_fabric(options, Fabric()), report.bending_report(result)
    D, (warp, weft) = result.stiffness, fabric.bending
    both = (D, weft) if options.family == "warp" else (warp, D)
    if options.fabric is None:
        known["notes"].append(_NO_LAWS)
    fabric = replace(fabric, bending=both)
    return _FitOutcome({f"Bending of the {options.family}": known}, fabric, {}, result)


def _of_table(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of a fit for tables and bounds."""
    names = "points", "extrapolation"
    how = {name: getattr(options, name) for name in names}
    return how | {"bounds": dict(options.bound)}


def _base_fabric(options: argparse.Namespace, plain: Fabric) -> Fabric:
    """Fabric of --fabric, or a plain one."""
    from ..io import read_fabric

    return plain if options.fabric is None else read_fabric(options.fabric).fabric


def _format(options: argparse.Namespace) -> Format:
    columns, units, signs = (
        {column_named(name): value for name, value in given}
        for given in (options.column, options.unit, options.sign)
    )
    return Format(
        *(options.encoding, options.separator, options.decimal, columns, units, signs)
    )


def _sizes(options: argparse.Namespace, *keys: str) -> list[tuple[float, float]]:
    """Two sizes of the specimen for each file."""
    n, columns = len(options.data), []
    for key in keys:
        sizes, name = getattr(options, key), f"--{key.replace('_', '-')}"
        if sizes is None:
            raise ValueError(
                f"{name} is missing: specify the size of the specimens in mm"
            )
        if len(sizes) not in (1, n):
            raise ValueError(
                f"{name} has {len(sizes)} values for {n} files: specify one for all "
                "files, or one for each"
            )
        columns.append(sizes * n if len(sizes) == 1 else sizes)
    first, second = columns
    return list(zip(first, second, strict=True))
