"""Fields of a displaced ply, one value per node or element, for files and pictures."""

import numpy as np
from numpy import ndarray

from ..drape import beyond_edges, bridging, contact_pressure, wrinkle_risk
from ..ply import Ply
from ..ply.parameters import PlyParameters
from ..solve.states import State
from ..solve.surface import Surface


def point_fields(ply: Ply, u: ndarray) -> dict[str, ndarray]:
    """``displacement`` of the vertices in mm, shape (n_vertices, 3)."""
    return {"displacement": _in_space(ply.nodal(u)[:, : ply.mesh.nvertices])}


def cell_fields(
    ply: Ply, u: ndarray, parameters: PlyParameters | None = None
) -> dict[str, ndarray]:
    """Fibre strains, tensions and directions, and the shear angle, per element.

    Strains are those that enter the law of tension (`Ply.law_strain`), tensions as of
    `Ply.fibre_tension`.  Of the points in an element, that with the
    largest magnitude counts, so that the extremes of a field are those of the ply.
    Directions are those at the centre, in the current configuration.

    Returns
    -------
    dict
        ``warp_strain``, ``weft_strain``, ``warp_tension``, ``weft_tension`` (N/mm) and
        ``shear_angle`` (degrees), shape (n_elements,); ``warp_direction`` and
        ``weft_direction``, shape (n_elements, 3).
    """
    strain, tension = ply.law_strain(u), ply.fibre_tension(u, parameters)
    direction = ply.fibre_direction(u, ply.centre)[..., 0]
    fields = {"shear_angle": np.degrees(_extreme(ply.shear_angle(u)))}
    for i, family in enumerate(("warp", "weft")):
        fields[f"{family}_strain"] = _extreme(strain[i])
        fields[f"{family}_tension"] = _extreme(tension[i])
        fields[f"{family}_direction"] = _in_space(direction[i])
    return fields


def fields_on_tool(
    ply: Ply, surface: Surface, state: State
) -> tuple[dict[str, ndarray], dict[str, ndarray]]:
    """Fields of a ply that lies on a surface, of its vertices and of its elements.

    Parameters
    ----------
    ply, surface
        The ply, and the surface at the load factor of the state.
    state
        The state.

    Returns
    -------
    tuple
        Of the vertices ``contact_pressure`` (N/mm²), of the elements ``wrinkle_risk``
        and ``bridging``, 1 where there is some, and on a tool of triangles
        ``beyond_tool``, 1 beyond its edges.
    """
    u = state.u
    pressure = contact_pressure(ply, surface, u, state.load_factor, state.parameters)
    of_elements = {
        "wrinkle_risk": wrinkle_risk(ply, u, state.parameters).astype(float),
        "bridging": bridging(ply, u, pressure).astype(float),
    }
    beyond = beyond_edges(ply, surface, u)
    if beyond is not None:
        of_elements["beyond_tool"] = beyond.astype(float)
    return {"contact_pressure": pressure[: ply.mesh.nvertices]}, of_elements


def on_users_elements(ply: Ply, fields: dict[str, ndarray]) -> dict[str, ndarray]:
    """Fields of the elements of a ply on the user's elements, in the mean.

    Of directions it is the direction of the mean.
    """
    means = {name: ply.on_users_elements(x.T).T for name, x in fields.items()}
    return {
        name: x if x.ndim == 1 else x / np.linalg.norm(x, axis=1, keepdims=True)
        for name, x in means.items()
    }


def _extreme(x: ndarray) -> ndarray:
    """Of each element's points the value of largest magnitude."""
    largest = np.abs(x).argmax(axis=-1)
    return np.take_along_axis(x, largest[:, None], axis=-1)[:, 0]


def _in_space(x: ndarray) -> ndarray:
    """Columns of vectors, in the plane or in space, as rows of vectors in space."""
    return np.pad(x, ((0, 3 - len(x)), (0, 0))).T
