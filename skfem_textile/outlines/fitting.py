"""Meshes of the user fitted to the singular fibres.

Nodes near a singular fibre move onto it, and triangles that it still crosses are cut.
Short edges that result are collapsed.
"""

import logging
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri
from skfem.helpers import cross

from ..fabric import Fabric, is_zero
from ..fabric.directions import with_smooth_fields
from ..mesh.checks import MeshError, check_mesh
from ..mesh.graph import boundary_edges, edges_of
from ..mesh.scikit_fem import with_names
from ..mesh.selection import SINGULAR, edge_numbers, named_nodes, with_named_nodes
from ..mesh.splitting import (
    changed,
    corner_areas,
    cut,
    original_elements,
    parts_of,
    was_split,
)
from ..mesh.user_input import coords
from ..ply.formulations import DEFAULT, ON_FIBRES, SMOOTH
from ..ply.terms import Formulation
from ..solve.conditions import Conditions
from .fibres import has_free_side_along_fibres, singular_fibres
from .meshing import along_edges
from .outline import Outline

log = logging.getLogger(__name__)

# Distance from a fibre, as a share of the shortest edge at a node, below which the node
# belongs to it.  A smaller share leaves slivers, a larger one turns elements over.
_SHARE = 0.35

# Share of the area of an element, or of a corner of a quadrilateral, that remains when
# nodes move.  Angles are then a few degrees at worst.
_LEFT = 0.3

# Length relative to the size of the outline by which fibres are extended, so that they
# cross it, and below which a node is on a fibre: coordinates in files are rounded.
_BEYOND = 1e-6

# Share of the length of a fibre above which a part without edges is reported.  It is
# far above the difference between a curved fibre and its chords.
_MISSED = 0.01

# Angle in degrees below which the smallest angle is reported.
_LEAST_ANGLE = 3.0

# Reflections closer than this share of the edges are not followed.
_FINEST = 0.5


class FittedMesh(NamedTuple):
    """Mesh fitted to the singular fibres.

    Attributes
    ----------
    mesh
        The mesh; its edges on singular fibres are named `SINGULAR`.  A `Ply` on it
        takes and returns values on the elements and nodes of the original mesh.
    parent
        Element of the original mesh in which each element lies, shape (n_elements,).
        Values per element become ``values[parent]``.
    """

    mesh: Mesh
    parent: ndarray


class Fitted(NamedTuple):
    """Mesh and fabric of a ply with edges on its singular fibres.

    Attributes
    ----------
    mesh, fabric
        See `FittedMesh` and `along_edges`; or as they were.
    formulation
        Formulation for this mesh: `ON_FIBRES` where edges lie on the singular fibres,
        also those along free sides, `SMOOTH` where there are none, `DEFAULT` where they
        cross the elements.
    note
        Changes, or the reason why there are none, in one line.
    """

    mesh: Mesh
    fabric: Fabric | Mapping[str, Fabric]
    formulation: Formulation
    note: str


