"""The command ``fit``: laws of a fabric from its tests."""

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..calibration import bending, biaxial, report
from ..calibration.bending import BendingFit
from ..calibration.biaxial import TensionFit
from ..calibration.curves import COLUMNS, column_named
from ..calibration.inverse import Simulation, fit_by_simulation
from ..calibration.report import report_text
from ..calibration.shear import ShearFit, Specimen, fit_shear, read_specimen
from ..fabric import Fabric
from ..fabric.files import write_law
from ..mesh.user_input import printable
from ..registration import Option, angle
from ..scenes.shear_test import BiasExtension, PictureFrame, ShearTest
from .interruption import held
from .output import say
from .result_folder import ResultFolder


def _bound(word: str) -> tuple[str, tuple[float, float]]:
    name, _, ends = word.partition("=")
    try:
        low, high = (float(end) for end in ends.split(","))
    except ValueError:
        low = high = math.nan
    if not (name and low < high):
        raise ValueError(f"{word!r} is not like c1=0,1")
    return name, (low, high)


def _unit(word: str) -> tuple[str, str]:
    name, _, unit = word.partition("=")
    if not (name and unit):
        raise ValueError(f"{word!r} is not like force=kN")
    return name, unit


def _size(name: str, help: str) -> Option:  # noqa: A002
    """A size of specimens: one for all, or one for each file."""
    said = f"{help}, in mm: one for all files or one for each"
    return Option(name=name, help=said, read=float, words="+", metavar="MM")


_COMMON = (
    Option(
        name="unit",
        help="unit of a column, where the first row of a file does not tell it; may be "
        "repeated",
        default=(),
        read=_unit,
        repeated=True,
        metavar="COLUMN=UNIT",
    ),
    Option(
        name="bound",
        help="least and largest value of a parameter; may be repeated",
        default=(),
        read=_bound,
        repeated=True,
        metavar="NAME=LOW,HIGH",
    ),
    Option(
        name="fabric",
        help="a fabric.json of another fit, whose other laws are kept",
        metavar="FILE",
    ),
    Option(
        name="points",
        help="points of a table beside 0",
        default=8,
        read=int,
        metavar="N",
    ),
    Option(
        name="extrapolation",
        help="of a table beyond the data: refuse every state, which is the default, or "
        "go on in a straight line",
        choices=("refuse", "linear"),
    ),
)

_SHEAR = (
    Option(
        name="law",
        help="polynomial of odd powers, linear, sin2, locking or tabulated",
        default="polynomial",
        metavar="LAW",
    ),
    Option(
        name="degree",
        help="highest power of the polynomial, odd",
        default=5,
        read=int,
        metavar="N",
    ),
    angle(
        "up-to",
        None,
        "shear angle up to which points are taken; without it up to 40 where the angle "
        "is theoretical, and all where it is measured or the tests are simulated",
    ),
    Option(
        name="fibre-stiffness",
        help="of fabric.json, and of simulated tests, in N/mm (default: 1e5, or that "
        "of --fabric)",
        read=float,
        metavar="E",
    ),
    *_COMMON,
)

#: The options of each kind of test.
TESTS: dict[str, tuple[str, tuple[Option, ...]]] = {
    "picture-frame": (
        "a shear law from picture-frame tests",
        (
            _size("frame-side", "side of the frame from hinge to hinge"),
            _size("fabric-side", "side of the square of fabric that is sheared"),
            *_SHEAR,
        ),
    ),
    "bias-extension": (
        "a shear law from bias-extension tests",
        (
            _size("width", "width of the specimen"),
            _size("height", "height of the specimen between the clamps"),
            angle("warp", 45.0, "angle between fibres and clamps"),
            *_SHEAR,
            Option(
                name="simulate",
                help="fit simulated tests, with so many element edges across the width",
                read=int,
                metavar="N",
            ),
        ),
    ),
    "cantilever": (
        "a bending stiffness from cantilever tests, by the elastica (Peirce)",
        (
            Option(
                name="weight",
                help="weight per area in N/mm2, 6e-6 for 0.6 kg/m2",
                read=float,
                metavar="W",
            ),
            Option(
                name="family",
                help="whose fibres lie along the strips",
                default="warp",
                choices=("warp", "weft"),
            ),
            angle("chord-angle", None, "of files without that column, such as 41.5"),
            *_COMMON[:1],
            _COMMON[2],
        ),
    ),
    "biaxial": (
        "tension laws from biaxial tests, one file for each ratio of the strains",
        (
            Option(
                name="law",
                help="crimp-toe, linear or tabulated for each family, or "
                "crimp-interchange",
                default="crimp-toe",
                metavar="LAW",
            ),
            _size("warp-width", "width across the pull of the warp"),
            _size("weft-width", "width across the pull of the weft"),
            *_COMMON,
        ),
    ),
}


