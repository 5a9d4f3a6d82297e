"""Motions of tools."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import call_user_function, real_numbers
from ..ply.amount import Amount
from .outline import ROUND_OFF

#: Translation in mm that is reached in proportion to the load factor, or a function of
#: the load factor that returns the translation, or a rotation matrix and it.
Motion: TypeAlias = ArrayLike | Callable[[float], Any]

# Largest component of a translation in mm: its square is finite.
_MOST = 1e100

# Number of load factors at which a gap or pressure is validated before a run: every
# 2.5 % of it.
_CHECKED = 41


def placement(tool: str, motion: Motion | None, t: float) -> tuple[ndarray, ndarray]:
    """Rotation matrix and translation of a motion at a load factor.

    Raises
    ------
    ValueError
        If the motion returns something else; the message names the tool.
    """
    what = f"{tool}: motion"
    if motion is None:
        return np.eye(3), np.zeros(3)
    moved: Any = motion
    if callable(motion):
        moved = call_user_function(what, motion, t)
    pair = isinstance(moved, tuple | list) and len(moved) == 2
    rotation, translation = moved if pair else (np.eye(3), moved)
    rotation = real_numbers(what, rotation)
    translation = real_numbers(what, translation)
    known = translation.shape == (3,) and rotation.shape == (3, 3)
    if not known or (pair and not callable(motion)):
        raise ValueError(
            f"{what} must be a final translation of three components, or a "
            "function of the load factor that returns a translation, or a rotation "
            f"matrix and a translation, got {' '.join(repr(moved).split())}"
        )
    if not callable(motion):
        translation = t * translation
    if not np.isfinite(translation).all():
        raise ValueError(f"{what} is not finite at load factor {t:g}")
    if (most := float(np.abs(translation).max())) > _MOST:
        raise ValueError(
            f"{what} is {most:.4g} mm at load factor {t:g}: check its unit"
        )
    off = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not (off <= ROUND_OFF and np.linalg.det(rotation) > 0):
        raise ValueError(f"{what}: the matrix at load factor {t:g} is not a rotation")
    return rotation, translation


def travelled(tool: str, motion: Motion | None, t: float) -> ndarray:
    """Translation from the initial position in mm, shape (3,).

    A motion about an axis has the translation of the axis, see `AboutAxis`; a function
    that returns matrices the one that it returns, of the point at the origin.
    """
    motion = getattr(motion, "translation", motion)
    (_, first), (_, now) = (placement(tool, motion, x) for x in (0.0, t))
    return now - first


def angle_turned(tool: str, motion: Motion | None, t: float) -> float:
    """Angle of the rotation from the initial position in radians.

    It is at most π if the motion is a function that returns matrices: then from ‖R −
    R₀‖² = 8 sin²(θ/2), which is accurate for small angles too.
    """
    if angle := getattr(motion, "rotation", None):
        return abs(float(angle(t) - angle(0.0)))
    (first, _), (now, _) = (placement(tool, motion, x) for x in (0.0, t))
    sine = np.linalg.norm(now - first) / np.sqrt(8)
    return 2 * float(np.arcsin(min(sine, 1.0)))


def validated_at(amount: Amount) -> list[float]:
    """Load factors at which an amount is validated before a run."""
    return [*np.linspace(0.0, 1.0, _CHECKED).tolist(), *amount.load_factors]


def deepest(obstacles: Sequence[Any]) -> tuple[int, float]:
    """Obstacle that reaches deepest beyond the plane of the ply, and when.

    The one that travels farthest if none moves beyond the plane; the first of equal
    ones.  At the load factors at which motions and gaps are validated, whatever the
    steps of a run.

    Parameters
    ----------
    obstacles
        Obstacles, see `Obstacle`.

    Returns
    -------
    int, float
        Its index and the load factor.
    """
    stated = (y for x in obstacles for y in (x.motion, x.reach))
    factors = {t for y in stated for t in validated_at(Amount("", y))}

    def reached(at: tuple[int, float]) -> tuple[float, float]:
        obstacle, t = obstacles[at[0]], at[1]
        return obstacle.depth(t), float(np.linalg.norm(obstacle.travel(t)))

    return max(product(range(len(obstacles)), sorted(factors)), key=reached)
