"""Inextensible plane curves in bending: the elastica under weight and compression."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray


class Elastica(NamedTuple):
    """Curve of unit length that begins at the origin along x.

    Attributes
    ----------
    s
        Arc length, shape (n,).
    x, z
        Position, shape (n,).
    """

    s: ndarray
    x: ndarray
    z: ndarray

    @property
    def chord_angle(self) -> float:
        """Angle of the chord below x in radians."""
        return float(np.arctan2(-self.z[-1], self.x[-1]))


def hanging(weight: float, end_force: float = 0.0) -> Elastica:
    """Cantilever of unit length and bending stiffness under downward loads.

    θ″ = −(w (1 − s) + f) cos θ with θ(0) = 0, θ′(1) = 0 and the angle θ of the curve
    below x (Bickley 1934 for weight alone).

    Parameters
    ----------
    weight
        Weight w per length; w L³/D for a strip.
    end_force
        Downward force f at the end; F L²/D for a strip, with F per width.
    """
    from scipy.integrate import solve_bvp

    def slopes(s, y):
        load = weight * (1 - s) + end_force
        return np.array([y[1], -load * np.cos(y[0]), np.cos(y[0]), -np.sin(y[0])])

    def ends(start, end):
        return np.array([start[0], end[1], start[2], start[3]])

    s = np.linspace(0.0, 1.0, 201)
    turn = min(1.2, weight / 6 + end_force / 2)
    guess = np.array([turn * s, turn * (1 - s), s, -turn * s**2])
    solution = solve_bvp(slopes, ends, s, guess, tol=1e-9, max_nodes=100_000)
    if not solution.success:
        raise ValueError(
            f"the computation of the elastica does not converge for w = {weight:g}, f "
            f"= {end_force:g}"
        )
    _, _, x, z = solution.sol(s)
    return Elastica(s, x, z)


# Steps along the longest strip, of the method of Runge and Kutta: the tip is within
# 3·10⁻⁶ L of `hanging` up to w L³/D = 1000, where the strip hangs vertically beyond a
# tenth of its length: pytest tests/scenes/test_drooping.py
_STEPS = 100

# Angles of the tip at which the search begins, as logarithms of tan(δ/2) with the angle
# δ to the vertical: from 10⁻¹⁴ to nearly 90 degrees.
_TIPS = -np.geomspace(1e-6, 32.0, 48)

# Iterations for the angle of the tip, and their tolerance in radians.
_MOST_ITERATIONS, _EXACT = 60, 1e-12

# Smallest slope of a law, relative to the one at rest: a strip would fold with a
# smaller one.
_LEAST_SLOPE = 1e-9


class Drooping(NamedTuple):
    """Tips of cantilevers under their weight, each of shape (n,).

    Attributes
    ----------
    x, drop
        Position of the tip along the clamped direction and below it, in mm.
    curvature
        Curvature at the clamp, the largest one, in 1/mm.
    """

    x: ndarray
    drop: ndarray
    curvature: ndarray

    @property
    def chord_angle(self) -> ndarray:
        """Angle of the chord below the clamped direction in radians."""
        angle: ndarray = np.arctan2(self.drop, self.x)
        return angle


def drooping(
    slope: Callable[[ndarray], ndarray],
    lengths: Any,
    weight: float,
    steps: int = _STEPS,
) -> Drooping:
    """Cantilevers of several lengths under their weight, for a bending law.

    From the free end at the distance σ, δ′ = κ and M′(κ) κ′ = w σ sin δ with the angle
    δ to the vertical, which is a right angle at the clamp.

    Parameters
    ----------
    slope
        Derivative M′(κ) of the moment of a bending law in N·mm, positive for κ >= 0.
    lengths
        Lengths in mm, shape (n,).
    weight
        Weight per area in N/mm².
    steps
        Number of steps; more for a law with kinks.

    Raises
    ------
    ValueError
        If the computation does not converge.
    """
    L = np.asarray(lengths, dtype=float)
    longest, last = float(L.max()), len(_TIPS) - 1
    angles = _from_tips(slope, _TIPS, longest, weight, steps)[:, 0]
    step = np.minimum((L / longest * steps).astype(int), steps - 1)
    too_far = angles[step] > 0.5 * np.pi  # strips that curl may turn back
    turned = np.where(too_far, np.arange(last + 1), 0).max(axis=1)
    high, low = (_TIPS[np.minimum(turned + i, last)] for i in (0, 3))

    def at_clamp(tip):
        return _from_tips(slope, tip, L, weight, steps)[-1]

    above, below = (at_clamp(tip)[0] - 0.5 * np.pi for tip in (high, low))
    side = np.zeros(L.shape)
    for _ in range(_MOST_ITERATIONS):  # Illinois method
        tip = (low * above - high * below) / (above - below)
        y = at_clamp(tip)
        off = y[0] - 0.5 * np.pi
        if np.all((np.abs(off) < _EXACT) | (high - low < _EXACT)):
            return Drooping(y[2], y[3], y[1])
        up = off > 0
        halved = np.where(up, np.where(side > 0, 0.5, 1.0), 1.0)
        halved_above = np.where(~up, np.where(side < 0, 0.5, 1.0), 1.0)
        above, below = (
            np.where(up, off, above * halved_above),
            np.where(up, below * halved, off),
        )
        low, high = np.where(up, low, tip), np.where(up, tip, high)
        side = np.where(up, 1.0, -1.0)
    raise ValueError(
        f"the computation of cantilevers of up to {longest:g} mm does not converge for "
        "this bending law"
    )


def _from_tips(
    slope: Callable[[ndarray], ndarray],
    tips: ndarray,
    lengths: Any,
    weight: float,
    steps: int,
) -> ndarray:
    """States δ, κ, x and drop from tips on, (steps + 1, 4, n); see `drooping`."""
    least = _LEAST_SLOPE * float(slope(np.zeros(1))[0])

    def rates(sigma, y):
        bent, s = np.maximum(slope(y[1]), least), np.sin(y[0])
        return np.array([y[1], weight * sigma * s / bent, s, np.cos(y[0])])

    y = np.array([2 * np.arctan(np.exp(tips)), 0 * tips, 0 * tips, 0 * tips])
    h, every = lengths / steps, [y]
    for i in range(steps):
        k_1 = rates(i * h, y)
        k_2 = rates((i + 0.5) * h, y + 0.5 * h * k_1)
        k_3 = rates((i + 0.5) * h, y + 0.5 * h * k_2)
        k_4 = rates((i + 1) * h, y + h * k_3)
        y = y + h / 6 * (k_1 + 2 * (k_2 + k_3) + k_4)
        every.append(y)
    return np.array(every)


# Steps of `chord_angles`, first to bracket the tips, and number of tips.  Errors are
# below 10⁻⁴ of an angle for smooth laws and 4·10⁻³ next to the knee of a bilinear one,
# less than errors of measured angles: pytest tests/scenes/test_drooping.py
_COARSE_STEPS, _FINE_STEPS, _N_TIPS = 16, 60, 33

# Fewest tips of strips that are horizontal at their clamps.
_FEWEST_TIPS = 4

# Length that is integrated relative to the longest strip: at neighbouring tips lengths
# differ by less.
_BEYOND = 1.2


def chord_angles(
    slope: Callable[[ndarray], ndarray], lengths: Any, weight: float
) -> ndarray:
    """Angles of the chords of cantilevers in radians; parameters as `drooping`.

    Faster than `drooping` and less accurate: strips of several tip angles are
    integrated once, each up to the length at which it is horizontal.
    """
    L = np.asarray(lengths, dtype=float)
    longest, last = _BEYOND * float(L.max()), len(_TIPS) - 1

    def reached(tips, steps):
        y = _from_tips(slope, tips, longest, weight, steps)
        return _horizontal(y, longest / steps)

    at = np.fmax.accumulate(np.nan_to_num(reached(_TIPS, _COARSE_STEPS)[0]))
    ends = np.searchsorted(at, [L.min(), L.max()]) + np.array([-2, 1])
    first, end = _TIPS[np.clip(ends, 0, last)].tolist()
    tips = np.linspace(first, end, _N_TIPS)
    at, x, drop = reached(tips, _FINE_STEPS)
    from scipy.interpolate import CubicSpline

    at, order = np.unique(at, return_index=True)
    known, angle = np.isfinite(at), np.arctan2(drop, x)[order]
    if known.sum() < _FEWEST_TIPS:
        raise ValueError("cantilevers of this bending law fold: its moment decreases")
    found: ndarray = CubicSpline(at[known], angle[known])(L)
    return found


def _horizontal(y: ndarray, h: float) -> tuple[ndarray, ndarray, ndarray]:
    """Distance from the tip, x and drop where strips are first horizontal, or nan.

    By cubic interpolation within the steps of `_from_tips`, of the length h.
    """
    beyond = y[:, 0] >= 0.5 * np.pi
    i = np.maximum(beyond.argmax(axis=0), 1)
    strips = np.arange(y.shape[2])
    (d_0, k_0, *from_0), (d_1, k_1, *from_1) = y[i - 1, :, strips].T, y[i, :, strips].T
    share = (0.5 * np.pi - d_0) / (d_1 - d_0)

    def between(a, b, slope_a, slope_b, t):
        bend_a, bend_b = slope_a - (b - a), -slope_b + (b - a)
        return (1 - t) * a + t * b + t * (1 - t) * ((1 - t) * bend_a + t * bend_b)

    rise = d_1 - d_0
    with np.errstate(divide="ignore", invalid="ignore"):  # straight at the tip
        t = between(0.0, 1.0, rise / (h * k_0), rise / (h * k_1), share)
    t = np.where(np.isfinite(t), np.clip(t, 0.0, 1.0), share)
    x, drop = (
        between(a, b, h * of(d_0), h * of(d_1), t)
        for a, b, of in zip(from_0, from_1, (np.sin, np.cos), strict=True)
    )
    found = beyond.any(axis=0)
    at = np.where(found, (i - 1 + t) * h, np.nan)
    return at, x, drop


def peirce(length: Any, weight: float, angle: Any) -> Any:
    """Bending stiffness in N·mm by Peirce, D = w L³/8 · cos(θ/2)/tan θ.

    Parameters
    ----------
    length, weight
        Length L in mm, a number or an array, and weight w per area in N/mm².
    angle
        Angle θ of the chord below the horizontal in radians, for each length.
    """
    return weight * length**3 / 8 * np.cos(angle / 2) / np.tan(angle)


class Buckled(NamedTuple):
    """Hinged strip of unit length and bending stiffness under compression.

    Attributes
    ----------
    force
        Force at the ends, π² at the onset of buckling.
    height
        Height of the middle above the chord.
    """

    force: float
    height: float


def buckled(shortening: float) -> Buckled:
    """First buckling mode: 1 − δ = 2 E(k)/K(k) − 1, P = 4 K², height k/K (Euler).

    Parameters
    ----------
    shortening
        δ, relative approach of the ends, between 0 and 1.
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    def off(k):
        return 2 - 2 * ellipe(k * k) / ellipk(k * k) - shortening

    k = brentq(off, 0.0, 1 - 1e-12)
    K = float(ellipk(k * k))
    return Buckled(4 * K * K, k / K)
