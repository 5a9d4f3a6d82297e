"""Ends of laws: which of those of a fabric a state is closest to."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

# Of what the laws of a fabric are, in their order.
_QUANTITIES = "warp_strain", "weft_strain", "shear_angle"

# What is said where a law of shear ends at rest.
_GO_ON = " (a table from 0 on needs odd=True, --shear-continuation odd)"

# Share of where a law ends by which elements are as close to it as one.  Chosen:
# half a degree at 50°, which a colour cannot tell.
_AS_CLOSE = 0.01


class LawEnd(NamedTuple):
    """A law that is close to an end of its domain.

    Attributes
    ----------
    quantity
        Of what it is a law: warp_strain, weft_strain or shear_angle.
    value, end
        The value that is closest to the end, and the end; angles in radians.
    elements
        Numbers of the elements that are as close.
    """

    quantity: str
    value: float
    end: float
    elements: ndarray

    def __str__(self) -> str:
        name, (value, end) = self.quantity.replace("_", " "), self[1:3]
        shown = f"{value:.3g}", f"{end:.3g}"
        if self.quantity == "shear_angle":
            shown = f"{np.degrees(value):.4g}°", f"{np.degrees(end):.4g}°"
        said = f"the {name} is {shown[0]}, and its law ends at {shown[1]}"
        return said + (_GO_ON if self.quantity == "shear_angle" and end == 0 else "")


def closest_end(
    domains: Sequence[tuple[Any, Any]], values: Sequence[ndarray]
) -> LawEnd | None:
    """The end of a law that is closest, or None if every law holds everywhere.

    Parameters
    ----------
    domains
        Both ends of the laws of warp, weft and shear.
    values
        Fibre strains of warp and weft, and shear angles, shape (n_elements, n) each.
    """
    found = []
    for name, domain, x in zip(_QUANTITIES, domains, values, strict=True):
        for end, side in zip(domain, (-1, 1), strict=True):
            ends = np.broadcast_to(end, x.shape)
            gaps = side * (ends - x)
            at = int(np.argmin(gaps))
            if np.isfinite(least := gaps.flat[at]):
                close = gaps <= least + _AS_CLOSE * np.abs(ends)
                elements = np.flatnonzero(close.any(axis=1))
                place = float(x.flat[at]), float(ends.flat[at]), elements
                found.append((least, LawEnd(name, *place)))
    return min(found, key=lambda each: each[0])[1] if found else None
