"""The command ``fit``: identify laws of a fabric from tests."""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .. import __version__, io
from ..calibration import report
from ..calibration.choice import Choice, Test
from ..calibration.fitting import FabricFit, fit_tests
from ..calibration.simulation import FIBRES, Simulation
from ..calibration.specimens import Specimen
from ..calibration.tests_file import READERS, read_tests
from ..calibration.validation import Validation, refuse_others, validate
from ..fabric import Fabric, Linear
from ..fabric.files import write_law
from ..mesh.progress import shown
from ..mesh.user_input import errors_in, printable
from ..scenes.shear_test import BiasExtension
from .fit_report import REPORT, Reported, pictures_of, write_fit_page
from .interruption import held
from .output import say
from .result_folder import ResultFolder

# Notes on properties that no test has determined.
_NO_TENSION = (
    f"the fibre stiffness in fabric.json is the default, {FIBRES:g} N/mm: pass "
    "--fibre-stiffness, or fit biaxial tests with --fabric and this fabric.json"
)
_ONE_FAMILY = (
    "the tension of the {} in fabric.json is the default, "
    f"{FIBRES:g} N/mm: fit strips along it too, or repeat the fit with --fabric"
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

# Options of a fit that are fields of `Choice`.
_CHOICE = "degree", "points", "extrapolation"

# Output files of a fit.
_LAWS = {
    **{"shear": "shear_law.json", "both": "tension_law.json"},
    **{"warp": "warp_law.json", "weft": "weft_law.json"},
    "bending warp": "bending_warp_law.json",
    "bending weft": "bending_weft_law.json",
}
_ONE_LAW = "law.json"
_FILES = "summary.json", "fabric.json", REPORT, _ONE_LAW, *_LAWS.values()


def run(options: Namespace) -> int:
    """Fit laws to the data files and write them; returns the exit code."""
    with shown("fitting", printed=True):
        tests = _tests(options)
        base = _base_fabric(options, tests)
        held_out = _held_out(options, tests)
        result = _fitted(options, tests, base)
        found = validate(result, base, held_out, _simulation(options, base))
    reports = report.reports_of(result)
    _add_missing(options, result, reports)
    reported = Reported(
        reports,
        report.data_report(result, held_out),
        report.joint_report(result),
        report.validation_report(found),
    )
    inputs = {k: v for k, v in vars(options).items() if k not in ("command", "out")}
    inputs["data"] = [str(path) for path in options.data]
    if inputs.get("validate") is not None:
        inputs["validate"] = str(options.validate)
    laws = {
        part: law
        for part, law in result.laws.items()
        if not (part.startswith("bending") and isinstance(law, Linear))
    }
    pictures, no_pictures = _pictures(options, result, held_out, found)
    with held(), ResultFolder(options.out, _FILES) as folder:
        for part, law in laws.items():
            name = _ONE_LAW if len(laws) == 1 else _LAWS[part]
            write_law(law, folder / name)
        fabric = result.fabric(base)
        io.write_fabric(folder / "fabric.json", fabric, origin=result.origin())
        tables = _tables(options, result)
        choice = result.choice if options.test == "joint" else None
        write_fit_page(
            *(folder, reported, fabric, tables, pictures, no_pictures, inputs, choice)
        )
        version = {"inputs": {"version": __version__, **inputs}}
        io.write_summary(reported._asdict() | version, folder / "summary.json")
    reported.say()
    say(f"results written to {printable(options.out)}: open {REPORT}")
    return 0


def _tests(options: Namespace) -> list[Test]:
    if options.test == "joint":
        return [test for path in options.data for test in read_tests(path)]
    return list(READERS[options.test](options))


def _fitted(options: Namespace, tests: Sequence[Test], base: Fabric) -> FabricFit:
    known = vars(options)
    how = {key: known[key] for key in _CHOICE if key in known}
    if options.test == "joint":
        how |= {"shear": options.shear_law, "tension": options.tension_law}
        how["bending"] = options.bending_law
    elif options.test in ("cantilever", "bending"):
        how |= {"bending": options.law, "bending_degree": how.pop("degree")}
    elif "law" in known:
        how["shear" if "degree" in known else "tension"] = options.law
    if known.get("up_to") is not None:
        how["up_to"] = float(np.radians(options.up_to))
    choice = Choice(**how, bounds=dict(known.get("bound", ())) or None)
    simulation = None if known.get("simulate") is None else _simulation(options, base)
    return fit_tests(tests, choice, simulation)


def _held_out(options: Namespace, fitted: Sequence[Test]) -> list[Test]:
    """Tests that are predicted, not fitted."""
    path = getattr(options, "validate", None)
    if path is None:
        return []
    if not any(isinstance(one, Specimen) for one in fitted):
        raise ValueError(
            "--validate requires a fitted shear law: fit a shear test as well, or omit "
            "--validate"
        )
    tests = read_tests(path)
    refuse_others(tests)
    return tests


def _simulation(options: Namespace, base: Fabric) -> Simulation:
    across = getattr(options, "simulate", None)
    if across is None:
        return Simulation(base.tension)
    with errors_in("--simulate: "):
        return Simulation(base.tension, across)


def _tables(options: Namespace, result: FabricFit) -> list[str]:
    """Tables of a case file whose laws are known: fitted, or given by an option."""
    known = {"both": "tension", "warp": "tension", "weft": "tension", "shear": "shear"}
    found = {known.get(part, "bending") for part in result.parts}
    if options.fabric is not None:
        found = {"tension", "shear", "bending"}
    elif getattr(options, "fibre_stiffness", None) is not None:
        found.add("tension")
    return sorted(found)


def _pictures(
    options: Namespace,
    result: FabricFit,
    held_out: Sequence[Test],
    found: Sequence[Validation],
) -> tuple[dict[str, dict[str, str]], str]:
    """Pictures of the page, or the reason why there are none."""
    if options.no_render:
        return {}, "The page contains no pictures, by the option --no-render."
    try:
        return pictures_of(result, [*result.tests, *held_out], found), ""
    except ImportError as error:
        return {}, f"The pictures were not drawn: {printable(error)}."


def _add_missing(
    options: Namespace, result: FabricFit, reports: dict[str, dict[str, Any]]
) -> None:
    """Add notes on properties of the fabric that no test has determined."""
    if options.fabric is not None:
        return
    tension, shear = {"warp", "weft", "both"} & set(result.parts), result.specimens
    stiffness = getattr(options, "fibre_stiffness", None)
    note = ""
    if not tension and not shear:
        note = _NO_LAWS
    elif not shear:
        note = _NO_SHEAR
    elif not tension and stiffness is None:
        note = _NO_TENSION
    elif len(tension) == 1 and "both" not in tension and stiffness is None:
        note = _ONE_FAMILY.format("weft" if "warp" in tension else "warp")
    if note:
        for one in reports.values():
            one["notes"].append(note)


def _base_fabric(options: Namespace, tests: Sequence[Test]) -> Fabric:
    """Fabric of --fabric, or a plain one with the directions of the first test."""
    stiffness = getattr(options, "fibre_stiffness", None)
    specimens = [one for one in tests if isinstance(one, Specimen)]
    if options.fabric is not None:
        base = io.read_fabric(options.fabric).fabric
    elif not specimens:
        base = Fabric()
    else:
        base, shear_test = Fabric(FIBRES), specimens[0].test
        if isinstance(shear_test, BiasExtension):
            theta = shear_test.inclination
            c, s = float(np.cos(theta)), float(np.sin(theta))
            base = Fabric(FIBRES, 0.0, (c, s), (-c, s))
    return base if stiffness is None else replace(base, tension=stiffness)
