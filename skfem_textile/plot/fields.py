"""What a picture can show in colours."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from ..io.results import cell_fields, point_fields
from ..ply import Ply


@dataclass(frozen=True)
class Field:
    """A quantity with one value per element.

    Attributes
    ----------
    label
        What stands at its scale, with the unit.
    values
        The values of a ply at a displacement, ``(ply, u) -> values``, shape
        (n_elements,).
    cmap
        Colours of the scale, the name of a colour map of matplotlib.
    symmetric
        Whether the scale is symmetric about zero; else it holds zero.

    Examples
    --------
    >>> wrinkles = Field("Compression of the warp (N/mm)",
    ...     lambda ply, u: -ply.fibre_tension(u)[0].min(axis=-1))
    >>> wrinkles.cmap
    'viridis'
    """

    label: str
    values: Callable[[Ply, ndarray], ndarray]
    cmap: str = "viridis"
    symmetric: bool = False


def _of_cells(name: str, factor: float = 1.0) -> Callable[[Ply, ndarray], ndarray]:
    return lambda ply, u: factor * cell_fields(ply, u)[name]


def _moved(ply: Ply, u: ndarray) -> ndarray:
    """The mean displacement of the vertices of each element."""
    displacement = point_fields(ply, u)["displacement"]
    return np.linalg.norm(displacement[ply.mesh.t].mean(axis=0), axis=1)


#: Fields by their names.
FIELDS: Mapping[str, Field] = {
    "shear_angle": Field("Shear angle (°)", _of_cells("shear_angle")),
    "warp_strain": Field(
        "Warp strain (%)", _of_cells("warp_strain", 100), "RdBu_r", symmetric=True
    ),
    "weft_strain": Field(
        "Weft strain (%)", _of_cells("weft_strain", 100), "RdBu_r", symmetric=True
    ),
    "warp_tension": Field(
        "Warp tension (N/mm)", _of_cells("warp_tension"), "RdBu_r", symmetric=True
    ),
    "weft_tension": Field(
        "Weft tension (N/mm)", _of_cells("weft_tension"), "RdBu_r", symmetric=True
    ),
    "displacement": Field("Displacement (mm)", _moved, "cividis"),
    "area_ratio": Field(
        "Area over initial area", lambda ply, u: ply.least_area_ratio(u), "cividis"
    ),
}


def field_of(field: str | Field) -> Field:
    """The field of a name, or what is a field already.

    Raises
    ------
    ValueError
        If there is no field of that name.
    """
    if isinstance(field, Field):
        return field
    if field not in FIELDS:
        raise ValueError(f"there is no field {field!r}: take {', '.join(FIELDS)}")
    return FIELDS[field]


def values_of(field: Field, ply: Ply, u: ndarray) -> ndarray:
    """The values of a field, one finite number for each element.

    Raises
    ------
    ValueError
        If they are something else.
    """
    values = np.asarray(field.values(ply, u), dtype=float)
    if values.shape != (ply.mesh.nelements,):
        raise ValueError(
            f"{field.label}: values of shape {values.shape} "
            f"for {ply.mesh.nelements} elements"
        )
    if not np.isfinite(values).all():
        element = int(np.flatnonzero(~np.isfinite(values))[0])
        raise ValueError(f"{field.label}: not finite in element {element}")
    return values


def reach(fields: Sequence[ndarray], symmetric: bool) -> tuple[float, float]:
    """The least and largest value on a scale that shows all fields and zero."""
    low = min((float(x.min()) for x in fields), default=0.0)
    high = max((float(x.max()) for x in fields), default=0.0)
    if symmetric:
        high = max(-low, high)
        low = -high
    return min(low, 0.0), max(high, 0.0)
