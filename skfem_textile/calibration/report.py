"""Reports of fits: their figures as JSON, notes in sentences, and the text."""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from ..fabric.files import law_to_json
from ..solve.verdict import excess
from .biaxial import FAMILIES
from .curves import rest_notes, seems_swapped
from .regression import CONFIDENCE, Fit
from .shear import APART

if TYPE_CHECKING:
    from .bending import BendingFit
    from .biaxial import TensionFit
    from .shear import ShearFit, Specimen


#: Shear angles in degrees at which moments are reported, as far as the data go.
ANGLES = tuple(range(5, 90, 5))

# Fabrics of nearly inextensible fibres are strained by less, crimp included.
_MOST_STRAIN = 0.5


def shear_report(found: "ShearFit") -> dict[str, Any]:
    """The report of a shear law: numbers, lists and text."""
    fit, specimens = found.fit, []
    for i, specimen in enumerate(found.specimens):
        measured = specimen.measured_angle is not None
        more = {
            "left_out": int(np.sum(~specimen.used(found.up_to))),
            "angle": "measured" if measured else "theoretical",
            "kinematics_hold_to_deg": _holds(specimen),
            "test": repr(specimen.test),
        }
        specimens.append(_curve(fit, i) | more)
    return {
        **_law("shear", fit),
        "compared_with": "simulations" if found.simulated else "closed forms",
        "kinematics_hold_to_deg": min(map(_holds, found.specimens)),
        "largest_angle_deg": float(np.degrees(found.largest_angle)),
        "specimens": specimens,
        "moments": _moments(found),
        "notes": [*_notes(fit), *_range_notes(found), *_falling_notes(found)],
    }


def tension_report(found: "TensionFit") -> dict[str, Any]:
    """The reports of tension laws, by ``warp`` and ``weft``, or ``both``."""
    reports = {}
    for name, one in found.fits.items():
        families = [i for i, family in enumerate(FAMILIES) if name in (family, "both")]
        largest = max(float(c.strain[families].max()) for c in found.curves)
        reports[name] = _law("tension", one) | {
            "largest_strain": largest,
            "curves": [_curve(one, i) for i in range(len(one.samples))],
            "notes": [*_notes(one), *_tension_notes(found, families)],
        }
        if one.beyond_noise:
            reports[name]["notes"].append(
                "tests at several ratios of the strains contradict a tension of one "
                "strain: take crimp-interchange, whose tensions take both"
            )
    return reports


def bending_report(found: "BendingFit") -> dict[str, Any]:
    """The report of a bending stiffness."""
    low, high = found.interval
    largest = float(np.abs(found.by_peirce / found.by_elastica - 1).max())
    readings = [
        {
            "name": test.name,
            "overhang_mm": float(length),
            "chord_angle_deg": float(np.degrees(angle)),
        }
        for test in found.tests
        for length, angle in zip(test.overhang, test.angle, strict=True)
    ]
    both = zip(found.by_elastica, found.by_peirce, strict=True)
    for reading, (exact, simple) in zip(readings, both, strict=True):
        reading |= {"by_elastica_N_mm": float(exact), "by_peirce_N_mm": float(simple)}
    return {
        "of": "bending",
        "confidence": CONFIDENCE,
        "bending_N_mm": found.stiffness,
        "low_N_mm": low,
        "high_N_mm": high,
        "by_peirce_N_mm": float(found.by_peirce.mean()),
        "readings": readings,
        "notes": [
            f"Peirce's formula is off by up to {100 * largest:.1f} % at these "
            "angles: the stiffness is that of the elastica"
        ],
    }


def _law(of: str, fit: Fit) -> dict[str, Any]:
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


def _moments(found: "ShearFit") -> list[dict[str, Any]]:
    """C at `ANGLES`: the law, its band, and each specimen alone."""
    reach = np.degrees(found.largest_angle) + 1e-9
    angles = np.array([angle for angle in ANGLES if angle <= reach], dtype=float)
    gamma, fit = np.radians(angles), found.fit

    def value(law: Any) -> ndarray:
        return law.value(gamma)

    C, band, alone = value(fit.law), fit.band(value), fit.singles
    own = [] if alone is None else [value(fit.model.build(one)) for one in alone]
    points = [s.pointwise(found.up_to) for s in found.specimens]
    rows = []
    for i, angle in enumerate(angles):
        low, high = band[:, i]
        row = {"angle_deg": angle, "moment": C[i], "low": low, "high": high}
        if own:
            row["between_specimens"] = np.std([one[i] for one in own], ddof=1)
        reduced = [
            float(np.interp(gamma[i], x, y))
            for x, y in points
            if x.size and x[0] <= gamma[i] <= x[-1] * (1 + 1e-9)
        ]
        rows.append({k: float(v) for k, v in row.items()} | {"point_by_point": reduced})
    return rows


