"""Draped ply as elements in space: location of points of a tool on the ply."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from skfem import ElementH1, ElementQuad1, ElementTriP1

from ..fabric import kinematics as kin
from ..ply import Ply
from .crossings import Net

# Largest number of iterations for the foot of a perpendicular on an element.  Chosen:
# on a square twisted by 30° the error for a point at a tenth of a side is 1e-8 of it.
_ITERATIONS = 12

# Change of local coordinates in an iteration that is rounding.
_ROUNDING = 1e-12

# Regularisation, relative to the squared edges of an element, of steps beyond the edges
# of a strongly bent element.
_RIDGE = 1e-12


@dataclass(frozen=True, eq=False)
class Elements:
    """Triangles or quadrilaterals, by node numbers, (n_corners, n).

    Local coordinates follow scikit-fem, from 0 to 1.
    """

    nodes: ndarray

    def feet(
        self, positions: ndarray, points: ndarray, element: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Orthogonal projections of points onto elements, possibly beyond their edges.

        Returns local coordinates, and the vectors to the points.
        """
        centre = self.corners.mean(axis=0)[:, None]
        local, left = np.tile(centre, len(element)), np.arange(len(element))
        for _ in range(_ITERATIONS):
            before, some = local[:, left], element[left]
            away = points[:, left] - self.between(positions, some, before)
            slopes = self.slopes(positions, some, before)
            normal = np.einsum("ijn,ikn->njk", slopes, slopes)
            size = np.trace(normal, axis1=1, axis2=2)
            normal += _RIDGE * size[:, None, None] * np.eye(2)
            right = np.einsum("ijn,in->nj", slopes, away)
            step = np.linalg.solve(normal, right[:, :, None])[:, :, 0].T
            # Far beyond its edges the mapping of an element is meaningless.
            local[:, left] = np.clip(before + step, -1.0, 2.0)
            left = left[np.abs(local[:, left] - before).max(axis=0) > _ROUNDING]
            if not left.size:
                break
        return local, points - self.between(positions, element, local)

    def outside(self, local: ndarray) -> ndarray:
        """Distance of local coordinates from an element, 0 inside it."""
        beyond = np.maximum(-local, 0.0).max(axis=0, initial=0.0)
        if len(self.nodes) == 4:
            return np.maximum(beyond, (local - 1).max(axis=0, initial=0.0))
        return np.maximum(beyond, local.sum(axis=0) - 1)

    def inside(self, local: ndarray) -> ndarray:
        """Local coordinates clipped to an element."""
        local = np.clip(local, 0.0, 1.0)
        if len(self.nodes) == 4:
            return local
        return local / np.maximum(local.sum(axis=0), 1.0)

    def between(self, values: ndarray, element: ndarray, local: ndarray) -> ndarray:
        """Nodal values, shape (..., n_nodes), at local coordinates of elements."""
        shares, _ = self._shapes(local)
        nodes = self.nodes[:, element]
        return sum(N * values[..., node] for N, node in zip(shares, nodes, strict=True))

    def slopes(self, values: ndarray, element: ndarray, local: ndarray) -> ndarray:
        """Derivatives of nodal vectors in local coordinates, shape (d, 2, n)."""
        _, slopes = self._shapes(local)
        nodes = self.nodes[:, element]
        return sum(
            values[:, None, node] * dN for dN, node in zip(slopes, nodes, strict=True)
        )

    def _shapes(self, local: ndarray) -> tuple[list[ndarray], list[ndarray]]:
        """Shape functions of the corners, (n,), and their derivatives, (2, n)."""
        shapes = [self._shape().lbasis(local, i) for i in range(len(self.nodes))]
        return [N for N, _ in shapes], [dN for _, dN in shapes]

    @property
    def corners(self) -> ndarray:
        """Local coordinates of the corners, shape (n_corners, 2)."""
        return self._shape().doflocs

    def _shape(self) -> ElementH1:
        """scikit-fem element."""
        return ElementQuad1() if len(self.nodes) == 4 else ElementTriP1()


def unit(v: ndarray) -> ndarray:
    """Normalised columns."""
    return v / np.linalg.norm(v, axis=0)


def edge_lengths(positions: ndarray, elements: ndarray) -> ndarray:
    """Lengths of the edges of elements, shape (n_corners, n_elements)."""
    x = positions[:, elements]
    return np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0)


def boundary_edges(cells: Sequence[ndarray]) -> ndarray:
    """Nodes of edges that belong to one element only, in its orientation, (2, n)."""
    edges, first, count = edges_once(cells)
    return edges[:, first[count == 1]]


