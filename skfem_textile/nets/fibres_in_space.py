"""Fibres of a draped ply: in the elements of a tool mesh, or in its own elements."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import real_numbers
from ..ply import Ply
from ..surfaces.analytic import positive_length
from ..surfaces.tool_mesh import ToolMesh
from ..surfaces.triangles import unit
from .sheet import REACH, Sheet

# Angle in degrees between an axis and the normal of an element below which another axis
# is used, as in Abaqus (Analysis User's Guide, "Conventions").
_NORMAL_DEG = 0.1

# Angle in degrees between an element and the ply above which it is a wall normal to it.
# Coarse tools of curved parts stay below it.
_STEEPEST_DEG = 60.0


@dataclass(frozen=True, eq=False)
class FibresInSpace:
    """Directions of warp and weft in the planes of elements in space.

    Attributes
    ----------
    mesh
        The elements.
    normal
        Unit normals of the elements, shape (3, n_elements).
    warp, weft
        Unit directions of the fibres in the planes of the elements, (3, n_elements);
        NaN for elements not covered by the ply.
    shear_angle
        Γ in radians, shape (n_elements,); NaN for elements not covered by the ply.
    axis
        Reference axis of the angles, projected into the plane of each element, shape
        (3,).
    """

    mesh: ToolMesh
    normal: ndarray
    warp: ndarray
    weft: ndarray
    shear_angle: ndarray
    axis: ndarray

    @property
    def covered(self) -> ndarray:
        """Mask of the elements covered by the ply, shape (n_elements,)."""
        return np.isfinite(self.shear_angle)

    def reference(self) -> ndarray:
        """Unit vectors of the axis projected onto the planes of the elements.

        If the axis is within 0.1° of the normal, the projection of z is used, or of x
        if the axis is z.
        """
        axis = unit(self.axis)
        other = np.array([1.0, 0, 0] if abs(axis[2]) > 0.5 else [0, 0, 1.0])
        along, instead = (
            a[:, None] - self.normal * (a @ self.normal) for a in (axis, other)
        )
        normal = np.linalg.norm(along, axis=0) < np.sin(np.radians(_NORMAL_DEG))
        return unit(np.where(normal, instead, along))

    def angles_deg(self) -> tuple[ndarray, ndarray]:
        """Angles of warp and weft to the reference in degrees, in (−180, 180].

        Anticlockwise as seen from the side of the normals.
        """
        x = self.reference()
        y = np.cross(self.normal, x, axis=0)
        warp, weft = (
            np.degrees(np.arctan2((y * v).sum(axis=0) + 0.0, (x * v).sum(axis=0)))
            for v in (self.warp, self.weft)
        )
        return warp, weft


def fibres_on_tool(
    sheet: Sheet,
    tool: ToolMesh,
    axis: ArrayLike = (1.0, 0.0, 0.0),
    reach: float | None = None,
) -> FibresInSpace:
    """Fibres of a draped ply in each element of a tool.

    They are the fibres at the point of the ply at the centre of the element.  An
    element inclined by more than 60° to the ply has none.

    Parameters
    ----------
    sheet
        The draped ply.
    tool
        The elements of the tool.
    axis
        Reference axis of the angles, projected into the plane of each element.
    reach
        Largest distance in mm between the centre of an element and the ply on it; by
        default a quarter of the longer of the longest edges of ply and element.  Use
        less than the thickness of a tool whose other side is not draped.

    Raises
    ------
    ValueError
        If an argument is not valid, or the ply does not cover any element.
    """
    along = _axis(axis)
    if reach is None:
        most = REACH * np.maximum(tool.longest_edges(), sheet.longest_edge)
    else:
        reach = positive_length("fibres on a tool: reach", reach)
        most = np.full(tool.n_elements, reach)
    places = sheet.at(tool.centres(), most)
    if not places.found.any():
        raise ValueError(
            "fibres on a tool: no element of the tool is within reach of the ply: "
            "check the position and units of the tool, or increase reach"
        )
    fibres = sheet.fibres_at(places)
    normal = tool.normals()
    lean = np.abs((unit(np.cross(*fibres[:2], axis=0)) * normal).sum(axis=0))
    # A wall that cuts through the ply has no fibres; NaN also where there is no ply.
    across = ~(lean > np.cos(np.radians(_STEEPEST_DEG)))
    if across.all():
        raise ValueError(
            "fibres on a tool: every element of the tool within reach is "
            "perpendicular to the ply: check the position of the tool"
        )
    warp, weft, angle = (np.where(across, np.nan, field) for field in fibres)
    warp, weft = (_in_plane(v, normal) for v in (warp, weft))
    return FibresInSpace(tool, normal, warp, weft, angle, along)


def fibres_on_ply(
    ply: Ply, u: ndarray, axis: ArrayLike = (1.0, 0.0, 0.0)
) -> FibresInSpace:
    """Fibres in each of the user's elements of a displaced ply in space.

    Directions and shear angles are element means.  Normals point to the upper side of
    the flat ply.

    Parameters
    ----------
    ply
        The ply.
    u
        Displacement.
    axis
        Reference axis of the angles, projected into the plane of each element.

    Raises
    ------
    ValueError
        If the ply is not in space, or the axis is not a direction.
    """
    along, sheet = _axis(axis), Sheet.of_ply(ply, u)
    n_nodes = 1 + max(cell.max() for cell in ply.cells)
    mesh = ToolMesh(sheet.positions[:, :n_nodes], tuple(ply.cells))
    normal = unit(ply.on_users_elements(unit(ply.normals(u))))
    directions = ply.fibre_direction(u, ply.centre)[..., 0]
    warp, weft = (_in_plane(ply.on_users_elements(a), normal) for a in directions)
    angle = ply.on_users_elements(ply.shear_angle(u, ply.centre)[:, 0])
    return FibresInSpace(mesh, normal, warp, weft, angle, along)


def _axis(axis: ArrayLike) -> ndarray:
    """A direction given by the user."""
    given = real_numbers("fibres in space: axis", axis)
    if given.shape != (3,) or not np.isfinite(given).all() or not given.any():
        raise ValueError(
            "fibres in space: axis must be a nonzero finite vector of three "
            f"components, got {axis!r}"
        )
    return given


def _in_plane(v: ndarray, normal: ndarray) -> ndarray:
    """Unit vectors of v without its normal component."""
    return unit(v - normal * (v * normal).sum(axis=0))
