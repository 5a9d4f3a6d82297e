"""A ply of which every element is split in four, which takes over states."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from ..fabric.regions import fabric_on
from ..mesh.bases import node_dofs
from ..mesh.selection import named_nodes, with_named_nodes
from ..mesh.splitting import hat_functions, refine_triangles, split
from .parameters import Frozen, PlyParameters, Values


@dataclass(frozen=True, eq=False)
class FinerMesh:
    """A mesh of which every element is split in four, with the names of the one before.

    Attributes
    ----------
    mesh
        The finer mesh.  Its first nodes are those of the mesh before, then of triangles
        the middles of the edges in the order of ``facets``.
    parent
        For each element the one before that it is part of, shape (n_elements,).
    """

    mesh: Mesh
    parent: ndarray

    def nodal(self, values: ndarray, n_nodes: int) -> ndarray:
        """Values at the nodes of a finer mesh, shape (..., n_nodes).

        They are those at the nodes before, shape (..., n_before), and between them
        linear along edges, and their mean in the middle of elements.
        """
        return np.asarray(values @ hat_functions(self.mesh, n_nodes))


def finer_mesh(mesh: Mesh) -> FinerMesh:
    """Split every element of a mesh in four, however it came to be.

    Parameters
    ----------
    mesh
        A `skfem.MeshQuad` or a `skfem.MeshTri`.
    """
    if isinstance(mesh, MeshTri):
        refined = refine_triangles(mesh, np.arange(mesh.nelements))
        return FinerMesh(refined.mesh, refined.parent)
    plain = MeshQuad(mesh.p, mesh.t, mesh.boundaries, mesh.subdomains)
    parts = split(with_named_nodes(plain, named_nodes(mesh)))
    return FinerMesh(parts, parts.origin[parts.parent])


@dataclass(frozen=True, eq=False)
class FinerPly:
    """A ply of which every element is split in four, and the one before.

    Attributes
    ----------
    ply
        The finer ply.
    parent
        For each of its elements the one before that it is part of, shape (n_elements,).
    mesh
        Its mesh, and where the elements come from.
    before
        The ply before.
    """

    ply: Any
    parent: ndarray
    mesh: FinerMesh
    before: Any

    def carry(
        self, u: ndarray, parameters: PlyParameters
    ) -> tuple[ndarray, PlyParameters, ndarray]:
        """Carry over a displacement of the ply before, and its parameters.

        Returns
        -------
        tuple
            The displacement, the same at the nodes that were there: not in balance, but
            near a state.  The parameters.  Fibre tensions of the elements before, as
            `Ply.stiffness` takes them.
        """
        before, ply = self.before, self.ply
        carried = ply.basis.zeros()
        nodes = self.mesh.nodal(before.nodal(u), ply.nodes.shape[1])
        carried[node_dofs(ply.basis)] = nodes
        T = before.predicted_tension(u, np.zeros_like(u), parameters)
        T = T.mean(axis=2)[:, self.parent, None]
        tension = np.broadcast_to(T, (*T.shape[:2], ply.basis.dx.shape[1]))
        return carried, self._carried(parameters), ply.arranged(tension)

    def _carried(self, parameters: PlyParameters) -> PlyParameters:
        """Parameters of the finer ply: those of the elements before.

        A value is one of each element, or of each of the user's.
        """
        users, at_rest = self.before.parent, self.ply.parameters_at_rest
        return Frozen(
            {
                name: Values(
                    {
                        key: _carried(value, at_rest[name][key], users, self.mesh)
                        for key, value in values.items()
                    }
                )
                for name, values in parameters.items()
            }
        )


def finer_ply(ply: Any) -> FinerPly:
    """Split every element of ``ply.mesh`` in four; see `Ply.finer`."""
    refuse_what_has_no_finer(ply)
    fine, fabric = finer_mesh(ply.mesh), ply.fabric
    if isinstance(fine.mesh, MeshTri):  # what is split knows where it comes from
        fabric = fabric_on(fine.parent, fabric)
    arguments = fabric, ply.formulation, ply.further_terms_as_given
    finer = type(ply)(fine.mesh, *arguments, **ply.placement)
    return FinerPly(finer, fine.parent, fine, ply)


def refuse_what_has_no_finer(ply: Any) -> None:
    """Refuse a ply that cannot be built on a finer mesh, or takes over no state there.

    Raises
    ------
    ValueError
        If that is so.
    """
    for term in ply.further_terms_as_given:
        if not hasattr(term, "on"):
            name = getattr(term, "name", term)
            raise ValueError(
                f"term {name!r} is of the mesh alone: give an object whose on(basis) "
                "returns it, or compare a run with half the element size"
            )
    for term in ply.terms:
        if term.parameters is not None and term.parameters.depends_on_steps:
            raise ValueError(f"the {term.name} depends on the steps")


def _carried(
    values: ndarray, like: ndarray, users: ndarray, fine: FinerMesh
) -> ndarray:
    """Values of each element, or user's element, as those of finer ones.

    ``like`` are the values at rest of the finer ones, ``users`` the user's element of
    each element before.
    """
    n = like.shape[-2]
    if values.shape[-2] != len(users):
        values = values[..., users, :]
    of = fine.parent if n == len(fine.parent) else getattr(fine.mesh, "origin", None)
    return np.ascontiguousarray(values[..., of, :])