# Fibre stiffness in N/mm of a fabric of which only shear is known.
_FIBRES = 1e5

# What a fabric has that no test told.
_NO_TENSION = (
    f"fibres of fabric.json have {_FIBRES:g} N/mm, which no test told: give "
    "--fibre-stiffness, or fit biaxial tests with --fabric and this file"
)
_NO_SHEAR = (
    "fabric.json has no shear stiffness: fit a shear test, and this test with --fabric "
    "and its fabric.json"
)

_NO_LAWS = (
    "fibres of fabric.json have a stiffness that no test told, and its shear none: fit "
    "tests of shear and tension, and this test with --fabric and their fabric.json"
)

# Files that a fit may write; summary.json comes last.
_FILES = (
    *("summary.json", "fabric.json", "report.md"),
    *("law.json", "warp_law.json", "weft_law.json"),
)
_PICTURE = "fit.png"


@dataclass(frozen=True)
class _Found:
    """Reports by title, the fabric, laws by file name, and the fit."""

    reports: dict[str, dict[str, Any]]
    fabric: Fabric
    laws: dict[str, Any]
    fit: ShearFit | TensionFit | BendingFit


def run_fit(options: argparse.Namespace) -> int:
    """Fit laws to the files of the options and write them; returns the exit code.

    Raises
    ------
    ValueError
        If an option, a file or the fit is refused.
    OutputError
        If the results cannot be written.
    """
    from .. import io

    fits = {
        "picture-frame": _frame,
        "bias-extension": _bias,
        "cantilever": _bending,
        "biaxial": _tension,
    }
    found = fits[options.test](options)
    text = report_text(found.reports)
    inputs = {k: v for k, v in vars(options).items() if k not in ("command", "out")}
    inputs["data"] = [str(path) for path in options.data]
    summary = {"reports": found.reports, "inputs": {"version": __version__, **inputs}}
    with held(), ResultFolder(options.out, (*_FILES, _PICTURE)) as folder:
        for name, law in found.laws.items():
            write_law(law, folder / name)
        io.write_fabric(folder / "fabric.json", found.fabric)
        (folder / "report.md").write_text(text, encoding="utf-8")
        io.write_summary(summary, folder / "summary.json")
    if not options.no_render:
        _draw(found, options.out)
    say(text, end="")
    say(f"results in {printable(options.out)}")
    return 0


def _draw(found: _Found, out: Path) -> None:
    try:
        with ResultFolder(out, (_PICTURE,)) as folder:
            from ..calibration.figure import draw

            draw(found.fit, folder / _PICTURE)
    except ImportError as error:
        say(f"no picture: {printable(error)}; pip install 'skfem-textile[plot]'")


def _frame(options: argparse.Namespace) -> _Found:
    sizes = _sizes(options, "frame_side", "fabric_side")
    tests = [PictureFrame(frame, fabric) for frame, fabric in sizes]
    specimens = _specimens(options, tests)
    base = _base(options, Fabric(_FIBRES))
    return _shear(options, specimens, base)


def _bias(options: argparse.Namespace) -> _Found:
    theta = float(np.radians(options.warp))
    sizes = _sizes(options, "width", "height")
    tests = [BiasExtension(width, height, theta) for width, height in sizes]
    specimens = _specimens(options, tests)
    c, s = float(np.cos(theta)), float(np.sin(theta))
    base = _base(options, Fabric(_FIBRES, 0.0, (c, s), (-c, s)))
    return _shear(options, specimens, base, options.simulate)


