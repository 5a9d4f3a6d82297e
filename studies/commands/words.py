"""Results of the study in words, as pages say them."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..study import Row
from .documented import STRIPS, Results
from .results import by_case

_UP = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MINUS = str.maketrans("-", "−")

# Width in mm and inclination of the fibres of the bias extension of `_loads`.
_WIDTH, _THETA = 50.0, np.pi / 4

# Numbers from here on are written without a power of ten.
_PLAIN = 1e-3


def figures(rows: Sequence[Row]) -> dict[str, str]:
    """Results by name, of the cases that are among the rows."""
    found, words = by_case(rows), dict[str, str]()
    for name, words_of in _BY_CASE.items():
        if name in found:
            words |= words_of(found[name])
    return words


def powers(number: float) -> str:
    """A number to two digits, with a power of ten where it is small or large.

    Examples
    --------
    >>> powers(3.81e-7), powers(0.0192), powers(1e5)
    ('3.8·10⁻⁷', '0.019', '10⁵')
    """
    if _PLAIN <= abs(number) < 1 / _PLAIN:
        return f"{number:.2g}"
    digits, _, power = f"{number:.1e}".partition("e")
    factor = "" if float(digits) == 1 else f"{float(digits):g}·"
    return f"{factor}10{str(int(power)).translate(_UP)}"


def _signed(number: float, unit: str, digits: str) -> str:
    return f"{number:{digits}} {unit}".translate(_MINUS)


def _strip(case: Results) -> dict[str, str]:
    """Results of the strip by formulation: full, point and macro."""
    words: dict[str, str] = {}
    for short, title in zip(("full", "point", "macro"), STRIPS, strict=True):
        force = case[f"reaction_x, {title}"]
        digits = ".0f" if abs(force) > 100 else ".2f"
        position = case[f"displacement_error_rms, {title}"]
        strain = 100 * case[f"max_fibre_strain, {title}"]
        words |= {
            f"strip_force_{short}": _signed(force, "N", digits),
            f"strip_position_{short}": f"{position:.3f} mm",
            f"strip_strain_{short}": f"{strain:.2g} %",
        }
    locked, point, macro = (case[f"displacement_error_rms, {t}"] for t in STRIPS)
    words["strip_position_point_over_full"] = f"{point / locked:.1f}"
    words["strip_position_full_over_macro"] = f"{locked / macro:.1f}"
    return words


def _hemisphere(case: Results) -> dict[str, str]:
    return {
        "hemisphere_estimate": f"{case['estimated_shear_angle_error_deg']:.2f}°",
        "hemisphere_error": f"{case['shear_angle_error_rms_deg']:.3f}°",
    }


def _bent_hemisphere(case: Results) -> dict[str, str]:
    return {"hemisphere_at_risk": f"{100 * case['wrinkle_risk_share_of_area']:.0f} %"}


def _hanging(case: Results) -> dict[str, str]:
    return {
        "hanging_tip": _signed(case["tip_z_mm"], "mm", ".1f"),
        "hanging_elastica": _signed(case["exact_tip_z_mm"], "mm", ".1f"),
    }


def _tutorial(case: Results) -> dict[str, str]:
    return {"tutorial_error": f"{100 * case['estimated_load_error, 1']:.0f} %"}


def _shares(case: Results) -> dict[str, str]:
    return {
        "unsheared_energy": f"{100 * case['energy_share_of_stabilisation']:.1f} %",
        "unsheared_work": f"{100 * case['work_share_of_stabilisation']:.0f} %",
        "unsheared_forces": f"{100 * case['reaction_share_of_stabilisation']:.2f} %",
    }


def _pulls(case: Results) -> dict[str, str]:
    return {
        "pull_at_50": f"{case['50°']:.1f} mm",
        "pull_at_90": f"{case['90°']:.1f} mm",
    }


def _loads(case: Results) -> dict[str, str]:
    """Loads, the force of a fibre at a corner, and what four of them bring."""
    load, moment = case["linear"], 0.5 * np.radians(20)
    corner = load / (2 * np.sin(_THETA)) - _WIDTH * moment / (2 * np.cos(_THETA))
    return {
        "load_sin2": f"{case['sin²']:.2f} N",
        "load_linear": f"{load:.2f} N",
        "corner_force": f"{corner:.1f} N",
        "corner_forces": f"{2 * corner * np.sin(_THETA):.1f} of the {load:.1f} N",
    }


def _hole(case: Results) -> dict[str, str]:
    return {"hole_estimate": f"{100 * case['estimated_load_error']:.1f} %"}


def _half_size(case: Results) -> dict[str, str]:
    change = case["force, 1"] / case["force, 2"] - 1
    return {"hole_change": f"{100 * abs(change):.1f} %"}


_BY_CASE: Mapping[str, Callable[[Results], dict[str, str]]] = {
    "strip": _strip,
    "on a tool: hemisphere": _hemisphere,
    "on a tool: hemisphere --tension 0 --set bending.warp_N_mm=5 bending.weft_N_mm=5": (
        _bent_hemisphere
    ),
    "hanging strip": _hanging,
    "tutorial": _tutorial,
    "stabilisation without shear": _shares,
    "pull of a bias extension": _pulls,
    "load of a bias extension": _loads,
    "ply with a hole": _hole,
    "ply with a hole, half the element size": _half_size,
}