def edges_once(cells: Sequence[ndarray]) -> tuple[ndarray, ndarray, ndarray]:
    """Edges of elements, shape (2, n), in their orientation, element by element.

    The first edges are those that begin at the first corners of the elements of the
    first block.  Also the first occurrence of each edge in either direction, by its
    nodes, and how often it occurs.
    """
    pairs = [[cell.ravel(), np.roll(cell, -1, axis=0).ravel()] for cell in cells]
    edges = np.hstack(pairs)
    low, high = edges.min(axis=0).astype(np.int64), edges.max(axis=0)
    _, first, count = np.unique(
        low * (high.max(initial=0) + 1) + high, return_index=True, return_counts=True
    )
    return edges, first, count


class ElementTree:
    """Search trees for elements near points, by corners of shape (3, n_corners, n).

    There is one for each order of magnitude of their radii.
    """

    def __init__(self, corners: ndarray) -> None:
        from scipy.spatial import KDTree  # imported only if needed

        centres = corners.mean(axis=1)
        self.radii = np.linalg.norm(corners - centres[:, None], axis=0).max(axis=0)
        size = np.frexp(self.radii)[1]
        parts = [np.flatnonzero(size == own) for own in np.unique(size)]
        self._trees = [(part, KDTree(centres[:, part].T)) for part in parts]

    def pairs(
        self, points: ndarray, reach: ndarray | float = np.inf
    ) -> tuple[ndarray, ndarray]:
        """Numbers of points, (3, n), each with all candidates for its nearest element.

        The nearest element is at most as far away as the nearest centre.
        """
        nearest = [tree.query(points.T)[0] for _, tree in self._trees]
        most = np.minimum(reach, np.min(nearest, axis=0))
        pairs = []
        for part, tree in self._trees:
            near = tree.query_ball_point(points.T, self.radii[part].max() + most)
            counts = np.array([len(close) for close in near], dtype=int)
            point = np.repeat(np.arange(points.shape[1]), counts)
            element = part[np.fromiter(chain.from_iterable(near), dtype=int)]
            pairs.append((point, element))
        point, element = np.hstack(pairs)
        order = np.lexsort([element, point])
        return point[order], element[order]


def closest_on_triangles(
    positions: ndarray,
    triangles: ndarray,
    points: ndarray,
    tree: ElementTree | None = None,
) -> tuple[ndarray, ndarray]:
    """Triangle of the closest point to each point in space, shape (3, n).

    Shape (n,), and the barycentric coordinates of the closest point, (3, n).  ``tree``
    is the search tree of the triangles if it is known.
    """
    corners = positions[:, triangles]
    tree = tree or ElementTree(corners)
    point, triangle = tree.pairs(points)
    possible = _may_be_closest(corners, tree.radii, points, point, triangle)
    point, triangle = point[possible], triangle[possible]
    shares, distance = _closest(corners[..., triangle], points[:, point])
    order = np.lexsort([distance, point])
    first = order[np.flatnonzero(np.diff(point[order], prepend=-1))]
    return triangle[first], shares[:, first]


def _may_be_closest(
    corners: ndarray,
    radii: ndarray,
    points: ndarray,
    point: ndarray,
    triangle: ndarray,
) -> ndarray:
    """Pairs of a point and a triangle that can be the closest one, shape (n_pairs,).

    A triangle is within its radius of its centre, and in its plane.  With the height h
    of a point over the plane, and the distance τ of its foot from the centre, no point
    of the triangle is closer than √(h² + (τ − r)²), or h for τ < r: many triangles
    face a point far away, but few of them are below it.
    """
    a, b, c = corners.swapaxes(0, 1)
    centres, normals = corners.mean(axis=1), np.cross(b - a, c - a, axis=0)
    normals /= np.maximum(np.linalg.norm(normals, axis=0), np.finfo(float).tiny)
    away = points[:, point] - centres[:, triangle]
    square = np.einsum("ip,ip->p", away, away)
    height = np.einsum("ip,ip->p", away, normals[:, triangle]) ** 2
    along = np.sqrt(np.maximum(square - height, 0.0))
    least = height + np.maximum(along - radii[triangle], 0.0) ** 2
    first = np.flatnonzero(np.diff(point, prepend=-1))
    most = np.repeat(
        np.minimum.reduceat(square, first), np.diff(first, append=len(point))
    )
    return least <= most + _ROUND_OFF * square