def fitted(
    mesh: Mesh,
    fabric: Fabric | Mapping[str, Fabric],
    conditions: Conditions | None = None,
    loads: Iterable[Any] = (),
) -> Fitted:
    """Fit a mesh and a fabric to the singular fibres, or leave them as they are.

    Parameters
    ----------
    mesh, fabric, conditions, loads
        See `fit_to_fibres`.  Directions per element, which must vary smoothly, are
        replaced by functions of position.

    Raises
    ------
    ValueError
        If the mesh is not valid.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition, LoadStepper, Ply
    >>> mesh = MeshQuad().refined(3).scaled((50.0, 110.0)).with_defaults()
    >>> fabric = Fabric(1e5, 0.5, warp=(1, 1), weft=(-1, 1))
    >>> held = {"fixed": Condition("bottom"), "pulled": Condition("top", (0, 5))}
    >>> fit = fitted(mesh, fabric, held)
    >>> fit.note
    '10 nodes moved and 32 of 64 elements cut along singular fibres'
    >>> ply = Ply(fit.mesh, fit.fabric, fit.formulation)
    >>> u = LoadStepper(ply, held, steps=1).run().u
    >>> ply.on_users_nodes(ply.nodal(u)).shape == mesh.p.shape
    True
    """
    check_mesh(mesh)
    on: Any = mesh
    if SINGULAR in (mesh.boundaries or {}):
        note = "the mesh has edges on singular fibres already"
        return Fitted(mesh, _each(fabric, partial(along_edges, on)), ON_FIBRES, note)
    try:
        smooth = _each(fabric, partial(with_smooth_fields, mesh))
        fit = fit_to_fibres(mesh, smooth, conditions, loads)
        on = fit.mesh
        fabrics = smooth.values() if isinstance(smooth, Mapping) else [smooth]
        yields = any(is_zero(one.shear_law) for one in fabrics)
        if SINGULAR not in (on.boundaries or {}):
            outline = Outline.of_mesh(mesh)
            beside = has_free_side_along_fibres(outline, fabrics, conditions)
            chosen = ON_FIBRES if beside and not yields else SMOOTH
            return Fitted(mesh, fabric, chosen, "no fibre is singular within the mesh")
        if yields:
            raise ValueError(
                "without shear stiffness nothing resists a jump of the shear angle at "
                "singular fibres"
            )
    except ValueError as error:
        return Fitted(mesh, fabric, DEFAULT, f"the mesh is left as it is: {error}")
    along = _each(smooth, partial(along_edges, on))
    return Fitted(on, along, ON_FIBRES, _changes(mesh, fit))


def _changes(mesh: Mesh, fit: FittedMesh) -> str:
    """Numbers of nodes that a fit has moved, and of elements that it has cut."""
    cells, _ = original_elements(mesh)
    n = 1 + max(int(cell.max()) for cell in cells)
    moved = int((fit.mesh.p[:, :n] != mesh.p[:, :n]).any(axis=0).sum())
    k = len(fit.mesh.t)  # a quadrilateral that is not cut is two triangles
    whole = np.concatenate([np.full(c.shape[1], 1 + len(c) - k) for c in cells])
    cut = int((np.bincount(fit.parent, minlength=len(whole)) > whole).sum())
    of = f"{cut} of {len(whole)} elements cut along singular fibres"
    return f"{moved} nodes moved and {of}"


def _each(fabric: Any, change: Callable[[Fabric], Fabric]) -> Any:
    """A fabric, or the one of each subdomain, after a change."""
    if isinstance(fabric, Mapping):
        return {name: change(one) for name, one in fabric.items()}
    return change(fabric)


def fit_to_fibres(
    mesh: Mesh,
    fabric: Fabric | Mapping[str, Fabric],
    conditions: Conditions | None = None,
    loads: Iterable[Any] = (),
) -> FittedMesh:
    """Move nodes of a mesh onto singular fibres, and cut elements along them.

    Nodes keep their numbers, and new ones follow.  Nodes of the outline move along it,
    and corners and named nodes stay.  Names of boundaries, subdomains and nodes are
    kept.  Quadrilaterals become triangles if any of them is cut.

    Parameters
    ----------
    mesh
        A `skfem.MeshTri` or `skfem.MeshQuad`; of a `SplitMesh` the original elements
        are fitted.
    fabric
        The fabric, or one for each subdomain by name.
    conditions, loads
        See `singular_fibres`.

    Raises
    ------
    ValueError
        If the mesh is not valid, more than one subdomain with a fabric surrounds
        another, or see `singular_fibres`.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition
    >>> mesh = MeshQuad().refined(3).scaled(80.0).with_defaults()
    >>> fabric = Fabric(1e5, 0.5, warp=(2, 1), weft=(-1, 2))
    >>> held = {"fixed": Condition("bottom"), "pulled": Condition("top", (0, 20))}
    >>> fitted = fit_to_fibres(mesh, fabric, held)
    >>> fitted.mesh.nelements > 128, "singular fibres" in fitted.mesh.boundaries
    (True, True)
    """
    check_mesh(mesh)
    mesh = cut(mesh) if was_split(mesh) else mesh
    fabrics: dict[str, Fabric] = {}
    regions: dict[str, ndarray] = {}
    if isinstance(fabric, Mapping):
        fabric, fabrics, regions = _of_subdomains(mesh, fabric)
    outline = Outline.of_mesh(mesh, regions)
    edges = np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0]
    finest = _FINEST * float(np.median(np.hypot(*edges)))
    lines = singular_fibres(
        outline, fabric, conditions, loads, fabrics=fabrics, finest=finest
    )
    fibres = [_extended(f.points, _BEYOND * outline.size) for f in lines.fibres]
    fit = _Fit(mesh, outline, fibres)
    for i in range(len(fibres)):
        fit.move(i)
    if len(fit.t) == 4 and any(fit.is_crossed(i) for i in range(len(fibres))):
        fit.halve_quads()
    if len(fit.t) == 3:
        for i in range(len(fibres)):
            fit.move(i)
            fit.cut(i)
            fit.collapse(i)
    return fit.result(mesh)


