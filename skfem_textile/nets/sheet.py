"""Draped ply as elements in space: its points at points of a tool, and its fibres."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..fabric import kinematics as kin
from ..mesh.checks import MeshError
from ..mesh.graph import boundary_edges, edges_once
from ..mesh.overlap import signed_areas
from ..mesh.splitting import sets_of
from ..ply import Ply
from ..surfaces.analytic import positive_length, three_numbers
from ..surfaces.surface import SAME_AXES, Axes
from ..surfaces.tool_mesh import (
    Elements,
    ElementTree,
    ToolMesh,
    closest_on_triangles,
    edge_lengths,
    loops,
    unit,
)
from .crossings import Net

# Distance of a foot outside its element, relative to the distance of the point, that is
# accepted: between two elements that meet at an angle, up to 50°, a point has no other
# foot.
_BETWEEN = 0.5

# The same at the edge of the ply, to which the offset must be normal there: for
# elements that turn by 12°.  Distances count up to `REACH`.
_BESIDE = 0.1

# Tolerance of an element edge, relative to the longest edge.
_ON_EDGE = 1e-6

# Largest coordinate in mm.  Its square is finite.
_FAR = 1e100

#: Largest distance of a point from the ply, relative to the longest edge, a guard
#: against points off it: the distance of an arc of 90° from its chord is 0.21 of the
#: chord.
REACH = 0.25


class SheetPoints(NamedTuple):
    """Points of a sheet: element, −1 if there is none, and local coordinates.

    ``distance`` in mm is the distance between the sheet and the given point, infinite
    without an element.  Shapes (n,), (2, n) and (n,).
    """

    element: ndarray
    local: ndarray
    distance: ndarray

    @property
    def found(self) -> ndarray:
        """Mask of points with an element, shape (n,)."""
        return self.element >= 0


class Pieces(Protocol):
    """A net, a net with darts, or a part of one."""

    @property
    def pieces(self) -> Sequence[tuple[Net, ndarray]]:
        """Nets, each with the mask of its cells."""
        ...


@dataclass(frozen=True, eq=False)
class Sheet:
    """Ply in space with the position of each of its points in the flat ply.

    Parameters
    ----------
    flat, positions
        Nodes in the flat ply and in space in mm, shapes (2, n_nodes) and (3, n_nodes).
    elements
        Nodes of the elements, shape (3, n_elements) or (4, n_elements).
    warp, weft
        Unit directions of the fibres in the flat ply, shape (2, n_elements).
    is_net
        True if elements may be missing where a net was not laid: gaps between elements
        are then not holes of the ply.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> sphere = drape.Sphere(100.0, (0, 0, -100))
    >>> sheet = drape.Sheet.of_net(drape.net(sphere, 5.0, (0, 12), (0, 12)))
    >>> places = sheet.at(np.array([[0.0, 0.0], [10.0, 200.0], [0.0, 0.0]]))
    >>> places.found, sheet.flat_at(places)[:, 0].round(1)
    (array([ True, False]), array([ 0., 10.]))
    """

    flat: ndarray
    positions: ndarray
    elements: ndarray
    warp: ndarray
    weft: ndarray
    is_net: bool = False

    @classmethod
    def of_ply(cls, ply: Ply, u: ndarray, axes: Axes = SAME_AXES) -> "Sheet":
        """Sheet of a ply in space after a displacement.

        Parameters
        ----------
        ply
            The ply.
        u
            Displacement.
        axes
            Axes of the ply in the coordinates of the sheet.

        Raises
        ------
        ValueError
            If the ply is not in space.
        """
        moved = ply.nodal(u)
        if len(moved) != 3:
            raise ValueError(
                "sheet: the ply must be in space: use Ply(..., dimension=3)"
            )
        mesh = ply.mesh
        flat, moved = mesh.p, moved[:, : mesh.nvertices]
        positions = axes.of_tool(np.pad(flat, ((0, 1), (0, 0))) + moved)
        shape = 2, mesh.nelements
        warp, weft = (
            np.broadcast_to(A[..., 0], shape) for A in ply.directions(ply.centre)
        )
        return cls(flat, positions, mesh.t, warp, weft)

    @classmethod
    def of_net(cls, net: Pieces) -> "Sheet":
        """Sheet of a kinematic net, one quadrilateral per cell that was laid.

        The pieces of a net with darts have separate nodes.
        """
        flat, positions, elements, first = [], [], [], 0
        for piece, cells in net.pieces:
            n = np.arange(piece.status.size).reshape(piece.status.shape)
            corners = n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]
            nodes, numbers = np.unique(
                [corner[cells] for corner in corners], return_inverse=True
            )
            flat.append(piece.flat().reshape(2, -1)[:, nodes])
            positions.append(piece.positions.reshape(3, -1)[:, nodes])
            elements.append(first + numbers.reshape(4, -1))
            first += nodes.size
        joined = np.hstack(elements)
        fibres = piece.fibres(joined.shape[1])
        both = np.hstack(flat), np.hstack(positions)
        return cls(*both, joined, *fibres, is_net=True)

    @property
    def _elements(self) -> Elements:
        return Elements(self.elements)

    @property
    def longest_edge(self) -> float:
        """Length of the longest edge in space in mm."""
        return float(edge_lengths(self.positions, self.elements).max())

    @cached_property
    def holes(self) -> list[ndarray]:
        """Nodes around each hole of the ply; none of a net.

        Raises
        ------
        ValueError
            If a hole meets another one, or the edge of the ply, at a node.
        """
        if self.is_net:
            return []
        clockwise = signed_areas(*self.flat[:, self.elements]) < 0
        cells = np.where(clockwise, self.elements[::-1], self.elements)
        try:
            around = loops(self.flat, [cells])
        except MeshError:
            raise ValueError(
                "sheet: a hole of the ply meets another one, or the edge, at a node: "
                "move them apart"
            ) from None
        return [nodes for nodes in around if signed_areas(*self.flat[:, nodes]) < 0]

    @cached_property
    def _tree(self) -> "ElementTree":
        return ElementTree(self.positions[:, self.elements])

    def at(
        self,
        points: ndarray,
        reach: ndarray | float | None = None,
        rank: ndarray | None = None,
    ) -> SheetPoints:
        """Points of the sheet at points of a tool: feet of perpendiculars.

        A point beside the ply, nearest to its edge, has none.

        Parameters
        ----------
        points
            Points in mm, shape (3, n).
        reach
            Largest distance from the sheet in mm, for all points or for each; by
            default a quarter of the longest edge of the sheet.  Use less than the
            thickness of a tool whose other side is not draped.
        rank
            Of several elements within reach of a point, the one of the least rank is
            chosen, shape (n_elements,); by default the nearest.
        """
        n, points = points.shape[1], np.clip(points, -_FAR, _FAR)
        reach = REACH * self.longest_edge if reach is None else reach
        most = np.broadcast_to(np.asarray(reach, dtype=float), n)
        point, element = self._tree.pairs(points, most)
        local = self._elements.feet(self.positions, points[:, point], element)
        inside = self._elements.inside(local)
        closest = self._elements.between(self.positions, element, inside)
        distance = np.linalg.norm(points[:, point] - closest, axis=0)
        beyond = self._elements.beyond(local) * 2 * self._tree.radii[element]
        outside, on_edge = beyond.max(axis=0), _ON_EDGE * self.longest_edge
        beside = _BESIDE * np.minimum(distance, REACH * self.longest_edge)
        at_rim = self._at_rim[:, element]
        wide = beyond > on_edge + np.where(at_rim, beside, _BETWEEN * distance)
        accepted = ~wide.any(axis=0) & (distance <= most[point])
        rim = self._nearest_rim(points, point, element, wide & at_rim)
        accepted &= (outside <= on_edge) | (distance < (1 - _ON_EDGE) * rim[point])
        # The chosen element of each point is written last.
        last = distance + outside if rank is None else rank[element]
        order = np.flatnonzero(accepted)[np.argsort(-last[accepted])]
        chosen = np.full(n, -1)
        chosen[point[order]] = order
        feet = SheetPoints(np.full(n, -1), np.full((2, n), np.nan), np.full(n, np.inf))
        found, chosen = chosen >= 0, chosen[chosen >= 0]
        feet.element[found] = element[chosen]
        feet.local[:, found] = inside[:, chosen]
        feet.distance[found] = distance[chosen]
        return feet

    @cached_property
    def _at_rim(self) -> ndarray:
        """Mask of the sides of elements on the edge of the ply, as `edge_lengths`."""
        _, _, number, count = edges_once([self.elements])
        return (count[number] == 1).reshape(self.elements.shape)

    def _nearest_rim(
        self, points: ndarray, point: ndarray, element: ndarray, sides: ndarray
    ) -> ndarray:
        """Distance of points from their nearest side of a mask, (n_corners, n_pairs).

        Infinite without one, shape (n_points,).
        """
        side, pair = np.nonzero(sides)
        ends = (side, np.roll(np.arange(len(sides)), -1)[side])
        start, end = (self.positions[:, self.elements[k, element[pair]]] for k in ends)
        along, away = end - start, points[:, point[pair]] - start
        share = np.clip((away * along).sum(axis=0) / (along**2).sum(axis=0), 0.0, 1.0)
        nearest = np.full(points.shape[1], np.inf)
        distance = np.linalg.norm(away - share * along, axis=0)
        np.minimum.at(nearest, point[pair], distance)
        return nearest

    def flat_at(self, points: SheetPoints) -> ndarray:
        """Points in the flat ply in mm, shape (2, n); NaN if there is none."""
        return self._elements.between(self.flat, points.element, points.local)

    def points(self, points: SheetPoints) -> ndarray:
        """Points in space in mm, shape (3, n); NaN if there is none."""
        return self._elements.between(self.positions, points.element, points.local)

    def fibres_at(self, points: SheetPoints) -> tuple[ndarray, ndarray, ndarray]:
        """Unit directions of warp and weft, shape (3, n), and the shear angle, (n,).

        The deformation gradient is interpolated between nodes, where it is second-order
        accurate.  NaN if there is no point.
        """
        F = self._elements.between(self._gradients, points.element, points.local)
        A = [family[:, points.element] for family in (self.warp, self.weft)]
        warp, weft = (kin.fibre(F, family) for family in A)
        angle = kin.shear_angle(F, *A)
        return unit(warp), unit(weft), angle

    @cached_property
    def _gradients(self) -> ndarray:
        """Deformation gradient at each node, shape (3, 2, n_nodes).

        The mean over the elements at the node. Along the edges of the ply this mean is
        offset by half an element. There, and finally at the corners of the ply, nodal
        values are changed until the mean of the nodes of an element equals the gradient
        at its centre, which is second-order accurate.
        """
        corners = self._elements.corners
        at_corners = np.array([self._gradient_at(corner) for corner in corners])
        nodes, _ = self._mean_at_nodes(at_corners, self.elements)
        centre = self._gradient_at(corners.mean(axis=0))
        left = np.zeros(len(nodes), dtype=bool)
        left[boundary_edges([self.elements])] = True
        while left.any():
            n_left = left[self.elements].sum(axis=0)
            least = n_left[n_left > 0].min()
            elements = self.elements[:, n_left == least]
            lag = centre[n_left == least] - nodes[elements].mean(axis=0)
            lag = np.broadcast_to(
                lag * (len(corners) / least), (len(corners), *lag.shape)
            )
            change, reached = self._mean_at_nodes(lag, elements)
            nodes[left & reached] += change[left & reached]
            left &= ~reached
        return nodes.transpose(1, 2, 0)

    def _gradient_at(self, at: ndarray) -> ndarray:
        """Deformation gradient at a point of each element, (n_elements, 3, 2)."""
        n = self.elements.shape[1]
        local = np.tile(at[:, None], n)
        x, X = (
            self._elements.slopes(of, np.arange(n), local).transpose(2, 0, 1)
            for of in (self.positions, self.flat)
        )
        return x @ np.linalg.inv(X)

    def _mean_at_nodes(
        self, at_corners: ndarray, elements: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Means at nodes over some elements, and mask of the nodes that have them.

        ``at_corners`` has the shape (n_corners, n_elements, ...).
        """
        n_nodes = self.flat.shape[1]
        total = np.zeros((n_nodes, *at_corners.shape[2:]))
        np.add.at(total, elements, at_corners)
        count = np.bincount(elements.ravel(), minlength=n_nodes)
        return total / np.maximum(count, 1)[:, None, None], count > 0


