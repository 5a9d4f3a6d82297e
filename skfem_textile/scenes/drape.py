"""Scene `drape`: a ply on a triangulated tool from a file.

The ply touches the tool at one point.  This is the origin of the axes of the scene,
with z along the normal of the tool, so that the surface grows out of the plane of the
ply.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import Mesh

from ..declarations import scenes as declared
from ..declarations.scenes import PlyOptions
from ..mesh.graph import boundary_edges, components, edges_of
from ..mesh.overlap import signed_areas
from ..mesh.user_input import coords
from ..nets.crossings import Net
from ..surfaces.analytic import three_numbers
from ..surfaces.surface import Axes, OffSurfaceError, onto
from ..surfaces.tool_mesh import ToolMesh
from ..surfaces.triangle_mesh import TriangleMesh
from .draped_ply import draped_ply, warn_of_net
from .scene import Scene, with_parameters

# Height difference, relative to the extent of the tool, within which vertices are
# equally high.
_AS_HIGH = 1e-6

# Ratio of the areas of ply and tool above which the ply is refused: a ply sheared by
# 60° covers half of its area.
_MOST_AREA = 2.0

# Ratio of the areas below which one of them is assumed to be in other units.  Chosen:
# it is 1e-4 for a patch of 100 mm on a tool of 10 m, and at most a millionth for a tool
# in micrometres.
_LEAST_AREA = 1e-5

# Maximum number of iterations to a horizontal point of the tool, the final step
# relative to the longest edge, and the ratio of this edge to the radius of curvature
# below which the tool is regarded as straight.  Chosen: above the rounding of a mesh.
_MOST, _SETTLED, _STRAIGHT = 50, 1e-9, 1e-3

# Slope up to which a plane is horizontal.
_LEVEL = 0.02


@with_parameters(declared.Drape)
def drape(given: declared.Drape) -> Scene:
    """Complete ply on a triangulated tool.

    Parameters
    ----------
    tool
        The tool, see `skfem_textile.io.read_surface`.
    mesh, size, jitter, seed, fibres, width, height, tension, part
        See `draped_ply`, except for ``part``: the whole ply is computed.
    point
        Contact point of the centre of the ply with the tool, in mm.  By default the
        highest point of the tool, of several the one nearest to its centre.

    Raises
    ------
    ValueError
        See `draped_ply`.  Also if the tool has no such point or is not horizontal
        there, if it is much smaller than the ply, or if its triangles are much larger.
    """
    facets = given.tool.facets
    axes = Axes.at(given.tool, contact_point(given.tool, given.point))
    surface = given.tool.moved(*axes)
    options: PlyOptions = {**given.ply(), "part": "whole"}

    def check(flat: Mesh, lay: Callable[[], Net]) -> None:
        _refuse_sizes(facets, flat)
        warn_of_net(lay, flat.p, axes)

    return draped_ply("drape", surface, given.mesh, **options, axes=axes, check=check)


def contact_point(tool: TriangleMesh, point: Sequence[float] | None = None) -> ndarray:
    """Point of a tool nearest to a given point in mm; the highest one by default.

    Raises
    ------
    ValueError
        If the tool has no such point.
    """
    foot = _highest(tool) if point is None else _on_tool(tool, point)
    if tool.beyond_edges(foot[:, None])[0] > 0:
        raise ValueError(
            f"drape: the contact point of the ply, {coords(foot)} mm, is outside all "
            "triangles of the tool: specify another point"
        )
    return foot


def _refuse_sizes(facets: ToolMesh, ply: Mesh) -> None:
    of_tool = facets.area
    x, y = ply.p[:, ply.t]
    of_ply = np.abs(signed_areas(x, y)).sum()
    areas = (
        f"drape: the area of the ply is {of_ply:.4g} mm2, the area of the whole tool "
        f"{of_tool:.4g} mm2"
    )
    if of_ply > _MOST_AREA * of_tool:
        raise ValueError(
            f"{areas}: use a smaller ply, or specify the unit of the tool file"
        )
    if of_ply < _LEAST_AREA * of_tool:
        raise ValueError(
            f"{areas}: use a larger ply, or specify the unit of the tool file"
        )


def _on_tool(tool: TriangleMesh, point: ArrayLike) -> ndarray:
    """Point on a tool that is nearest to a given point."""
    point = three_numbers("drape: the contact point", point)
    near = tool.facets.longest_edges().max()
    try:
        with np.errstate(all="ignore"):  # distant points are refused
            foot = onto(tool, point[:, None])[:, 0]
    except OffSurfaceError:
        foot = np.full(3, np.inf)
    if not np.linalg.norm(foot - point) <= near:
        raise ValueError(
            f"drape: the contact point {coords(point)} mm is further from the tool "
            f"than {near:.3g} mm, the longest edge of its triangles: specify a point "
            "on the tool"
        )
    return foot


def _highest(tool: TriangleMesh) -> ndarray:
    """Highest point of a tool, where it is horizontal, by Newton's method.

    There e_z = μ∇φ and φ = 0.  The iteration does not move along a ridge or on a flat
    top.
    """
    facets = tool.facets
    near = facets.longest_edges().max()
    start, inside = _middle_of_top(tool)
    position, mu = start, 0.0
    for _ in range(_MOST):
        at = position[:, None]
        g, level = tool.gradient(at)[:, 0], tool.level(at)[0]
        mu = mu or g[2] / (g @ g)
        curved = mu * near * tool.hessian(at)[:, :, 0]
        tangent = np.block([[curved, g[:, None]], [g[None], np.zeros((1, 1))]])
        right = np.append(-mu * g, -level / near)
        right[2] += 1.0
        step = np.linalg.lstsq(tangent, right, rcond=_STRAIGHT)[0]
        position, mu = position + near * step[:3], mu + step[3]
        away = np.linalg.norm(position - start)
        if np.linalg.norm(step) <= _SETTLED or away > 2 * near:
            break
    if inside and away <= 2 * near and np.hypot(*g[:2]) <= _LEVEL * abs(g[2]):
        return position
    raise ValueError(
        f"drape: the highest point of the tool, {coords(start)} mm, is at its edge or "
        "on a slope: specify the contact point of the ply"
    )


def _middle_of_top(tool: TriangleMesh) -> tuple[ndarray, bool]:
    """Middle of the highest vertices of a tool, and whether it is not at its edge.

    It is the centroid of a flat top or of a ridge; the vertex nearest to the middle of
    the tool if the top is one vertex, or does not contain its centroid.
    """
    facets = tool.facets
    x, triangles = facets.points, facets.triangles()
    is_high = x[2] >= x[2].max() - _AS_HIGH * np.ptp(x)
    high = np.flatnonzero(is_high)
    middle = 0.5 * (x.min(axis=1) + x.max(axis=1))
    vertex = high[np.hypot(*(x[:, high] - middle[:, None])[:2]).argmin()]
    edges, _ = edges_of([triangles])
    edges = edges[:, is_high[edges].all(axis=0)]
    part = components(x.shape[1], edges)
    top = part == part[vertex]
    for parts in (triangles, edges):
        parts = parts[:, top[parts].all(axis=0)]
        corners = x[:, parts]
        along = corners[:, 1:] - corners[:, :1]
        size = np.sqrt(np.linalg.det(np.einsum("kin,kjn->nij", along, along)))
        if size.any():
            centroid = np.average(corners.mean(axis=1), axis=1, weights=size)
            foot = onto(tool, centroid[:, None])
            away = np.linalg.norm(foot[:, 0] - centroid)
            if away <= _LEVEL * np.ptp(x) and not tool.beyond_edges(foot)[0]:
                return foot[:, 0], True
    return x[:, vertex], vertex not in boundary_edges(facets.cells)
