"""Reports of fits: JSON figures, notes, and text."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from ..fabric.files import law_to_json
from ..solve.verdict import excess
from .bands import CONFIDENCE, Fit
from .curves import beginning_notes, rest_notes
from .measured import FAMILIES
from .specimens import APART, Specimen

if TYPE_CHECKING:
    from .biaxial import BiaxialCurve
    from .fitting import FabricFit
    from .strip import Strip
    from .validation import Validation


#: Shear angles in degrees at which moments are reported, within the data.
ANGLES = tuple(range(5, 90, 5))

# Upper bound of the strain of fabrics with nearly inextensible fibres, including crimp.
_MOST_STRAIN = 0.5


def reports_of(result: "FabricFit") -> dict[str, dict[str, Any]]:
    """Reports of all laws, by title: numbers, lists and text."""
    reports = {}
    for part in result.parts:
        if part == "shear":
            title = "Shear"
            reports[title] = shear_report(result)
        elif part.startswith("bending"):
            title = f"Bending of the {part.split()[1]}"
            reports[title] = bending_report(result, part)
        else:
            title = f"Tension, {part}"
            reports[title] = tension_report(result, part)
        reports[title]["candidates"] = [
            asdict(one) for one in result.candidates.get(part, ())
        ]
    return reports


def shear_report(result: "FabricFit") -> dict[str, Any]:
    """Report of a shear law: numbers, lists and text."""
    fit, specimens, up_to = result.parts["shear"], [], result.choice.up_to
    for i, specimen in enumerate(result.specimens):
        measured = specimen.measured_angle is not None
        more = {
            "left_out": int(np.sum(~specimen.used(up_to))),
            "angle": "measured" if measured else "theoretical",
            "kinematics_hold_to_deg": _valid_up_to(specimen),
            "test": repr(specimen.test),
            "zeros": _zeros(fit, i),
            "statements": list(specimen.statements),
        }
        specimens.append(_curve(fit, i) | more)
    return {
        **law_report("shear", fit),
        "compared_with": "simulations" if result.simulations else "closed forms",
        "kinematics_hold_to_deg": min(map(_valid_up_to, result.specimens)),
        "largest_angle_deg": float(np.degrees(result.largest_angle)),
        "specimens": specimens,
        "moments": _moments(result),
        "notes": [
            *_notes(fit),
            *_zero_notes(fit),
            *_range_notes(result),
        ],
    }


def tension_report(result: "FabricFit", part: str) -> dict[str, Any]:
    """Report of a tension law: of a family, or of both."""
    fit, curves = result.parts[part], result.along(part)
    strains = (
        along.strain.max()
        for test, families in curves
        for i in families
        if (along := test.along(i))
    )
    notes = [*_notes(fit), *_zero_notes(fit), *_tension_notes(curves)]
    if fit.beyond_noise:
        notes.append(
            "tests at several strain ratios contradict a tension that depends on one "
            "strain only: use crimp-interchange, in which tensions depend on both "
            "strains"
        )
    return law_report("tension", fit) | {
        "largest_strain": float(max(strains)),
        "curves": [
            _curve(fit, i)
            | {"zeros": _zeros(fit, i), "statements": list(test.statements)}
            for i, (test, _) in enumerate(curves)
        ],
        "notes": notes,
    }


def bending_report(result: "FabricFit", part: str) -> dict[str, Any]:
    """Report of a bending stiffness."""
    fit, tests = result.parts[part], result.cantilevers(part)
    (low, high), stiffness = fit.intervals[0], fit.law.stiffness
    readings = [
        {
            "name": test.name,
            "overhang_mm": float(length),
            "chord_angle_deg": float(np.degrees(angle)),
            "by_elastica_N_mm": float(exact),
            "by_peirce_N_mm": float(simple),
        }
        for test in tests
        for length, angle, exact, simple in zip(
            *(test.overhang, test.angle, test.by_elastica, test.by_peirce), strict=True
        )
    ]
    simple, exact = (
        np.array([one[f"by_{name}_N_mm"] for one in readings])
        for name in ("peirce", "elastica")
    )
    largest = float(np.abs(simple / exact - 1).max())
    return {
        "of": "bending",
        "confidence": CONFIDENCE,
        "bending_N_mm": float(stiffness),
        "low_N_mm": float(low),
        "high_N_mm": float(high),
        "by_peirce_N_mm": float(simple.mean()),
        "readings": readings,
        "tests": [
            {"name": test.name, "statements": list(test.statements)} for test in tests
        ],
        "notes": [
            *_notes(fit),
            f"the error of Peirce's formula is up to {100 * largest:.1f} % at these "
            "angles: the stiffness is computed with the elastica",
        ],
    }


def joint_report(result: "FabricFit") -> dict[str, Any]:
    """Parameters of all laws, with their standard deviations and correlations."""
    fit = result.fit.joint
    deviations, _ = fit.deviation(np.eye(fit.values.size))
    scale = np.where(deviations > 0, deviations, 1.0)
    return {
        "parameters": list(fit.model.parameters),
        "units": list(fit.model.units),
        "values": fit.values.tolist(),
        "standard_deviations": deviations.tolist(),
        "correlations": (fit.covariance / np.outer(scale, scale)).tolist(),
    }


def validation_report(found: "Sequence[Validation]") -> dict[str, Any]:
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
                "rms_N": float(np.sqrt(np.mean(difference**2))),
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
                f"{name}: the prediction is not confirmed: "
                f"{100 * one.share(simultaneous=True):.0f} % of the curve is inside "
                "the band of the whole curve"
            )
    return {"of": "validation", "confidence": CONFIDENCE, "rows": rows, "notes": notes}


def _zeros(fit: Fit, i: int) -> list[dict[str, Any]]:
    """Unknown zeros of a curve, with their confidence intervals."""
    units = {offset.name: offset.unit for offset in fit.samples[i].offsets}
    return [
        {"name": name, "unit": units[name], "value": value, "low": low, "high": high}
        for name, (value, low, high) in fit.zeros(i).items()
    ]


def _zero_notes(fit: Fit) -> list[str]:
    """Notes on zeros that the fit takes into account."""
    notes = []
    for i, sample in enumerate(fit.samples):
        found = [one for one in _zeros(fit, i) if one["name"] in fit.free]
        if found:
            text = " and ".join(
                f"{one['name']} of {one['value']:.3g} {one['unit']} ({one['low']:.3g} "
                f"to {one['high']:.3g})"
                for one in found
            )
            notes.append(
                f"{sample.name}: a {text} is estimated with the law, and its "
                "uncertainty is part of the band"
            )
    return notes


def law_report(of: str, fit: Fit) -> dict[str, Any]:
    """Law, parameters and confidence intervals."""
    rows = zip(
        *(fit.model.parameters, fit.model.units, fit.values, fit.intervals),
        fit.at_bound,
        strict=True,
    )
    return {
        "of": of,
        "law": law_to_json(fit.law),
        "confidence": CONFIDENCE,
        "parameters": [
            {
                "name": name,
                "unit": unit,
                "value": float(value),
                "low": float(ends[0]),
                "high": float(ends[1]),
                "at_bound": bool(bound),
            }
            for name, unit, value, ends, bound in rows
        ],
        "specimens_differ_probability": fit.differ,
        "specimens_differ_beyond_noise": fit.beyond_noise,
    }


def _curve(fit: Fit, i: int) -> dict[str, Any]:
    sample, residual = fit.samples[i], fit.residuals[i]
    largest = float(np.abs(sample.measured).max())
    return {
        "name": sample.name,
        "points": int(residual.size),
        "noise_N": float(fit.noise[i]),
        "noise_over_largest": float(fit.noise[i]) / largest if largest else np.nan,
        "residual_rms_N": float(np.sqrt(np.mean(residual**2))),
        "residual_largest_N": float(np.abs(residual).max()),
        "correlation_of_neighbours": float(fit.correlations[i]),
    }


def _moments(result: "FabricFit") -> list[dict[str, Any]]:
    """C at `ANGLES`: the law, its band, and each specimen alone."""
    reach = np.degrees(result.largest_angle) + 1e-9
    angles = np.array([angle for angle in ANGLES if angle <= reach], dtype=float)
    gamma, fit = np.radians(angles), result.parts["shear"]

    def value(law: Any) -> ndarray:
        return law.value(gamma)

    C, band, alone = value(fit.law), fit.band(value), fit.singles
    moments = [] if alone is None else [value(fit.model.build(one)) for one in alone]
    points, scatter = [], fit.scatter(value)
    for i, specimen in enumerate(result.specimens):
        force, *_ = fit.zeros(i).get("force at rest", (specimen.zeros.force or 0.0,))
        points.append(specimen.pointwise(result.choice.up_to, force))
    rows = []
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
    curves: "Sequence[tuple[Strip | BiaxialCurve, list[int]]]",
) -> list[str]:
    """Notes on the curves of some families."""
    notes = []
    for test, families in curves:
        for i in families:
            along = test.along(i)
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
    if fit.at_bound.any():
        bound = np.array(fit.model.parameters)[fit.at_bound]
        notes.append(
            f"parameters at a bound, which have no confidence band: {', '.join(bound)}"
        )
    return notes


def _range_notes(result: "FabricFit") -> list[str]:
    end, up_to = np.degrees(result.largest_angle), result.choice.up_to
    notes = [
        f"{specimen.name}: the test contains loading and unloading, and both are "
        "fitted as one curve: keep only the rows of a single loading"
        for specimen in result.specimens
        if all(specimen.ways(up_to))
    ]
    for specimen in result.specimens:
        notes += beginning_notes(specimen, up_to)
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
        holds = _valid_up_to(specimen)
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


def report_text(reports: Mapping[str, Mapping[str, Any]]) -> str:
    """Reports as text in Markdown, by title."""
    import jinja2

    # Markdown of names and numbers: nothing is escaped, unlike in HTML.
    environment = jinja2.Environment(
        autoescape=False, trim_blocks=True, keep_trailing_newline=True
    )
    environment.filters["g"] = lambda number, digits=4: f"{number:.{digits}g}"
    template = files(__package__).joinpath("report.md").read_text(encoding="utf-8")
    return environment.from_string(template).render(reports=reports)