def _of_subdomains(
    mesh: Mesh, given: Mapping[str, Fabric]
) -> tuple[Fabric, dict[str, Fabric], dict[str, ndarray]]:
    """The fabric around all regions, and fabrics and corners of the regions by name."""
    if not given:
        raise ValueError("there is no fabric: specify one for each subdomain")
    around, surrounding = list(given.values())[-1:], list[str]()
    fabrics: dict[str, Fabric] = {}
    regions: dict[str, ndarray] = {}
    for name, fabric in given.items():
        elements = (mesh.subdomains or {}).get(name, ())
        shape = shapely.union_all(shapely.polygons(mesh.p[:, mesh.t[:, elements]].T))
        parts = shapely.get_parts(shape)
        if any(part.interiors for part in parts):
            surrounding, around = [*surrounding, name], [fabric]
            continue
        for i, part in enumerate(parts, start=1):
            fabrics[f"{name} {i}"] = fabric
            corners = shapely.simplify(part, 0.0).exterior.coords[:-1]
            regions[f"{name} {i}"] = np.transpose(corners)
    if len(surrounding) > 1:
        raise ValueError(
            f"the subdomains {surrounding[0]!r} and {surrounding[1]!r} both have holes"
        )
    return around[0], fabrics, regions


def _extended(points: ndarray, length: float) -> Any:
    x = points.copy()
    for end, other in ((0, 1), (-1, -2)):
        along = x[:, end] - x[:, other]
        x[:, end] += length * along / np.hypot(*along)
    return shapely.linestrings(x.T)