# Angle in degrees between an axis and the normal of an element below which another axis
# is used, as in Abaqus (Analysis User's Guide, "Conventions").
_NORMAL_DEG = 0.1

# Angle in degrees between an element and the ply above which it is a wall normal to it.
# Coarse tools of curved parts stay below it.
_STEEPEST_DEG = 60.0

# Cosine of an angle below which two points of a tool are on one perpendicular to the
# ply, and ratio of their distances below which one of them is nearer: a surface that
# turns by less has no such points.
_ALIGNED, _NEARER = 0.95, 0.9


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
    node_sets, element_sets
        Nodes and elements by name: boundaries, named nodes and subdomains of a ply.
    """

    mesh: ToolMesh
    normal: ndarray
    warp: ndarray
    weft: ndarray
    shear_angle: ndarray
    axis: ndarray
    node_sets: Mapping[str, ndarray] = field(default_factory=dict)
    element_sets: Mapping[str, ndarray] = field(default_factory=dict)

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

    They are the fibres at the foot of the perpendicular from the centre of the element
    to the ply.  An element inclined by more than 60° to the ply has none.  Of two skins
    of a tool the nearer one has fibres, or the upper one if the ply is in their middle.

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
        default a quarter of the longest edge of ply or tool.

    Raises
    ------
    ValueError
        If an argument is not valid, or the ply does not cover any element.
    """
    along = _axis(axis)
    if reach is None:
        reach = default_reach(sheet, tool)
    reach = positive_length("fibres on a tool: reach", reach)
    places = sheet.at(tool.centres(), reach)
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
    across |= _on_other_skin(sheet, places, tool, fibres)
    if across.all():
        raise ValueError(
            "fibres on a tool: every element of the tool within reach is "
            "perpendicular to the ply: check the position of the tool"
        )
    warp, weft, angle = (np.where(across, np.nan, field) for field in fibres)
    warp, weft = (_in_plane(v, normal) for v in (warp, weft))
    return FibresInSpace(tool, normal, warp, weft, angle, along)


