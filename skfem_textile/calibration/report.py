"""Reports of fits: numbers for JSON, statements and notes."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric.files import law_to_json
from ..fabric.law import domain_of
from ..scenes.shear_test import BiasExtension, PictureFrame
from ..solve.verdict import excess
from .bands import CONFIDENCE, Fit
from .bending import BendingCurve, CantileverTest
from .choice import Test, largest_argument, reach
from .curves import beginning_notes, departure_notes, rest_notes
from .cycles import force_of, work
from .fitting import FabricFit
from .measured import FAMILIES
from .outliers import wild
from .specimens import APART, Specimen
from .tensile import BiaxialCurve, Strip
from .validation import Validation

#: Shear angles in degrees at which moments are reported, within the data.
ANGLES = tuple(range(5, 90, 5))

# Largest shear angle in degrees of a test that is probably of another kind or unit:
# fabrics are sheared by 30 and more.
_SMALL_ANGLE = 5.0

# Upper bound of the strain of fabrics with nearly inextensible fibres, including crimp.
_MOST_STRAIN = 0.5


def reports_of(result: FabricFit) -> dict[str, dict[str, Any]]:
    """Reports of all laws, by title: numbers, lists and text."""
    reports = {}
    for part in result.parts:
        if part == "shear":
            one = shear_report(result)
        elif part.startswith("bending"):
            one = bending_report(result, part)
        else:
            one = tension_report(result, part)
        one["candidates"] = [asdict(x) for x in result.candidates.get(part, ())]
        if part in result.friction:
            of_friction = friction_report(result, part)
            one["friction"], one["notes"] = (
                of_friction,
                [
                    *one["notes"],
                    _friction_note(title_of(part), of_friction),
                ],
            )
        reports[title_of(part)] = one
    return reports


def friction_report(result: FabricFit, part: str) -> dict[str, Any]:
    """Friction elements of a law, and work of the machine in each test with cycles."""
    law, curves = result.laws[part], list[dict[str, Any]]()
    bending = part.startswith("bending")
    unit = "N_per_mm" if bending else "N_mm"
    for one, force in result.loops(part):
        works = work(one, force_of(one)), work(one, force)
        names = f"work_measured_{unit}", f"work_predicted_{unit}"
        curves.append({"name": one.name, **dict(zip(names, works, strict=True))})
    onsets = np.degrees(law.onsets) if part == "shear" else np.array(law.onsets)
    key = "onsets_per_mm" if bending else "onsets_deg" if part == "shear" else "onsets"
    limits = "limits_N" if bending else "limits_N_per_mm"
    return {limits: list(law.limits), key: onsets.tolist(), "curves": curves}


# Units of limits, onsets and work by the keys of a report of friction.
_LIMITS = {"limits_N": "N", "limits_N_per_mm": "N/mm"}
_ONSETS = {"onsets_deg": " degrees", "onsets_per_mm": " 1/mm", "onsets": ""}


def _friction_note(title: str, friction: dict[str, Any]) -> str:
    """The friction elements in a line."""
    ((limit, unit),) = (x for x in _LIMITS.items() if x[0] in friction)
    ((onset, of_onset),) = (x for x in _ONSETS.items() if x[0] in friction)
    pairs = zip(friction[limit], friction[onset], strict=True)
    elements = ", ".join(f"{f:.3g} {unit} at {y:.3g}{of_onset}" for f, y in pairs)
    works = ", ".join(
        "{} {:.4g} and {:.4g}".format(*one.values()) for one in friction["curves"]
    )
    of_work = "N/mm" if limit == "limits_N" else "N·mm"
    return (
        f"{title}: friction elements with the limit at the onset {elements}; curves "
        "and the law above are without them; work over the cycles, measured and "
        f"predicted, in {of_work}: {works}"
    )


def title_of(part: str) -> str:
    """Title of the report of a law."""
    if part == "shear":
        return "Shear"
    if part.startswith("bending"):
        return f"Bending of the {part.split()[1]}"
    return "Tension of both families" if part == "both" else f"Tension of the {part}"


def shear_report(result: FabricFit) -> dict[str, Any]:
    """Report of a shear law: numbers, lists and text."""
    fit, curves, up_to = result.parts["shear"], [], result.choice.up_to
    for i, specimen in enumerate(result.specimens):
        measured = specimen.measured_angle is not None
        more = {
            "left_out": int(np.sum(~specimen.used(up_to))),
            "angle": "measured" if measured else "theoretical",
            "kinematics_hold_to_deg": _valid_up_to(specimen),
            "zeros": _zeros(fit, i),
        }
        curves.append(_curve(fit, i) | more)
    return {
        **law_report("shear", fit),
        "compared_with": "simulations" if result.simulations else "closed forms",
        "kinematics_hold_to_deg": min(map(_valid_up_to, result.specimens)),
        "largest_angle_deg": float(np.degrees(result.largest_angle)),
        "curves": curves,
        "moments": _moments(result),
        "notes": [*_notes(fit), *_range_notes(result)],
    }


def tension_report(result: FabricFit, part: str) -> dict[str, Any]:
    """Report of a tension law: of a family, or of both."""
    fit, curves = result.parts[part], result.along(part)
    strains = (
        along.strain.max()
        for test, families in curves
        for i in families
        if (along := test.along(i))
    )
    notes = [*_notes(fit), *_tension_notes(curves)]
    if (
        fit.model.name == "crimp-toe"
        and "initial_stiffness" not in fit.model.parameters
    ):
        notes.append(
            f"{title_of(part)}: the initial stiffness is "
            f"{fit.law.initial_stiffness:.3g} N/mm, a share of the stiffness, because "
            "tests with an unknown slack do not determine it: specify --slack to fit it"
        )
    if fit.beyond_noise and all(isinstance(x, BiaxialCurve) for x, _ in curves):
        notes.append(
            "tests at several strain ratios contradict a tension that depends on one "
            "strain only: use crimp-interchange, in which tensions depend on both "
            "strains"
        )
    return law_report("tension", fit) | {
        "largest_strain": float(min(max(strains), np.max(domain_of(fit.law)[1]))),
        "curves": [
            _curve(fit, i) | {"zeros": _zeros(fit, i)} for i in range(len(curves))
        ],
        "notes": notes,
    }


def bending_report(result: FabricFit, part: str) -> dict[str, Any]:
    """Report of a bending stiffness or law."""
    fit, tests = result.parts[part], result.tests_of(part)
    units = ["N_mm" if isinstance(x, CantileverTest) else "N_mm_per_mm" for x in tests]
    largest = largest_argument(result.tests, part, None)
    curves = [_curve(fit, i, unit) for i, unit in enumerate(units)]
    found = law_report("bending", fit) | {"curves": curves, "notes": _notes(fit)}
    if fit.model.name != "bending":
        found |= {
            "largest_curvature_per_mm": largest,
            "bending_moments": _bending_moments(fit, largest),
        }
    if cantilevers := result.cantilevers(part):
        of_readings = _readings(cantilevers)
        found["notes"] += of_readings.pop("notes")
        found |= of_readings
    return found


def _readings(tests: Sequence[CantileverTest]) -> dict[str, Any]:
    """Readings of cantilevers, each with its stiffness, and notes."""
    names = "overhang_mm", "chord_angle_deg", "by_elastica_N_mm", "by_peirce_N_mm"
    readings = []
    for test in tests:
        degrees = np.degrees(test.angle)
        columns = test.overhang, degrees, test.by_elastica, test.by_peirce
        for row in np.transpose(columns).tolist():
            readings.append({"name": test.name, **dict(zip(names, row, strict=True))})
    exact, simple = (np.array([row[key] for row in readings]) for key in names[2:])
    largest = float(np.abs(simple / exact - 1).max())
    return {
        "by_peirce_N_mm": float(simple.mean()),
        "readings": readings,
        "notes": [
            *_wild_notes(tests),
            f"the error of Peirce's formula is up to {100 * largest:.1f} % at these "
            "angles: the stiffness is computed with the elastica",
        ],
    }


# Number of curvatures, besides 0, at which bending moments are reported.
_CURVATURES = 10


def _bending_moments(fit: Fit, largest: float) -> list[dict[str, float]]:
    """Moments of a bending law up to the largest curvature of the data."""
    x = np.linspace(0.0, largest, _CURVATURES + 1)[1:]
    moment = fit.law.value(x)
    low, high = fit.band(lambda law: law.value(x))
    names = "curvature_per_mm", "moment_N_mm_per_mm", "low", "high"
    rows = np.transpose([x, moment, low, high]).tolist()
    return [dict(zip(names, row, strict=True)) for row in rows]


def _wild_notes(tests: Sequence[CantileverTest]) -> list[str]:
    """Notes on readings of cantilevers that deviate from the others of their file."""
    notes = []
    for test in tests:
        stiffness = test.by_elastica
        for i in np.flatnonzero(wild(stiffness)):
            read = test.prepared and test.prepared.recording
            row = f"row {read.rows[i]}" if read else f"reading {i + 1}"
            notes.append(
                f"{test.name}, {row}: the stiffness of {stiffness[i]:.3g} N·mm is far "
                f"from the median, {np.median(stiffness):.3g} N·mm: check the reading"
            )
    return notes


def data_report(
    result: FabricFit, held_out: Sequence[Test] = ()
) -> list[dict[str, Any]]:
    """Reports of the tests: what was read, what was done to it, and its use."""
    found = []
    for test in (*result.tests, *held_out):
        read = [] if test.prepared is None else [*test.prepared.read.statements]
        done = [*test.statements[len(read) :]]
        fitted = any(test is one for one in result.tests)
        if fitted:
            done += [
                statement
                for part, fit in result.parts.items()
                for i, one in enumerate(result.tests_of(part))
                if one is test
                for statement in _zero_statements(fit, i)
            ]
            if isinstance(test, Specimen):
                done.append(_range_statement(result, test))
        found.append(
            {
                "name": test.name,
                "test": _kind(test),
                "fitted": fitted,
                "read": read,
                "prepared": done,
            }
        )
    return found


def _kind(test: Test) -> str:
    """Kind and dimensions of a test in words."""
    if isinstance(test, BendingCurve):
        return f"moment over curvature along the {test.family}"
    if isinstance(test, CantileverTest):
        return f"cantilever along the {test.family}, {test.weight:g} N/mm²"
    if isinstance(test, BiaxialCurve):
        warp, weft = test.widths
        return f"biaxial test, {warp:g} mm wide to the warp, {weft:g} mm to the weft"
    if not isinstance(test, Specimen):
        size = f"{test.width:g} × {test.length:g} mm"
        return f"strip along the {test.family}, {size}"
    of = test.test
    if isinstance(of, PictureFrame):
        return f"picture frame of {of.frame:g} mm with fabric of {of.fabric:g} mm"
    assert isinstance(of, BiasExtension)
    theta = np.degrees(of.inclination)
    return f"bias extension, {of.width:g} × {of.height:g} mm, fibres at {theta:g}°"


def _zero_statements(fit: Fit, i: int) -> list[str]:
    """Statements on the zeros of a curve: fitted with the law, or taken as 0."""
    said = []
    for one, offset in zip(_zeros(fit, i), fit.samples[i].offsets, strict=True):
        unit = "" if one["unit"] == "-" else f" {one['unit']}"
        ends = f"{one['low']:.3g} to {one['high']:.3g}{unit}"
        if offset.name in fit.free:
            said.append(
                f"a {one['name']} of {one['value']:.3g}{unit} ({ends}) is estimated "
                "with the law, and its uncertainty is part of the band"
            )
        elif one["high"] > one["low"]:
            said.append(
                f"the data do not reject a {one['name']} of 0, which is used; the band "
                f"allows for {ends}"
            )
    return said


def _range_statement(result: FabricFit, specimen: Specimen) -> str:
    """Statement on the end of the fitted range."""
    used = specimen.used(result.choice.up_to)
    how = "measured" if specimen.measured_angle is not None else "theoretical"
    angle = result.zeroed(result.specimens.index(specimen)).angle
    end = np.degrees(angle[used].max())
    return (
        f"{used.sum()} of {used.size} points are fitted, up to a {how} shear angle of "
        f"{end:.1f}°"
    )


def joint_report(result: FabricFit) -> dict[str, Any]:
    """Parameters of all laws, with their standard deviations and correlations."""
    fit = result.fit.joint
    deviations = np.sqrt(np.diag(fit.covariance))
    scale = np.where(deviations > 0, deviations, 1.0)
    return {
        "parameters": list(fit.model.parameters),
        "units": list(fit.model.units),
        "values": fit.values.tolist(),
        "standard_deviations": deviations.tolist(),
        "correlations": (fit.covariance / np.outer(scale, scale)).tolist(),
    }


def validation_report(found: Sequence[Validation]) -> dict[str, Any]:
    """Report of tests that were not used in the fit."""
    rows, notes = [], []
    for one in found:
        most, prediction = float(np.abs(one.measured).max()), one.prediction
        difference, name = one.difference, one.specimen.name
        half = np.nan_to_num(prediction.discretisation)
        rows.append(
            {
                "name": name,
                "test": repr(one.specimen.test),
                "points": int(difference.size),
                "largest_angle_deg": float(np.degrees(prediction.gamma.max())),
                "slack_mm": one.specimen.slack,
                "rms_N": (rms := float(np.sqrt(np.mean(difference**2)))),
                "rms_over_largest_force": rms / most,
                "largest_N": float(np.abs(difference).max()),
                "largest_over_largest_force": float(np.abs(difference).max()) / most,
                "noise_N": one.noise,
                "parameters_N": float(prediction.pointwise.max()),
                "discretisation_N": float(half.max()),
                "inside_pointwise": one.share(),
                "inside_simultaneous": one.share(simultaneous=True),
                "lost_to_stretch": float(prediction.simulated.lost[-1]),
                "confirmed": one.confirmed,
            }
        )
        if not np.isfinite(prediction.discretisation).all():
            notes.append(
                f"{name}: the discretisation error is unknown, and its interval is not "
                "part of the band"
            )
        if not one.confirmed:
            notes.append(
                f"{name}: the prediction is not confirmed: only "
                f"{100 * one.share(simultaneous=True):.0f} % of the smooth curve is "
                "inside the band of a whole curve"
            )
    return {"of": "validation", "confidence": CONFIDENCE, "rows": rows, "notes": notes}


def _zeros(fit: Fit, i: int) -> list[dict[str, Any]]:
    """Unknown zeros of a curve, with their confidence intervals."""
    units = {offset.name: offset.unit for offset in fit.samples[i].offsets}
    return [
        {"name": name, "unit": units[name], "value": value, "low": low, "high": high}
        for name, (value, low, high) in fit.zeros(i).items()
    ]


def law_report(of: str, fit: Fit) -> dict[str, Any]:
    """Law, parameters and confidence intervals."""
    names = "name", "unit", "value", "low", "high", "at_bound"
    rows = zip(
        *(fit.model.parameters, fit.model.units, fit.values.tolist()),
        *(*fit.intervals.T.tolist(), fit.at_bound.tolist()),
        strict=True,
    )
    return {
        "of": of,
        "name": fit.model.name,
        "law": law_to_json(fit.law),
        "confidence": CONFIDENCE,
        "parameters": [dict(zip(names, row, strict=True)) for row in rows],
        "specimens_differ_probability": fit.differ,
        "specimens_differ_beyond_noise": fit.beyond_noise,
        "systematic": [
            sample.name
            for sample, wrong in zip(fit.samples, fit.systematic, strict=True)
            if wrong
        ],
    }


def _curve(fit: Fit, i: int, unit: str = "N") -> dict[str, Any]:
    """Residuals of a curve, with the unit of its measured values in the keys."""
    sample, residual = fit.samples[i], fit.residuals[i]
    largest = float(np.abs(sample.measured).max())
    rms = float(np.sqrt(np.mean(residual**2)))
    return {
        "name": sample.name,
        "points": int(residual.size),
        f"noise_{unit}": float(fit.noise[i]),
        "noise_over_largest": float(fit.noise[i]) / largest if largest else np.nan,
        f"residual_rms_{unit}": rms,
        "residual_rms_over_largest": rms / largest if largest else np.nan,
        f"residual_largest_{unit}": float(np.abs(residual).max()),
        "correlation_of_neighbours": float(fit.correlations[i]),
    }


def _moments(result: FabricFit) -> list[dict[str, Any]]:
    """C at `ANGLES`: the law, its band, and each specimen alone."""
    end = np.degrees(result.largest_angle) + 1e-9
    angles = np.array([angle for angle in ANGLES if angle <= end], dtype=float)
    gamma, fit = np.radians(angles), result.parts["shear"]

    def value(law: Any) -> ndarray:
        return law.value(gamma)

    C, band, alone = value(fit.law), fit.band(value), fit.singles
    moments = [] if alone is None else [value(fit.model.build(one)) for one in alone]
    specimens = map(result.zeroed, range(len(result.specimens)))
    points = [one.pointwise(result.choice.up_to) for one in specimens]
    rows, scatter = [], fit.scatter(value)
    for i, angle in enumerate(angles):
        low, high = band[:, i]
        row = {"angle_deg": angle, "moment": C[i], "low": low, "high": high}
        if scatter is not None:
            row["specimen_low"], row["specimen_high"] = scatter[:, i]
        if moments:
            row["between_specimens"] = np.std([one[i] for one in moments], ddof=1)
        reduced = [
            float(np.interp(gamma[i], x, y))
            for x, y in points
            if x.size and x[0] <= gamma[i] <= x[-1] * (1 + 1e-9)
        ]
        rows.append({k: float(v) for k, v in row.items()} | {"point_by_point": reduced})
    return rows


def _tension_notes(
    curves: Sequence[tuple[Strip | BiaxialCurve, list[int]]],
) -> list[str]:
    """Notes on the curves of some families."""
    notes = []
    for test, families in curves:
        for i in families:  # from the first row on, also within the slack
            along = replace(test, assumed_slack=None).along(i)
            if along is None:
                continue
            called = f"{test.name}, {FAMILIES[i]}"
            known = not test.slack_is_unknown
            notes += rest_notes(called, along.strain, along.force, known)
            if (largest := float(np.expm1(along.strain.max()))) > _MOST_STRAIN:
                notes.append(
                    f"{called}: strains reach {100 * largest:.3g} %: check their unit"
                )
    return notes


def _valid_up_to(specimen: Specimen) -> float:
    """Shear angle in degrees up to which the kinematics of a test are valid."""
    return float(np.degrees(specimen.kinematics_limit))


def _notes(fit: Fit) -> list[str]:
    """Notes on the fit of any law."""
    notes = []
    if fit.beyond_noise:
        notes.append(
            f"curves differ significantly (probability {fit.differ:.2g}): bands "
            "describe the mean of such specimens"
        )
    names = np.array([sample.name for sample in fit.samples])
    if fit.systematic.any():
        notes.append(
            f"residuals are correlated ({', '.join(names[fit.systematic])}): the law "
            "does not represent the curve; bands are computed with fewer points for it"
        )
    weak = _undetermined(fit)
    if weak.any():
        names_of = ", ".join(np.array(fit.model.parameters)[weak])
        notes.append(
            f"the bands of {names_of} contain 0 or a limit of the law: the data do not "
            "determine them: use a law with fewer parameters, or further tests"
        )
    if fit.at_bound.any():
        bound = np.array(fit.model.parameters)[fit.at_bound]
        notes.append(
            f"parameters at a bound, which have no confidence band: {', '.join(bound)}"
        )
    return notes


def _undetermined(fit: Fit) -> ndarray:
    """Mask of parameters whose bands contain 0 or a limit of the law."""
    low, high = fit.intervals.T
    within = (low > fit.model.low) & (high < fit.model.high) & (low * high > 0)
    return ~within & ~fit.at_bound


def _range_notes(result: FabricFit) -> list[str]:
    up_to = result.choice.up_to
    notes = [
        f"{specimen.name}: the test contains loading and unloading, and both are "
        "fitted as one curve: keep only the rows of a single loading"
        for specimen in result.specimens
        if all(specimen.ways(up_to)) and not specimen.cyclic
    ]
    for specimen in result.specimens:
        notes += beginning_notes(specimen, up_to)
        notes += departure_notes(specimen, up_to)
        reached = np.degrees(np.nanmax(specimen.angle))
        if reached < _SMALL_ANGLE:
            notes.append(
                f"{specimen.name}: the shear angle reaches only {reached:.2g} degrees: "
                "check the kind of test, the units and the sizes"
            )
    if result.stabilisation is not None:
        shares = {"energy": {"stabilisation": result.stabilisation}}
        if excessive := excess(shares, "stabilisation"):
            notes.append(
                f"the stabilisation of the simulations contributes up to {excessive}, "
                "and the law compensates for the error of this coarse mesh: double "
                "--simulate until the law converges"
            )
        return notes
    for specimen in result.specimens:
        holds, end = _valid_up_to(specimen), np.degrees(reach(specimen, up_to))
        if specimen.measured_angle is None:
            if end > holds + 1e-9:
                notes.append(
                    f"{specimen.name}: points up to {end:.1f} degrees are fitted, but "
                    f"the theoretical angle is reliable only up to {holds:g} degrees: "
                    "measure the angle, or fit by simulation"
                )
        elif specimen.theoretical_angle is not None and holds < end - 1e-9:
            notes.append(
                f"{specimen.name}: the measured angle differs from the theoretical "
                f"one by more than {np.degrees(APART):g} degrees beyond {holds:.1f} "
                "degrees"
            )
    return list(dict.fromkeys(notes))