class _Fit:
    """Mesh during the fit."""

    def __init__(self, mesh: Mesh, outline: Outline, fibres: list[Any]) -> None:
        self.p, self.t = mesh.p.copy(), mesh.t.copy()
        self.parent = np.arange(mesh.nelements)
        self._fibres, self._near = fibres, _BEYOND * outline.size
        self._names = {n: mesh.facets[:, e] for n, e in (mesh.boundaries or {}).items()}
        self._n = n = mesh.p.shape[1]
        self._on = np.zeros((len(fibres), n), dtype=bool)
        self._kind = np.full(n, FREE)
        self._line = np.full(n, -1)  # on which a node may move; −1 is the outline
        self._lines = [*fibres, outline.shape().boundary]
        self._kind[np.unique(mesh.facets[:, mesh.boundary_facets()])] = ON_LINE
        corners = shapely.STRtree(shapely.points(np.hstack(outline.rings).T))
        at, _ = corners.query(shapely.points(self.p.T), "dwithin", self._near)
        self._kind[at] = FIXED
        for edges in self._names.values():  # interior boundaries stay
            inner = self._kind[edges] == FREE
            self._kind[edges[inner]] = FIXED
        self._region = _regions(mesh)
        edges = edges_of([self.t])[0]
        self._kind[edges[:, self._on_border(edges)]] = FIXED
        for nodes in named_nodes(mesh).values():
            self._kind[nodes] = FIXED
        for i in range(len(fibres)):
            self._settle(i)

    def _on_border(self, edges: ndarray) -> ndarray:
        """True for edges, given by their ends, between subdomains."""
        pairs, of_side = edges_of([self.t])
        region = np.tile(self._region[self.parent], len(self.t))
        lowest, highest = np.full(pairs.shape[1], region.max()), 0 * pairs[0]
        np.minimum.at(lowest, of_side, region)
        np.maximum.at(highest, of_side, region)
        return (lowest < highest)[edge_numbers(pairs, edges)]

    def _settle(self, i: int) -> None:
        """Restrict nodes on a fibre to it."""
        on = shapely.distance(self._fibres[i], shapely.points(self.p.T)) <= self._near
        self._on[i] = on
        self._kind[on & (self._kind == ON_LINE) & (self._line != i)] = FIXED
        free = on & (self._kind == FREE)
        self._kind[free], self._line[free] = ON_LINE, i

    def _shortest(self) -> ndarray:
        """Length of the shortest edge at each node."""
        edges, _ = edges_of([self.t])
        length = np.hypot(*(self.p[:, edges[0]] - self.p[:, edges[1]]))
        shortest = np.full(self.p.shape[1], np.inf)
        for end in edges:
            np.minimum.at(shortest, end, length)
        return shortest

    def _areas(self) -> ndarray:
        """Twice the signed areas of the triangles or corners, shape (k, n_elements)."""
        if len(self.t) == 4:
            return corner_areas(MeshQuad(self.p, self.t))
        return np.abs(self._signed())[None]

    def _signed(self) -> ndarray:
        a, b, c = self.p[:, self.t[:3]].transpose(1, 0, 2)
        return cross(b - a, c - a)

    def move(self, i: int) -> None:
        """Move nodes near a fibre onto it, unless elements would become slivers."""
        fibre, near = self._fibres[i], _SHARE * self._shortest()
        distance = shapely.distance(fibre, shapely.points(self.p.T))
        moved = np.flatnonzero((distance < near) & (self._kind < FIXED) & ~self._on[i])
        before, areas, signs = self.p.copy(), self._areas(), np.sign(self._signed())
        for k in moved:
            x = shapely.Point(self.p[:, k])
            if self._kind[k] == FREE:
                target = fibre.interpolate(fibre.project(x))
            else:
                target = fibre & self._lines[self._line[k]]
                if target.is_empty or x.distance(target) > 2 * near[k]:
                    continue
                target = shapely.get_point(shapely.shortest_line(x, target), 1)
            self.p[:, k] = target.x, target.y
        while moved.size:
            poor = (self._areas() < _LEFT * areas).any(axis=0)
            poor |= np.sign(self._signed()) != signs
            back = np.intersect1d(moved, self.t[:, poor])
            if not back.size:
                break
            self.p[:, back] = before[:, back]
            moved = np.setdiff1d(moved, back)
        self._settle(i)

    def _crossings(self, i: int) -> tuple[ndarray, ndarray]:
        """Edges that a fibre crosses between their ends, and the points nearest one."""
        edges, _ = edges_of([self.t])
        edges = edges[:, ~self._on[i][edges].all(axis=0)]
        sides = shapely.linestrings(self.p[:, edges].transpose(2, 1, 0))
        at = shapely.intersection(sides, self._fibres[i])
        x, of_edge = shapely.get_coordinates(at, return_index=True)
        end = edges[:, of_edge]
        gap = np.linalg.norm(x.T[:, None] - self.p[:, end], axis=0)
        between = ~((gap <= 2 * self._near) & self._on[i][end]).any(axis=0)
        _, first = np.unique(of_edge[between], return_index=True)
        return end[:, between][:, first], x[between][first].T

    def is_crossed(self, i: int) -> bool:
        """True if a fibre crosses edges or runs along diagonals of quadrilaterals."""
        on = self._on[i][self.t]
        diagonal = (on == on[[2, 3, 0, 1]]).all(axis=0) & (on[0] != on[1])
        return bool(diagonal.any() or self._crossings(i)[0].size)

    def halve_quads(self) -> None:
        """Cut quadrilaterals into triangles, along a fibre if it is a diagonal."""
        corner = corner_areas(MeshQuad(self.p, self.t))
        switch = corner[1::2].min(axis=0) < corner[::2].min(axis=0)
        for on in self._on:
            first, second = (on[self.t[k::2]].all(axis=0) for k in (0, 1))
            switch = np.where(first != second, second, switch)
        # Only convex corners may lie beside the diagonal.
        switch &= (corner[::2] > 0).all(axis=0)
        switch |= (corner[1::2] <= 0).any(axis=0)
        t = np.where(switch, np.roll(self.t, -1, axis=0), self.t)
        self.t = np.hstack([t[[0, 1, 2]], t[[0, 2, 3]]])
        self.parent = np.tile(self.parent, 2)

    def cut(self, i: int) -> None:
        """Cut triangles along a fibre, repeatedly, as it may cross an edge twice."""
        while (crossings := self._crossings(i))[0].size:
            self._cut_edges(i, *crossings)

    def _cut_edges(self, i: int, edges: ndarray, at: ndarray) -> None:
        n, k = self.p.shape[1], at.shape[1]
        on_outline = edge_numbers(np.sort(boundary_edges([self.t]), axis=0), edges) >= 0
        along = np.all(self._on[:, edges], axis=1)  # edges on other fibres
        at = self._at_both(i, edges, at, along)
        self.p = np.hstack([self.p, at])
        self._on = np.hstack([self._on, along])
        self._on[i, n:] = True
        fixed = on_outline | along.any(axis=0)
        fixed |= self._on_border(edges)
        self._kind = np.append(self._kind, np.where(fixed, FIXED, ON_LINE))
        self._line = np.append(self._line, np.full(k, i))
        order = np.lexsort(edges[::-1])
        edges, number = edges[:, order], n + order

        def middle(ends: ndarray) -> ndarray:
            found = edge_numbers(edges, ends)
            return np.where(found >= 0, number[found], -1)

        for name, ends in self._names.items():
            m = middle(ends)
            new = [np.stack([end, m])[:, m >= 0] for end in ends]
            self._kind[m[m >= 0]] = FIXED
            self._names[name] = np.hstack([ends[:, m < 0], *new])
        self._cut_triangles(middle)

    def _at_both(self, i: int, edges: ndarray, at: ndarray, along: ndarray) -> ndarray:
        """Move crossings on edges along other fibres to the intersection of both."""
        length = np.hypot(*(self.p[:, edges[0]] - self.p[:, edges[1]]))
        for j, k in np.argwhere(along):
            both, x = self._fibres[i] & self._fibres[j], shapely.Point(at[:, k])
            if not both.is_empty and x.distance(both) < _SHARE * length[k]:
                own = shapely.get_point(shapely.shortest_line(x, both), 1)
                at[:, k] = own.x, own.y
        return at

    def _cut_triangles(self, middle: Any) -> None:
        m = np.stack([middle(self.t[[j, (j + 1) % 3]]) for j in range(3)])
        count = (m >= 0).sum(axis=0)
        pieces = [(count == 0, tuple(self.t))]
        for j in range(3):
            (a, b, c), (ab, bc, ca) = (np.roll(x, -j, axis=0) for x in (self.t, m))
            one = (count == 1) & (ab >= 0)
            pieces += [(one, (a, ab, c)), (one, (ab, b, c))]
            two = (count == 2) & (bc < 0)  # the corner a is cut off
            # The shorter diagonal of the rest.
            first = np.hypot(*(self.p[:, ab] - self.p[:, c])) < np.hypot(
                *(self.p[:, b] - self.p[:, ca])
            )
            rest = (ab, b, np.where(first, c, ca)), (np.where(first, ab, b), c, ca)
            pieces += [(two, corners) for corners in ((a, ab, ca), *rest)]
        (a, b, c), (ab, bc, ca) = self.t, m
        quarters = (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)
        pieces += [(count == 3, corners) for corners in quarters]
        self.t = np.hstack([np.stack(corners)[:, of] for of, corners in pieces])
        self.parent = np.concatenate([self.parent[of] for of, _ in pieces])

    def collapse(self, i: int) -> None:
        """Collapse short edges of poor triangles at a fibre, where angles increase.

        Nodes on a line move along it only, the outline and the lines remain edges, and
        the nodes of the given mesh remain.
        """
        turned = self._signed() < 0
        self.t[1:, turned] = self.t[:0:-1, turned]
        t, nodes = self.t, (self.p, self._kind, self._line, self._on)
        becomes, alive = np.arange(self.p.shape[1]), np.ones(t.shape[1], dtype=bool)
        angles = smallest_angles(self.p, t)
        poor = np.flatnonzero((angles < _POOR) & self._on[i][t].any(axis=0))
        queue = poor[np.argsort(angles[poor])].tolist()
        while queue:
            k = queue.pop(0)
            if not alive[k] or angles[k] >= _POOR:
                continue
            for a, b in _short_first(self.p, t[:, k]):
                around = np.flatnonzero(alive & ((t == a) | (t == b)).any(axis=0))
                has_a, has_b = ((t[:, around] == end).any(axis=0) for end in (a, b))
                if not self._may_move(a, b, t[:, around], has_a, has_b):
                    continue
                rest = around[has_a != has_b]
                moved = np.where(t[:, rest] == a, b, t[:, rest])
                after = smallest_angles(self.p, moved)
                if after.min() <= angles[around].min():
                    continue
                keep, drop = min(a, b), max(a, b)
                for values in nodes:
                    values[..., keep] = values[..., b]
                becomes[becomes == drop] = keep
                t[:, rest] = np.where(moved == drop, keep, moved)
                alive[around[has_a & has_b]] = False
                angles[rest] = after
                queue += rest[after < _POOR].tolist()
                break
        used = np.unique(becomes)
        number = np.searchsorted(used, becomes)
        self.p, self._kind, self._line, self._on = (x[..., used] for x in nodes)
        self.t, self.parent = number[t[:, alive]], self.parent[alive]
        for name, ends in self._names.items():
            ends = number[ends]
            self._names[name] = ends[:, ends[0] != ends[1]]

    def _may_move(
        self, a: int, b: int, t: ndarray, has_a: ndarray, has_b: ndarray
    ) -> bool:
        """True if node a may be merged with its neighbour b at the position of b.

        ``t`` are the triangles around both, ``has_a`` and ``has_b`` which nodes they
        have.
        """
        if max(a, b) < self._n:
            return False
        n_both = np.count_nonzero(has_a & has_b)
        if np.intersect1d(t[:, has_a], t[:, has_b]).size != 2 + n_both:
            return False
        if self._kind[a] == ON_LINE:
            i = self._line[a]
            return bool(n_both == 1 if i < 0 else self._on[i, [a, b]].all())
        return bool(self._kind[a] == FREE)

    def result(self, mesh: Mesh) -> FittedMesh:
        """The mesh, with names."""
        kind = MeshTri if len(self.t) == 3 else MeshQuad
        fitted = kind(np.ascontiguousarray(self.p), np.ascontiguousarray(self.t))
        try:
            check_mesh(fitted)
        except MeshError:
            raise MeshError(
                "elements along the singular fibres would be inverted or degenerate: "
                "use smaller elements, or mesh_outline"
            ) from None
        boundaries = {
            name: edge_numbers(fitted.facets, ends)
            for name, ends in self._names.items()
        }
        singular = np.zeros(fitted.nfacets, dtype=bool)
        for i in range(len(self._fibres)):
            singular |= self._edges_along(i, fitted)
        singular &= fitted.f2t[1] >= 0
        if singular.any():
            boundaries[SINGULAR] = np.flatnonzero(singular)
        subdomains = parts_of(self.parent, mesh.subdomains)
        fitted = with_names(fitted, boundaries or None, subdomains)
        if len(self.t) == 3 and len(self.parent) > mesh.nelements:
            self._report_smallest_angle()
        fitted = with_named_nodes(fitted, named_nodes(mesh))
        made = changed(fitted, mesh, self.parent)
        return FittedMesh(made, made.parent)

    def _report_smallest_angle(self) -> None:
        """Log the smallest angle if it is very small."""
        angles = smallest_angles(self.p, self.t)
        least = angles.argmin()
        if angles[least] < _LEAST_ANGLE:
            log.warning(
                "the smallest angle of the fitted mesh is %.2g°, near %s, where "
                "singular fibres, the outline or named nodes are close; use smaller "
                "elements there, or mesh_outline",
                angles[least],
                coords(self.p[:, self.t[:, least]].mean(axis=1)),
            )

    def _edges_along(self, i: int, fitted: Mesh) -> ndarray:
        """True for the edges of a mesh on a fibre; logs a part of it without edges."""
        fibre, ends = self._fibres[i], fitted.facets
        along = self._on[i][ends].all(axis=0)
        x = fitted.p[:, ends[:, along]]
        length = np.hypot(*(x[:, 1] - x[:, 0]))
        middle = shapely.points(x.mean(axis=1).T)
        along[along] = shapely.distance(fibre, middle) < _SHARE * length
        edges = shapely.linestrings(fitted.p[:, ends[:, along]].transpose(2, 1, 0))
        missed = fibre.length - shapely.length(edges).sum()
        rest = fibre - shapely.buffer(shapely.union_all(edges), 10 * self._near)
        if missed > _MISSED * fibre.length and not rest.is_empty:
            part = max(shapely.get_parts(rest), key=shapely.length)
            where = coords(np.array(part.coords[0]))
            log.warning(
                "%.3g mm of a singular fibre of %.3g mm have no edges, near %s; "
                "use smaller elements there, or mesh_outline",
                missed,
                fibre.length,
                where,
            )
        return along


