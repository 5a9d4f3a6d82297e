"""Numbers that laws are made of, checked."""

import math
from typing import Any

import numpy as np

from .law import BiaxialLaw, Law, domain_of, law_at

# A law vanishes at rest if it is below this share of what it is nearby: round-off.
_NOTHING = 1e-9


def number(name: str, value: Any, above: float | None = None) -> float:
    """A parameter of a law as a finite number.

    Parameters
    ----------
    name
        What it is, for the message.
    value
        What was given.
    above
        What it must be larger than; without it any finite number >= 0 will do.

    Raises
    ------
    ValueError
        If it is no such number.
    """
    least = ">= 0" if above is None else f"> {above:g}"
    try:
        found = float(value)
    except (TypeError, ValueError):
        found = math.nan
    large_enough = found >= 0 if above is None else found > above
    if not (math.isfinite(found) and large_enough):
        raise ValueError(f"{name} must be a finite number {least}, got {value!r}")
    return found


def pair(name: str, value: Any, above: float | None = None) -> tuple[float, float]:
    """A parameter of warp and weft: one number for both, or two.

    Parameters
    ----------
    name, value, above
        As for `number`.

    Raises
    ------
    ValueError
        If it is no such number, nor two of them, or differs from element to element.
    """
    if isinstance(value, np.ndarray):
        raise ValueError(
            f"{name} must be a number or a pair (warp, weft), the same in every "
            "element; give each subdomain a fabric instead"
        )
    both = tuple(value) if isinstance(value, tuple | list) else (value, value)
    if len(both) != 2:
        raise ValueError(
            f"{name} must be a number or a pair (warp, weft), got {value!r}"
        )
    return number(name, both[0], above), number(name, both[1], above)


def inner_law(name: str, law: Any) -> Law:
    """A law that another law is made of: the same in every element.

    Raises
    ------
    ValueError
        If it has no energy, value and tangent, or differs from element to element.
    """
    parts = ("energy", "value", "tangent")
    if isinstance(law, type) or not all(hasattr(law, part) for part in parts):
        raise ValueError(f"{name} must be a law, such as Linear(5e3), got {law!r}")
    if isinstance(law, BiaxialLaw):
        raise ValueError(f"{name} must be a law of one strain, got {law!r}")
    if hasattr(law, "region") or law_at(law, None) is not law:
        raise ValueError(
            f"{name} must be the same law in every element; give each subdomain a "
            "fabric instead"
        )
    return law


def refuse_force_at_rest(name: str, law: Law, strain: float) -> None:
    """Refuse a law that does not vanish at rest, or does not hold up to a strain.

    Raises
    ------
    ValueError
        If so.
    """
    low, high = domain_of(law)
    if not low <= min(strain, 0.0) <= max(strain, 0.0) <= high:
        raise ValueError(
            f"{name} must hold from 0 to the switch at {strain:g}, but its domain is "
            f"{low:g} to {high:g}"
        )
    rest, there = law.value(np.array([0.0, strain]))
    if not abs(rest) <= _NOTHING * abs(there):
        raise ValueError(f"{name} must vanish at rest, but is {rest:.4g} N/mm there")
