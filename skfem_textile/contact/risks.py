"""Drape defects: contact pressure, bridging, wrinkling, and edges of a tool."""

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..ply.parameters import PlyParameters
from ..surfaces.surface import GrowingSurface, Surface

#: Rotation of the tool normal over an element in degrees above which a mesh is coarse.
#: Measured on boxes and domes with walls of 50° and fillets of 6 to 60 mm, against
#: elements of a quarter of the size: up to 27° all shear angles are within 0.9°, from
#: 36° to 50° the largest errors are 0.4° to 2.9° (`pytest -m slow
#: tests/scenes/drape/test_between_nodes.py` has one of each).
COARSE = 30.0

#: Share of the largest tension or contact force below which one is zero: the tolerance
#: of equilibrium.
NO_FORCE = 1e-8

# Radius of curvature, relative to the size of a ply, above which the contact pressure
# of fibres is zero.  On a flat tool round-off corresponds to a radius of ten million
# sizes.
_FLAT = 1e5


def contact_pressure(
    ply: Ply,
    surface: Surface,
    u: ndarray,
    t: float = 1.0,
    parameters: PlyParameters | None = None,
) -> ndarray:
    """Pressure of a surface on the nodes of a ply per current area, in N/mm².

    The tool occupies the side on which φ is negative.  A negative pressure means that
    the tool would have to pull: there the ply bridges the tool.

    Parameters
    ----------
    ply
        The ply, with all nodes on the surface.
    surface
        The surface.
    u, t, parameters
        Displacement, load factor and parameters of a `State`; by default parameters at
        rest.

    Returns
    -------
    ndarray
        Shape (n_nodes,).  It is linear between the corners of the user's elements, and
        work-equivalent to the forces for all motions of this form.
    """
    x = ply.positions(u)
    normal = surface.gradient(x)
    normal = normal / np.linalg.norm(normal, axis=0)
    if parameters is None:
        parameters = ply.parameters_at_rest
    force = (ply.nodal(ply.residual(u, t, parameters)) * normal).sum(axis=0)
    return pressure_of(ply, u, force)


def pressure_of(ply: Ply, u: ndarray, force: ndarray) -> ndarray:
    """Pressure of normal forces on the nodes of a ply per current area, in N/mm².

    Parameters
    ----------
    ply
        A ply in space.
    u
        Displacement.
    force
        Normal forces on the nodes in N, shape (n_nodes,).

    Returns
    -------
    ndarray
        See `contact_pressure`.
    """
    corners, n = ply.mesh.t, ply.mesh.p.shape[1]
    x = ply.positions(u)
    # The area of an element on the surface is divided equally among its corners.
    sides = x[:, corners[2]] - x[:, corners[0]], x[:, corners[-1]] - x[:, corners[1]]
    area = 0.5 * np.linalg.norm(np.cross(*sides, axis=0), axis=0)
    share = np.tile(area / len(corners), len(corners))
    shared = np.bincount(corners.ravel(), share, n)
    hats = ply.hat_functions()
    return ((hats @ force) / (hats[:, :n] @ shared)) @ hats


def bridging(ply: Ply, u: ndarray, pressure: ndarray) -> ndarray:
    """Elements with a tensile mean contact pressure.

    Its magnitude must exceed the pressure from the largest fibre tension on a virtually
    flat surface.

    Parameters
    ----------
    ply
        The ply.
    u
        Displacement.
    pressure
        Contact pressure at its nodes, see `contact_pressure`.

    Returns
    -------
    ndarray
        Bool, shape (n_elements,), of the elements of ``ply.mesh``.
    """
    size = np.ptp(ply.nodes, axis=1).max()
    none = np.abs(ply.fibre_tension(u)).max() / (_FLAT * size)
    return np.asarray(pressure[ply.mesh.t].mean(axis=0) < -none)


def beyond_edges(ply: Ply, surface: Surface, u: ndarray) -> ndarray | None:
    """Elements of a ply whose centre lies beyond the edges of a tool.

    None for a surface without a method ``beyond_edges``, which `TriangleMesh` has.

    Parameters
    ----------
    ply
        The ply.
    surface
        The surface, which may still be growing.
    u
        Displacement.

    Returns
    -------
    ndarray or None
        Bool, shape (n_elements,), of the elements of ``ply.mesh``.
    """
    x, tool = _on_surface(ply, surface, u)
    beyond = getattr(tool, "beyond_edges", None)
    return None if beyond is None else beyond(x[:, ply.mesh.t].mean(axis=1)) > 0


