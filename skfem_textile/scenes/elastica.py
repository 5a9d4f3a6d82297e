"""Inextensible plane curves in bending: the elastica under weight and compression."""

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