def default_reach(sheet: Sheet, tool: ToolMesh) -> float:
    """Default distance from a ply up to which it covers elements of a tool in mm."""
    return REACH * max(sheet.longest_edge, float(tool.longest_edges().max()))


def _on_other_skin(
    sheet: Sheet, places: SheetPoints, tool: ToolMesh, fibres: Sequence[ndarray]
) -> ndarray:
    """True for elements of a tool whose part of the ply lies on another skin.

    It is the nearer one on the same perpendicular to the ply; of two skins at about the
    same distance, one on either side of the ply, the one above it.
    """
    found, triangles = np.flatnonzero(places.found), tool.triangles()
    feet, centres = sheet.points(places)[:, found], tool.centres()[:, found]
    upwards = np.cross(fibres[0][:, found], fibres[1][:, found], axis=0)
    own = centres - feet
    away = np.linalg.norm(own, axis=0)
    corners = np.hstack([cell[[0, 1, 2, -1]] for cell in tool.cells])[:, found]
    hidden = np.zeros(tool.n_elements, dtype=bool)
    for points, is_tied in ((feet, False), (feet - own, True)):
        nearest, shares = closest_on_triangles(tool.points, triangles, points)
        other = (tool.points[:, triangles[:, nearest]] * shares).sum(axis=1) - feet
        length = np.linalg.norm(other, axis=0)
        cosine = (other * own).sum(axis=0)
        if is_tied:
            below = (own * upwards).sum(axis=0) < 0
            behind = below & (cosine < -_ALIGNED * length * away)
            behind &= (_NEARER * length <= away) & (length <= away / _NEARER)
        else:
            behind = np.abs(cosine) > _ALIGNED * length * away
            behind &= length < _NEARER * away
        beside = triangles[:, None, nearest] == corners
        hidden[found[behind & ~beside.any(axis=(0, 1))]] = True
    return hidden


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
    sets = sets_of(ply.users_mesh)
    return FibresInSpace(mesh, normal, warp, weft, angle, along, *sets)


def _axis(axis: ArrayLike) -> ndarray:
    """A direction given by the user."""
    given = three_numbers("fibres in space: axis", axis)
    if not given.any():
        raise ValueError("fibres in space: axis must not be zero")
    return given


def _in_plane(v: ndarray, normal: ndarray) -> ndarray:
    """Unit vectors of v without its normal component."""
    return unit(v - normal * (v * normal).sum(axis=0))