def _regions(mesh: Mesh) -> ndarray:
    """Number of each element's set of subdomains, shape (n_elements,)."""
    n = np.arange(mesh.nelements)
    rows = [np.isin(n, elements) for elements in (mesh.subdomains or {}).values()]
    inside = np.reshape(rows, (-1, len(n)))
    return np.unique(inside, axis=1, return_inverse=True)[1].ravel()


# Kinds of nodes: free, on one line along which they may move, and fixed.
FREE, ON_LINE, FIXED = 0, 1, 2

# Angle in degrees below which a triangle is improved.
_POOR = 15.0


def smallest_angles(p: ndarray, t: ndarray) -> ndarray:
    """Smallest angle of each triangle in degrees, negative if it is turned over."""
    side = p[:, np.roll(t, -1, axis=0)] - p[:, t]
    length = np.hypot(*side)
    after = np.roll(side, -1, axis=1)
    area = side[0] * after[1] - side[1] * after[0]
    sine = area / np.maximum(length * np.roll(length, -1, axis=0), 1e-300)
    angle = np.degrees(np.arcsin(np.clip(sine, -1, 1)))
    # The arcsine is right for acute angles, and the smallest angle is acute.
    return angle.min(axis=0)


def _short_first(p: ndarray, corners: ndarray) -> list[tuple[int, int]]:
    """Pairs (a, b) of corners, those at the ends of the shortest edge first."""
    ends = np.stack([corners, np.roll(corners, -1)])
    order = np.argsort(np.hypot(*(p[:, ends[0]] - p[:, ends[1]])))[:2]
    pairs = ends[:, order].T.tolist()
    return [pair for a, b in pairs for pair in ((a, b), (b, a))]
