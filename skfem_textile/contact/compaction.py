"""Compaction of a ply under a rigid holder that presses with a total force.

A ply of the relative areal weight w between holder and die at the distance H has the
pressure p(H/w), by the law of a ply of the thickness H/w that has the areal weight of
the flat one.  H follows from the balance of the pressures with the force of the holder.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy import ndarray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from .. import declarations as declared
from ..fabric.law import keep, number
from ..mesh.user_input import real_numbers, shortened
from ..ply.amount import Amount
from ..solve.problem import EPSILON


@runtime_checkable
class CompactionLaw(Protocol):
    """Pressure on a ply as a function of its thickness.

    A law may also have an attribute ``thinnest``, the thickness in mm below which it is
    extrapolated, of which there is a warning.

    Attributes
    ----------
    free
        Thickness in mm from which there is no pressure.
    """

    @property
    def free(self) -> float:
        """See the class."""
        ...

    def pressure_at(self, thickness: ndarray) -> ndarray:
        """Pressure in N/mm² at a thickness in mm, which it decreases with."""
        ...


@dataclass(frozen=True)
class Compaction(declared.Compaction):
    """Power law of compaction, p = P ((t₀/t)ᴮ − 1) up to the thickness t₀.

    Parameters
    ----------
    thickness
        t₀ in mm, of the ply without pressure.
    pressure
        P in N/mm².
    exponent
        B.

    Raises
    ------
    ValueError
        If a parameter is not a positive finite number.

    Examples
    --------
    >>> law = Compaction(0.3, 1e-3, 8.0)
    >>> law.pressure_at(np.array([0.3, 0.25])).round(5).tolist()
    [0.0, 0.0033]
    """

    def __post_init__(self) -> None:
        for name in ("thickness", "pressure", "exponent"):
            value = number(f"compaction: {name}", getattr(self, name), above=0)
            keep(self, **{name: value})

    @property
    def free(self) -> float:
        """t₀."""
        return self.thickness

    def pressure_at(self, thickness: ndarray) -> ndarray:
        """See `CompactionLaw`."""
        ratio = np.maximum(self.thickness / thickness, 1.0)
        return np.asarray(self.pressure * (ratio**self.exponent - 1))


@dataclass(frozen=True)
class MeasuredCompaction(declared.MeasuredCompaction):
    """Compaction law by a monotone curve through measured points.

    Thinner plies than the last one have a pressure that is linear in 1/t, and thus in
    the volume fraction of the fibres, with the slope there; with the slope between the
    last two points if the curve ends level.

    Parameters
    ----------
    thickness
        Thickness of the ply in mm, decreasing, shape (n,).
    pressure
        Pressure in N/mm², increasing from 0, shape (n,).

    Raises
    ------
    ValueError
        If there are less than two points, or they are not such numbers.

    Examples
    --------
    >>> law = MeasuredCompaction((0.3, 0.25, 0.22), (0.0, 0.003, 0.011))
    >>> law.pressure_at(np.array([0.4, 0.25])).tolist()
    [0.0, 0.003]
    """

    def __post_init__(self) -> None:
        t, p = (
            real_numbers(f"compaction: {name}", getattr(self, name))
            for name in ("thickness", "pressure")
        )
        if not (
            t.ndim == 1
            and t.shape == p.shape
            and t.size > 1
            and np.isfinite([*t, *p]).all()
            and (np.diff(t) < 0).all()
            and (np.diff(p) > 0).all()
            and t[-1] > 0
            and p[0] == 0
        ):
            raise ValueError(
                "compaction: points must be decreasing thicknesses above 0 mm with "
                "pressures that increase from 0 N/mm2, as many of both, got "
                f"{shortened(self.thickness)} and {shortened(self.pressure)}"
            )
        keep(self, thickness=tuple(t.tolist()), pressure=tuple(p.tolist()))

    @property
    def free(self) -> float:
        """The first thickness."""
        return float(self.thickness[0])

    @property
    def thinnest(self) -> float:
        """The last thickness, below which the curve is extrapolated."""
        return float(self.thickness[-1])

    def pressure_at(self, thickness: ndarray) -> ndarray:
        """See `CompactionLaw`."""
        curve, thinnest = self._curve, self.thinnest
        within = np.clip(thickness, thinnest, self.free)
        thinner = np.minimum(thickness - thinnest, 0.0) * (thinnest / thickness)
        return np.where(
            thickness < self.free, curve(within) + self._slope * thinner, 0.0
        )

    @cached_property
    def _slope(self) -> float:
        """Slope at the last point, which is 0 of curves that flatten towards it."""
        rise, of = np.diff([self.pressure[-2:], self.thickness[-2:]])[:, 0]
        return float(self._curve(self.thinnest, 1)) or float(rise / of)

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.thickness[::-1], self.pressure[::-1])


class Pressed(NamedTuple):
    """Pressures in N/mm² of current area, shape (n_nodes,), and distance H in mm."""

    pressures: ndarray
    distance: float


@dataclass(frozen=True)
class RigidHolder:
    """Holder that presses a ply on a die with a total force.

    Attributes
    ----------
    what
        The holder, at the beginning of messages.
    force
        Force in N as a function of the load factor.
    law
        Law of compaction.
    """

    what: str
    force: Amount
    law: CompactionLaw

    def pressed(self, t: float, areas: ndarray, weight: ndarray) -> Pressed:
        """Pressures that balance the force.

        Parameters
        ----------
        t
            Load factor.
        areas
            Current areas of the nodes under the holder in mm², shape (n_nodes,).
        weight
            Their areal weights relative to the flat ply; any where the area is 0.

        Raises
        ------
        ValueError
            If the law carries less than the force at any thickness.
        """
        force, under = self.force(t), areas > 0
        far = self.law.free * float(weight[under].max(initial=0.0))
        if not (force and far):
            return Pressed(np.zeros_like(areas), far)

        def excess(distance: float) -> float:
            pressures = self.law.pressure_at(distance / weight[under])
            return float(pressures @ areas[under]) - force

        near = far / 2
        while excess(near) < 0:
            near /= 2
            if near < EPSILON * far:
                raise ValueError(
                    f"{self.what}: its law of compaction carries less than the force "
                    f"{force:g} N at any thickness: use a law without a largest "
                    "pressure"
                )
        distance = brentq(excess, near, far, xtol=EPSILON * near, rtol=8 * EPSILON)
        pressures = np.zeros_like(areas)
        pressures[under] = self.law.pressure_at(distance / weight[under])
        total = float(pressures @ areas)  # 0 if the force is round-off
        return Pressed(pressures * (force / total if total else 0.0), distance)
