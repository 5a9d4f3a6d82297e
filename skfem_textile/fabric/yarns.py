"""Yarns of a fabric, and the force at which a crossing slips."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy import ndarray

from ..declarations import Yarns as DeclaredYarns
from .law import Law, domain_of

# Shear angles at which a law is evaluated for its friction part: from 0 to the largest
# angle at which fabrics are tested, in steps of half a degree.
_ANGLES = np.radians(np.arange(0.0, 60.5, 0.5))


@dataclass(frozen=True)
class Yarns(DeclaredYarns):
    """Spacing and width of the yarns, which determine where they may slip.

    They do not enter the energy; `slip_index` uses them.

    Parameters
    ----------
    spacing
        Distance between neighbouring yarns of warp and weft in mm.
    width
        Width of the yarns of warp and weft in mm.
    friction_moment
        Part of the shear moment that is friction at the crossings, in N·mm/mm²; by
        default `friction_part` of the shear law.

    Raises
    ------
    ValueError
        If a number is not positive and finite, or a yarn is wider than the spacing.

    Examples
    --------
    >>> yarns = Yarns(spacing=(5.2, 5.2), width=(4.2, 4.2), friction_moment=0.006)
    >>> round(yarns.lever, 3), round(yarns.bearing(0.006), 4)
    (1.607, 0.0037)
    """

    def __post_init__(self) -> None:
        pairs = {"spacing": self.spacing, "width": self.width}
        for name, pair in pairs.items():
            values = np.asarray(pair, dtype=float)
            if values.shape != (2,) or not (np.isfinite(values) & (values > 0)).all():
                raise ValueError(
                    f"yarns: the {name} must be a pair (warp, weft) of positive "
                    f"numbers in mm, got {pair!r}"
                )
        for family, pitch, wide in zip(
            ("warp", "weft"), self.spacing, self.width, strict=True
        ):
            if wide > pitch:
                raise ValueError(
                    f"yarns: the {family} is {wide:g} mm wide, wider than its spacing "
                    f"of {pitch:g} mm"
                )
        moment = self.friction_moment
        if moment is not None and not (np.isfinite(moment) and moment > 0):
            raise ValueError(
                "yarns: the friction moment must be a positive number in N·mm/mm², got "
                f"{moment!r}"
            )

    @property
    def lever(self) -> float:
        """Mean distance of the points of a crossing from its centre in mm.

        With the friction stress τ, a crossing of the area A slips at the force τ A and
        turns at the moment τ A times this distance.
        """
        a, b = (0.5 * width for width in self.width)
        d = np.hypot(a, b)
        along = a**2 / (2 * b) * np.log((b + d) / a)
        across = b**2 / (2 * a) * np.log((a + d) / b)
        return float((d + along + across) / 3)

    def bearing(self, friction_moment: float) -> float:
        """Force per area along the fibres at which crossings slip, in N/mm²."""
        return friction_moment / self.lever


def friction_part(law: Law, n_elements: int = 1) -> ndarray:
    """Moment of a shear law in N·mm/mm² that is friction, one per element.

    The largest intercept of a tangent, C − Γ C′, at angles up to 60° before the law
    decreases: the moment that remains if the straightest part of the curve is
    continued back to Γ = 0.  It is 0 for a law that does not soften.

    Examples
    --------
    >>> from skfem_textile import Polynomial
    >>> friction_part(Polynomial((0.035, 0.0, -0.108, 0.0, 0.19))).round(4)
    array([0.0061])
    """
    end = np.min(domain_of(law)[1])
    angles = _ANGLES[end > _ANGLES]
    x = np.broadcast_to(angles, (n_elements, angles.size))
    value, tangent = law.value(x), law.tangent(x)
    rising = np.logical_and.accumulate(tangent >= 0, axis=1)
    return cast("ndarray", np.where(rising, value - x * tangent, 0.0).max(axis=1))