def _tension_notes(found: "TensionFit", families: Sequence[int]) -> list[str]:
    """Notes on the curves of families, by their numbers."""
    notes = []
    for i in families:
        for curve in found.curves:
            called = f"{curve.name}, {FAMILIES[i]}"
            notes += rest_notes(called, curve.strain[i], curve.force[i])
            if (largest := float(np.expm1(curve.strain[i].max()))) > _MOST_STRAIN:
                notes.append(
                    f"{called}: strains go up to {100 * largest:.3g} %: look at their "
                    "unit"
                )
    return notes


def _holds(specimen: "Specimen") -> float:
    """Shear angle in degrees up to which the kinematics of a test hold."""
    return float(np.degrees(specimen.kinematics_hold_to))


def _notes(fit: Fit) -> list[str]:
    """Sentences on the fit of any law."""
    notes = []
    if fit.beyond_noise:
        notes.append(
            f"curves differ beyond their noise (probability {fit.differ:.2g}): bands "
            "are those of the mean of such specimens"
        )
    names = np.array([sample.name for sample in fit.samples])
    if fit.systematic.any():
        notes.append(
            f"residuals hang together ({', '.join(names[fit.systematic])}): the law "
            "does not follow the curve; bands count fewer points for it"
        )
    if fit.at_bound.any():
        bound = np.array(fit.model.parameters)[fit.at_bound]
        notes.append(f"at a bound, and without a band: {', '.join(bound)}")
    return notes


def _range_notes(found: "ShearFit") -> list[str]:
    end = np.degrees(found.largest_angle)
    notes = [
        f"{specimen.name}: the test goes back and forth, and all of it is fitted as "
        "one curve: keep the rows of one loading"
        for specimen in found.specimens
        if all(specimen.ways(found.up_to))
    ]
    for specimen in found.specimens:
        notes += _beginning_notes(specimen, found.up_to)
    if found.stabilisation is not None:
        shares = {"energy": {"stabilisation": found.stabilisation}}
        if carried := excess(shares, "stabilisation"):
            notes.append(
                f"the stabilisation of the simulations carries up to {carried}: the "
                "law makes up for the error of a coarse mesh: double --simulate until "
                "the law stays"
            )
        return notes
    for specimen in found.specimens:
        holds = _holds(specimen)
        if specimen.measured_angle is None:
            if end > holds + 1e-9:
                notes.append(
                    f"{specimen.name}: points up to {end:.1f} degrees are fitted, but "
                    f"the theoretical angle is believed to {holds:g} degrees only: "
                    "measure the angle, or fit by simulation"
                )
        elif specimen.theoretical_angle is not None and holds < end - 1e-9:
            notes.append(
                f"{specimen.name}: the measured angle leaves the theoretical one by "
                f"more than {np.degrees(APART):g} degrees past {holds:.1f} degrees"
            )
    return list(dict.fromkeys(notes))


def _beginning_notes(specimen: "Specimen", up_to: float | None) -> list[str]:
    name, used = specimen.name, specimen.used(up_to)
    forth, back = specimen.ways(up_to)
    if forth and back:
        return []
    notes = []
    if back:
        notes.append(
            f"{name}: the test only goes back from row to row, as in unloading: keep "
            "the rows of the loading"
        )
    force = specimen.force[used]
    if seems_swapped(specimen.driven[used], force):
        what = "shear angle" if specimen.displacement is None else "displacement"
        notes.append(
            f"{name}: the force rises in equal steps and the {what} does not: look "
            "whether the columns are swapped, unless the force drove the test"
        )
    return notes + rest_notes(name, specimen.angle[used], force)


def _falling_notes(found: "ShearFit") -> list[str]:
    """A sentence on a law that falls somewhere in the range of the data."""
    gamma = np.linspace(0.0, found.largest_angle * (1 - 1e-9), 201)
    falls = gamma[found.fit.law.tangent(gamma) < 0]
    if not falls.size:
        return []
    return [
        f"the moment falls from {np.degrees(falls[0]):.1f} degrees on: such a fabric "
        "may be unstable in a simulation"
    ]


def report_text(reports: Mapping[str, Mapping[str, Any]]) -> str:
    """Reports as text in Markdown, by their titles."""
    import jinja2

    # Markdown of names and numbers: nothing is escaped, as in a page of HTML.
    environment = jinja2.Environment(
        autoescape=False, trim_blocks=True, keep_trailing_newline=True
    )
    environment.filters["g"] = lambda number, digits=4: f"{number:.{digits}g}"
    template = files(__package__).joinpath("report.md").read_text(encoding="utf-8")
    return environment.from_string(template).render(reports=reports)