def off_triangles(ply: Ply, surface: Surface, u: ndarray) -> ndarray | None:
    """Elements of a ply where the smoothed tool deviates from its triangles.

    None for a surface without a method ``off_triangles``, which `TriangleMesh` has.
    Arguments and result as in `beyond_edges`.
    """
    x, tool = _on_surface(ply, surface, u)
    off = getattr(tool, "off_triangles", None)
    return None if off is None else (off(x)[ply.mesh.t] > 0).any(axis=0)


def turn_of_normal(ply: Ply, surface: Surface, u: ndarray) -> ndarray:
    """Largest angle between the normals of a surface at two corners of an element.

    In radians, for each element of ``ply.mesh``.  Arguments as in `beyond_edges`.
    """
    x, tool = _on_surface(ply, surface, u)
    normal = tool.gradient(x)
    return largest_turn((normal / np.linalg.norm(normal, axis=0))[:, ply.mesh.t])


def largest_turn(corners: ndarray) -> ndarray:
    """Largest angle between two unit vectors at the corners of an element, in radians.

    Shape (n_elements,), of vectors of shape (3, n_corners, n_elements).
    """
    one, other = np.triu_indices(corners.shape[1], 1)
    chord = np.linalg.norm(corners[:, one] - corners[:, other], axis=0).max(axis=0)
    return np.asarray(2 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def share_of_area(ply: Ply, elements: ndarray) -> float:
    """Area fraction of some elements of a ply, by numbers or a mask."""
    area = np.abs(ply.basis.mapping.detDF(ply.centre))[:, 0]
    return float(area[elements].sum() / area.sum())


def _on_surface(ply: Ply, surface: Surface, u: ndarray) -> tuple[ndarray, Surface]:
    """Node positions, scaled to the surface at full size, and that surface."""
    x = ply.positions(u)
    if not isinstance(surface, GrowingSurface):
        return x, surface
    point = surface.point[:, None]
    return point + surface.t * (x - point), surface.surface


def wrinkle_risk(
    ply: Ply, u: ndarray, parameters: PlyParameters | None = None
) -> ndarray:
    """Elements in which fibres may buckle in the plane of the ply.

    An inextensible net buckles in its plane if the tension of a family is below −G,
    with the shear stiffness G at rest (Rosen 1965); bending stiffness increases this
    limit.  If the fabric is sheared beyond its ``wrinkling_angle``, fibres are at risk
    as soon as they are compressed.  Tensions are element means, because they oscillate
    between the points of a quadratic triangle.

    Parameters
    ----------
    ply
        The ply.
    u, parameters
        Displacement and parameters of a `State`; see `Ply.fibre_tension`.

    Returns
    -------
    ndarray
        Bool, shape (n_elements,), of the elements of ``ply.mesh``.
    """
    return np.asarray(~(_distance_to_buckling(ply, u, parameters) >= 0))  # with NaN


def most_compressed(
    ply: Ply, u: ndarray, parameters: PlyParameters | None = None
) -> int | None:
    """Element with the greatest `wrinkle_risk`; None if no element is at risk.

    The compression of its fibres exceeds the limit most.  Parameters as there.
    """
    distance = _distance_to_buckling(ply, u, parameters)
    first = int(np.nan_to_num(distance, nan=-np.inf).argmin())
    return None if distance[first] >= 0 else first


def _distance_to_buckling(
    ply: Ply, u: ndarray, parameters: PlyParameters | None
) -> ndarray:
    """Smaller mean tension of both families minus the buckling limit, N/mm, (n,)."""
    tension, weight = ply.fibre_tension(u, parameters), ply.basis.dx
    mean = (tension * weight).sum(axis=-1) / weight.sum(axis=-1)
    sheared, fabric = np.abs(ply.shear_angle(u)).max(axis=1), ply.fabric.at()
    stiffness = fabric.shear_law.tangent(np.zeros((len(sheared), 1)))[:, 0]
    none = NO_FORCE * np.abs(mean).max(initial=0.0)
    stands = np.where(sheared > fabric.wrinkling_angle, none, stiffness)
    return np.asarray((mean + stands).min(axis=0))  # NaN where a tension is
