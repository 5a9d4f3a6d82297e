"""Refinement of a ply: adaptive, or uniform with four parts per element."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import Mesh, MeshQuad, MeshTri

from ..fabric import Fabric
from ..fabric.regions import fabric_on
from ..mesh.bases import node_dofs
from ..mesh.checks import MeshError
from ..mesh.selection import named_nodes, with_named_nodes
from ..mesh.splitting import SplitMesh, cut, refine_triangles, split
from .parameters import Frozen, PlyParameters, Values

if TYPE_CHECKING:
    from .ply import Ply


def shear_angle_jumps(ply: "Ply", u: ndarray) -> ndarray:
    """Jumps of the shear angle between each of the user's elements and its neighbours.

    η² = Σ h² [Γ]², summed over the interior edges of the element, with the edge length
    h and the difference [Γ] of the mean shear angles on both sides.  Where the angle is
    smooth, η decreases with the square of the element size; at a kink, linearly with
    the element size.

    Parameters
    ----------
    ply
        The ply; its mesh must not have been split before it was passed to `Ply`.
    u
        Displacement.

    Returns
    -------
    ndarray
        η in mm, shape (n_users_elements,).
    """
    mesh = ply.users_mesh
    angle = ply.on_users_elements(ply.shear_angle(u).mean(axis=1))
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    ends, sides = mesh.p[:, mesh.facets[:, inner]], mesh.f2t[:, inner]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    square = (length * (angle[sides[1]] - angle[sides[0]])) ** 2
    total = np.bincount(sides.ravel(), np.tile(square, 2), minlength=mesh.nelements)
    return np.sqrt(total)


def marked(indicator: ndarray, share: float = 0.3) -> ndarray:
    """Smallest set of elements with a given share of the squared indicator.

    Parameters
    ----------
    indicator
        One value per element, such as `shear_angle_jumps`.
    share
        Bulk fraction, above 0 and at most 1 (Dörfler 1996).

    Returns
    -------
    ndarray
        Element numbers in order of decreasing values.

    Examples
    --------
    >>> marked(np.array([1.0, 0.0, 3.0, 2.0]), 0.7)
    array([2, 3])
    """
    if not 0 < share <= 1:
        raise ValueError(f"share must be above 0 and at most 1, got {share}")
    order = np.argsort(-indicator, kind="stable")
    cumulative = np.cumsum(indicator[order] ** 2)
    enough = np.searchsorted(cumulative, share * cumulative[-1] * (1 - 1e-12)) + 1
    return order[:enough] if cumulative[-1] > 0 else order[:0]


@dataclass(frozen=True, eq=False)
class Refinement:
    """Refined ply, with the origin of its elements and nodes.

    Attributes
    ----------
    ply
        The refined ply, at rest.
    parent
        For each user element of the refined ply, the coarse user element that contains
        it.
    ends
        The two coarse nodes between which each new node of the triangle mesh lies
        halfway, shape (2, n_new).
    before
        The coarse ply.
    """

    ply: "Ply"
    parent: ndarray
    ends: ndarray
    before: "Ply"

    def carry(self, u: ndarray) -> ndarray:
        """Transfer a displacement of the coarse ply to the refined one.

        It is unchanged at existing nodes and interpolated linearly between them, so
        that the transfer is exact for displacements that are linear in the user's
        triangles.  The result is an initial guess, not an equilibrium.
        """
        vertices = self.before.nodal(u)[:, : self.before.users_mesh.nvertices]
        x = np.hstack([vertices, vertices[:, self.ends].mean(axis=1)])
        fine_u = self.ply.basis.zeros()
        fine_u[node_dofs(self.ply.basis)] = x @ self.ply.hat_functions()
        return fine_u


def refine(ply: "Ply", elements: ArrayLike) -> Refinement:
    """Refine some of the user's elements of a ply.

    All quadrilaterals are first cut into two triangles (`cut`).  Every edge of these
    elements is bisected, and further edges as needed for conformity.  Names of
    boundaries, subdomains and nodes, values of the fabric per element, the formulation
    and the loads are transferred.  New nodes are not added to named node sets.

    Parameters
    ----------
    ply
        Ply on a mesh of triangles or of quadrilaterals.
    elements
        The user's elements to refine: numbers, or one bool per element.

    Raises
    ------
    MeshError
        If the mesh was split before the ply was built.
    ValueError
        If there is no such element, the fabric has values for each part of an element,
        or the ply has a term that cannot be rebuilt on another mesh.

    Examples
    --------
    >>> from skfem import MeshTri
    >>> from skfem_textile import Fabric, Ply
    >>> ply = Ply(MeshTri().refined(2), Fabric(1e4))
    >>> finer = refine(ply, [0, 5])
    >>> finer.ply.users_mesh.nelements, len(finer.carry(ply.basis.zeros()))
    (40, 282)
    """
    mesh, of, numbers = _triangles(ply.users_mesh, elements)
    _refuse_terms_of_the_mesh(ply, "refine the ply without the term")
    refined = refine_triangles(mesh, numbers)
    fabric, parent = ply.users_fabric, of[refined.parent]
    if isinstance(fabric, Fabric):
        fabric = fabric_on(parent, fabric)
    finer = type(ply)(
        *(refined.mesh, fabric, ply.formulation, ply.user_terms),
        **ply.placement,
    )
    return Refinement(finer, parent, refined.ends, ply)


def _triangles(mesh: Mesh, elements: ArrayLike) -> tuple[MeshTri, ndarray, ndarray]:
    """Triangles of a mesh, the parent element of each, and those to refine."""
    if isinstance(mesh, SplitMesh):
        raise MeshError(
            "a split mesh cannot be refined: refine a ply on the mesh before it is "
            "split"
        )
    if isinstance(mesh, MeshTri):
        numbers = _numbers(elements, mesh.nelements)
        return mesh, np.arange(mesh.nelements), numbers
    quads: Any = mesh
    triangles = cut(quads)
    chosen = np.isin(triangles.parent, _numbers(elements, mesh.nelements))
    return triangles, triangles.parent, np.flatnonzero(chosen)


def _numbers(elements: ArrayLike, n: int) -> ndarray:
    """Element numbers from numbers or one bool per element."""
    array: Any = np.asarray(elements)
    if array.dtype == bool and array.shape == (n,):
        return np.flatnonzero(array)
    if array.size == 0:
        return np.empty(0, dtype=int)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise ValueError(
            f"elements must be element numbers or one bool for each of {n} elements, "
            f"not {array.dtype} of shape {array.shape}"
        )
    if array.min() < 0 or array.max() >= n:
        raise ValueError(
            f"element numbers must be from 0 to {n - 1}, but range from {array.min()} "
            f"to {array.max()}"
        )
    return np.unique(array)


@dataclass(frozen=True, eq=False)
class FinerPly:
    """Uniformly refined ply, with every element of the coarse ply split in four.

    Attributes
    ----------
    ply
        The fine ply.
    parent
        Coarse element that contains each fine element, shape (n_elements,).
    before
        The coarse ply.
    """

    ply: "Ply"
    parent: ndarray
    before: "Ply"

    def carry(
        self, u: ndarray, parameters: PlyParameters
    ) -> tuple[ndarray, PlyParameters, ndarray]:
        """Transfer a displacement of the coarse ply and its parameters.

        Returns
        -------
        tuple
            The displacement, unchanged at existing nodes (an initial guess, not an
            equilibrium); the parameters; and the fibre tensions of the coarse elements,
            as an argument of `Ply.stiffness`.
        """
        before, ply = self.before, self.ply
        fine_u = ply.basis.zeros()
        fine_u[node_dofs(ply.basis)] = before.nodal(u) @ ply.hat_functions()
        T = before.predicted_tension(u, np.zeros_like(u), parameters)
        T = T.mean(axis=2)[:, self.parent, None]
        tension = np.broadcast_to(T, (*T.shape[:2], ply.basis.dx.shape[1]))
        at_rest = ply.parameters_at_rest
        by_term = {
            name: Values(
                {k: self._transfer(x, at_rest[name][k]) for k, x in values.items()}
            )
            for name, values in parameters.items()
        }
        return fine_u, Frozen(by_term), ply.arranged(tension)

    def _transfer(self, values: ndarray, like: ndarray) -> ndarray:
        """Values per element, or per user element, transferred to the finer elements.

        ``like`` are the values at rest of the finer elements.
        """
        users, n = self.before.parent, like.shape[-2]
        if values.shape[-2] != len(users):
            values = values[..., users, :]
        of: Any = self.parent
        if n != len(of):  # one per element of the fine ply's user mesh
            of = getattr(self.ply.mesh, "origin", None)
        return np.ascontiguousarray(values[..., of, :])


def finer_ply(ply: "Ply") -> FinerPly:
    """Split every element of ``ply.mesh`` into four, also on split meshes.

    See `Ply.finer`.
    """
    refuse_unrefinable(ply)
    mesh, fabric = ply.mesh, ply.fabric
    finer: Any
    if isinstance(mesh, MeshTri):
        refined = refine_triangles(mesh, np.arange(mesh.nelements))
        finer, parent = refined.mesh, refined.parent
        fabric = fabric_on(parent, fabric)
    else:  # split meshes store the origin of their elements
        plain = MeshQuad(mesh.p, mesh.t, mesh.boundaries, mesh.subdomains)
        finer = split(with_named_nodes(plain, named_nodes(mesh)))
        parent = finer.origin[finer.parent]
    arguments = finer, fabric, ply.formulation, ply.user_terms
    return FinerPly(type(ply)(*arguments, **ply.placement), parent, ply)


def refuse_unrefinable(ply: "Ply") -> None:
    """Reject a ply that cannot be rebuilt or a state that cannot be transferred."""
    _refuse_terms_of_the_mesh(ply, "compare with a run at half the element size")
    for term in ply.terms:
        if term.parameters is not None and term.parameters.depends_on_steps:
            raise ValueError(f"term {term.name!r} depends on the number of load steps")


def _refuse_terms_of_the_mesh(ply: "Ply", otherwise: str) -> None:
    """Reject a ply with terms that cannot be rebuilt on another mesh."""
    for term in ply.user_terms:
        if not hasattr(term, "on"):
            name = getattr(term, "name", term)
            raise ValueError(
                f"term {name!r} is tied to the mesh: pass an object whose on(basis) "
                f"returns it, or {otherwise}"
            )
