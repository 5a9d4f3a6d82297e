"""Lay-ups in the usual notation, and fabrics that are turned in their plane."""

import re
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.user_input import MOST_DEGREES, call_user_function, excerpt
from .directions import at_angles
from .fabric import Direction, Fabric
from .regions import RegionalDirection

_EXAMPLE = "a lay-up is written as '[0/90, ±45]s'"

# A lay-up: its plies, the number of repetitions, and a letter s.
_LAYUP = re.compile(r"\[([^\[\]]*)\](.*)", re.DOTALL)
_SUFFIX = re.compile(r"([1-9]\d{0,2})?(s?)", re.ASCII | re.IGNORECASE)

# An angle; and a ply: an angle with two signs, or one angle or two.
_ANGLE = r"([-+]?(?:\d+\.?\d*|\.\d+))"
_TWO_SIGNS = re.compile(r"(?:±|\+-)(\d+\.?\d*|\.\d+)", re.ASCII)
_ANGLES = re.compile(rf"{_ANGLE}(?:\s*/\s*{_ANGLE})?", re.ASCII)

# Angle in degrees within which an entry agrees with a fabric; most plies.  Chosen.
_SAME, _MOST_PLIES = 1e-6, 200


def layup_angles_deg(text: str, crossing_deg: float = 90.0) -> tuple[float, ...]:
    """Angles by which the fabric of each ply of a lay-up is turned.

    Parameters
    ----------
    text
        Plies from the bottom to the top in brackets, separated by commas.  ``0/90`` has
        the warp at 0° and the weft at 90°, ``±45`` or ``+-45`` the warp at 45° and the
        weft at −45°, and ``30`` the fabric turned by 30°.  A number after the brackets
        repeats the plies, and then a letter s adds them in reverse order.
    crossing_deg
        Angle from warp to weft of the fabric in degrees.

    Returns
    -------
    tuple of float
        Angles of the warp in degrees, counterclockwise, from the lowest ply.

    Raises
    ------
    ValueError
        If the text cannot be read, or the angle between the families of a ply differs
        from the one of the fabric.

    Examples
    --------
    >>> layup_angles_deg("[0/90, ±45]s")
    (0.0, 45.0, 45.0, 0.0)
    >>> layup_angles_deg("[30/120, -45/45]2")
    (30.0, -45.0, 30.0, -45.0)
    """
    whole = _LAYUP.fullmatch(text.strip()) if isinstance(text, str) else None
    if whole is None:
        raise ValueError(
            f"the lay-up {excerpt(str(text))!r} has no plies in one pair of brackets: "
            f"{_EXAMPLE}"
        )
    suffix = _SUFFIX.fullmatch(whole[2].strip())
    if suffix is None:
        raise ValueError(
            f"the lay-up {excerpt(text)!r} ends with {excerpt(whole[2])!r}, which is "
            f"neither s nor a number of repetitions: {_EXAMPLE}"
        )
    entries = [entry.strip() for entry in whole[1].split(",")]
    times, mirrored = int(suffix[1] or 1), bool(suffix[2])
    if (n := len(entries) * times * (1 + mirrored)) > _MOST_PLIES:
        raise ValueError(
            f"the lay-up {excerpt(text)!r} has {n} plies, more than {_MOST_PLIES}: "
            "use fewer"
        )
    angles = [_angle_deg(text, entry, crossing_deg) for entry in entries] * times
    return tuple(angles + angles[::-1] * mirrored)


def _angle_deg(text: str, entry: str, crossing_deg: float) -> float:
    """Angle of the warp of a ply in degrees."""
    plain = entry.replace("−", "-").replace("°", "")
    if found := _TWO_SIGNS.fullmatch(plain):
        stated = [float(found[1]), -float(found[1])]
    elif found := _ANGLES.fullmatch(plain):
        stated = [float(angle) for angle in found.groups() if angle]
    else:
        raise ValueError(
            f"the lay-up {excerpt(text)!r} has a ply {excerpt(entry)!r}, which is "
            f"neither an angle nor a pair of angles in degrees: {_EXAMPLE}"
        )
    if max(map(abs, stated)) > MOST_DEGREES:
        raise ValueError(
            f"the lay-up {excerpt(text)!r} has a ply {excerpt(entry)!r}: angles must "
            f"be within ±{MOST_DEGREES:g}°"
        )
    between = stated[-1] - stated[0]
    off = (between - crossing_deg + 90.0) % 180.0 - 90.0
    if len(stated) == 2 and abs(off) > _SAME:
        raise ValueError(
            f"the lay-up {excerpt(text)!r} has a ply {excerpt(entry)!r} with "
            f"{between % 180.0:g}° from warp to weft, but the fabric has "
            f"{crossing_deg:g}°: change one of the angles"
        )
    return stated[0] + 0.0  # no -0.0


def turned(fabric: Fabric, angle_deg: float) -> Fabric:
    """The fabric with fibre directions that are turned at every point.

    Parameters
    ----------
    fabric
        The fabric, with directions of any kind.  Functions are evaluated at the same
        positions.
    angle_deg
        Angle in degrees, counterclockwise; multiples of 90° are exact.

    Raises
    ------
    ValueError
        If the angle is not finite.

    Examples
    --------
    >>> turned(Fabric(), 90.0).warp
    array([0., 1.])
    """
    c, s = at_angles([angle_deg])[:, 0]
    warp, weft = (_turned(f.name, f.direction, c, s) for f in fabric.families)
    return replace(fabric, warp=warp, weft=weft)


def _turned(name: str, direction: Any, c: float, s: float) -> Direction:
    """Direction after a rotation with this cosine and sine."""
    if isinstance(direction, RegionalDirection):
        fields = [_turned(name, field, c, s) for field in direction.directions]
        return replace(direction, directions=fields)
    if callable(direction):
        return partial(_turned_field, name=name, field=direction, c=c, s=s)
    return _rotated(direction, c, s)


def _turned_field(x: ndarray, name: str, field: Any, c: float, s: float) -> ndarray:
    return _rotated(call_user_function(name, field, x), c, s)


def _rotated(vectors: Any, c: float, s: float) -> ndarray:
    """Vectors of shape (2, ...) after a rotation with this cosine and sine."""
    x, y = np.asarray(vectors)
    return np.stack([c * x - s * y, s * x + c * y]) + 0.0