def _closest(corners: ndarray, points: ndarray) -> tuple[ndarray, ndarray]:
    """Barycentric coordinates of closest points, and squared distances.

    Corners have the shape (3, 3, n), with the corner number on the second axis.
    """
    a, b, c = corners.swapaxes(0, 1)
    along, across, away = b - a, c - a, points - a
    aa, ac, cc = (
        (p * q).sum(axis=0)
        for p, q in ((along, along), (along, across), (across, across))
    )
    pa, pc = ((away * edge).sum(axis=0) for edge in (along, across))
    twice = aa * cc - ac * ac
    s, t = (cc * pa - ac * pc) / twice, (aa * pc - ac * pa) / twice
    shares = np.array([1 - s - t, s, t])
    distance = ((away - s * along - t * across) ** 2).sum(axis=0)
    distance[(shares < 0).any(axis=0)] = np.inf
    for k in range(3):
        m = (k + 1) % 3
        edge, from_start = corners[:, m] - corners[:, k], points - corners[:, k]
        share = (from_start * edge).sum(axis=0) / (edge * edge).sum(axis=0)
        share = np.clip(share, 0.0, 1.0)
        on_edge = ((from_start - share * edge) ** 2).sum(axis=0)
        closer = on_edge < distance
        shares[:, closer] = 0.0
        shares[k, closer], shares[m, closer] = 1 - share[closer], share[closer]
        distance[closer] = on_edge[closer]
    return shares, distance


# Round-off of squared distances, relative to the squared distance of the centre.
_ROUND_OFF = 1e-12

# Distance of a foot outside its element, relative to the distance of the point, that is
# accepted: between two elements that meet at an angle, up to 50°, a point has no other
# foot.
_BETWEEN = 0.5

# Tolerance of an element edge, relative to the longest edge.
_ON_EDGE = 1e-6

# Largest coordinate in mm.  Chosen: its square is finite.
_FAR = 1e100

#: Largest distance of a point from the ply, relative to the longest edge.  The distance
#: of an arc of 90° from its chord is 0.21 of the chord.
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

    @classmethod
    def of_ply(cls, ply: Ply, u: ndarray) -> "Sheet":
        """Sheet of a ply in space after a displacement.

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
        positions = np.pad(flat, ((0, 1), (0, 0))) + moved
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
            s, t = np.meshgrid(*piece.along, indexing="ij")
            n = np.arange(s.size).reshape(s.shape)
            corners = n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]
            nodes, numbers = np.unique(
                [corner[cells] for corner in corners], return_inverse=True
            )
            along = np.array([s.ravel()[nodes], t.ravel()[nodes]])
            flat.append(piece.directions @ along + piece.touch[:, None])
            positions.append(piece.positions.reshape(3, -1)[:, nodes])
            elements.append(first + numbers.reshape(4, -1))
            first += nodes.size
        joined = np.hstack(elements)
        warp, weft = (
            np.tile(a[:, None], (1, joined.shape[1])) for a in piece.directions.T
        )
        return cls(np.hstack(flat), np.hstack(positions), joined, warp, weft)

    @property
    def _elements(self) -> Elements:
        return Elements(self.elements)

    @property
    def longest_edge(self) -> float:
        """Length of the longest edge in space in mm."""
        return float(edge_lengths(self.positions, self.elements).max())

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
        local, away = self._elements.feet(self.positions, points[:, point], element)
        distance = np.linalg.norm(away, axis=0)
        outside = self._elements.outside(local) * 2 * self._tree.radii[element]
        allowed = _ON_EDGE * self.longest_edge + _BETWEEN * distance
        accepted = (outside <= allowed) & (distance <= most[point])
        # The chosen element of each point is written last.
        last = distance + outside if rank is None else rank[element]
        order = np.flatnonzero(accepted)[np.argsort(-last[accepted])]
        chosen = np.full(n, -1)
        chosen[point[order]] = order
        feet = SheetPoints(np.full(n, -1), np.full((2, n), np.nan), np.full(n, np.inf))
        inside, chosen = chosen >= 0, chosen[chosen >= 0]
        feet.element[inside] = element[chosen]
        feet.local[:, inside] = self._elements.inside(local[:, chosen])
        feet.distance[inside] = distance[chosen]
        return feet

    def flat_at(self, points: SheetPoints) -> ndarray:
        """Points in the flat ply in mm, shape (2, n); NaN if there is none."""
        return self._elements.between(self.flat, points.element, points.local)

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
