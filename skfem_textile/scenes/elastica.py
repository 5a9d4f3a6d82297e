"""Plane curves that bend without stretch: the elastica under weight and compression."""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray


class Elastica(NamedTuple):
    """A curve of unit length that begins at the origin along x.

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
    """A cantilever of unit length and bending stiffness that hangs down.

    θ″ = −(w (1 − s) + f) cos θ with θ(0) = 0, θ′(1) = 0 and θ the angle of the curve
    below x (Bickley 1934 for weight alone).

    Parameters
    ----------
    weight
        Weight w per length; of a strip w L³/D.
    end_force
        Force f down at the end; of a strip F L²/D, F per width.
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
    found = solve_bvp(slopes, ends, s, guess, tol=1e-9, max_nodes=100_000)
    if not found.success:
        raise ValueError(f"no elastica is found for w = {weight:g}, f = {end_force:g}")
    _, _, x, z = found.sol(s)
    return Elastica(s, x, z)


def peirce(length: Any, weight: float, angle: Any) -> Any:
    """Bending stiffness in N·mm by Peirce, D = w L³/8 · cos(θ/2)/tan θ.

    Parameters
    ----------
    length, weight
        Length L in mm, a number or an array, and weight w per area in N/mm².
    angle
        Angle θ of the chord below the table in radians, for each length.
    """
    return weight * length**3 / 8 * np.cos(angle / 2) / np.tan(angle)


class Buckled(NamedTuple):
    """A hinged strip of unit length and bending stiffness under compression.

    Attributes
    ----------
    force
        Force at the ends, π² where it begins to buckle.
    height
        Height of the middle over the chord.
    """

    force: float
    height: float


def buckled(shortening: float) -> Buckled:
    """The first mode: 1 − δ = 2 E(k)/K(k) − 1, P = 4 K², height k/K (Euler).

    Parameters
    ----------
    shortening
        δ, how much nearer the ends are, between 0 and 1.
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    def off(k):
        return 2 - 2 * ellipe(k * k) / ellipk(k * k) - shortening

    k = brentq(off, 0.0, 1 - 1e-12)
    K = float(ellipk(k * k))
    return Buckled(4 * K * K, k / K)