def _shear(
    options: argparse.Namespace,
    specimens: list[Specimen],
    base: Fabric,
    across: int | None = None,
) -> _Found:
    how: dict[str, Any] = {
        "degree": options.degree,
        "points": options.points,
        "extrapolation": options.extrapolation,
        "up_to": None if options.up_to is None else float(np.radians(options.up_to)),
        "bounds": dict(options.bound),
    }
    if across is None:
        found = fit_shear(specimens, options.law, **how)
    else:
        simulation = Simulation(base.tension, across)
        found = fit_by_simulation(specimens, options.law, simulation, **how)
    law, shear = found.fit.law, report.shear_report(found)
    if options.fabric is None and options.fibre_stiffness is None:
        shear["notes"].append(_NO_TENSION)
    return _Found({"Shear": shear}, replace(base, shear=law), {"law.json": law}, found)


def _tension(options: argparse.Namespace) -> _Found:
    sizes, units = _sizes(options, "warp_width", "weft_width"), _units(options)
    paths = zip(options.data, sizes, strict=True)
    curves = [biaxial.read_biaxial(path, size, units) for path, size in paths]
    bounds = dict(options.bound)
    how: dict[str, Any] = {"points": options.points, "bounds": bounds}
    how["extrapolation"] = options.extrapolation
    found = biaxial.fit_tension(curves, options.law, **how)
    base, tension = _kept(options, Fabric()), found.tension
    laws = (
        {"warp_law.json": tension[0], "weft_law.json": tension[1]}
        if isinstance(tension, tuple)
        else {"law.json": tension}
    )
    reports = {f"Tension, {k}": r for k, r in report.tension_report(found).items()}
    if options.fabric is None:
        for one in reports.values():
            one["notes"].append(_NO_SHEAR)
    return _Found(reports, replace(base, tension=tension), laws, found)


def _bending(options: argparse.Namespace) -> _Found:
    if options.weight is None:
        raise ValueError("--weight is missing: the weight per area is needed")
    units, angle = _units(options), options.chord_angle
    fixed = None if angle is None else float(np.radians(angle))
    tests = [bending.read_cantilever(path, fixed, units) for path in options.data]
    found = bending.fit_bending(tests, options.weight)
    base, known = _kept(options, Fabric()), report.bending_report(found)
    warp, weft = base.bending
    both = (
        (found.stiffness, weft) if options.family == "warp" else (warp, found.stiffness)
    )
    if options.fabric is None:
        known["notes"].append(_NO_LAWS)
    title = f"Bending of the {options.family}"
    return _Found({title: known}, replace(base, bending=both), {}, found)


def _specimens(options: argparse.Namespace, tests: list[Any]) -> list[Specimen]:
    units = _units(options)
    pairs: zip[tuple[Path, ShearTest]] = zip(options.data, tests, strict=True)
    return [read_specimen(path, test, units) for path, test in pairs]


def _base(options: argparse.Namespace, plain: Fabric) -> Fabric:
    """The fabric that a shear law is put into, with the fibre stiffness if given."""
    base, stiffness = _kept(options, plain), options.fibre_stiffness
    return base if stiffness is None else replace(base, tension=stiffness)


def _kept(options: argparse.Namespace, plain: Fabric) -> Fabric:
    """The fabric of --fabric, or a plain one."""
    from ..io import read_fabric

    return plain if options.fabric is None else read_fabric(options.fabric).fabric


def _units(options: argparse.Namespace) -> dict[str, str]:
    units = {column_named(name): unit for name, unit in options.unit}
    for name in units:
        if name not in COLUMNS:
            raise ValueError(f"--unit {name}: no column is one of {', '.join(COLUMNS)}")
    return units


def _sizes(options: argparse.Namespace, *keys: str) -> list[tuple[float, float]]:
    """Two sizes of the specimen of each file."""
    n, columns = len(options.data), []
    for key in keys:
        given, name = getattr(options, key), f"--{key.replace('_', '-')}"
        if given is None:
            raise ValueError(
                f"{name} is missing: the sizes of the specimens are needed"
            )
        if len(given) not in (1, n):
            raise ValueError(
                f"{name} has {len(given)} sizes for {n} files: give one for all or one "
                "for each"
            )
        columns.append(given * n if len(given) == 1 else given)
    first, second = columns
    return list(zip(first, second, strict=True))
