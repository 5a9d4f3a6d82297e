"""Ply model: mesh, fabric, formulation and terms as a function of the displacement."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree
from skfem import Mesh

from .. import forms
from ..fabric import Fabric, is_zero
from ..fabric.law_check import check_laws
from ..fabric.regions import fabric_of_regions, fabric_on
from ..forms.form import directions
from ..mesh.bases import components, node_positions
from ..mesh.progress import shown
from ..mesh.scikit_fem import FormExtraParams
from ..mesh.selection import FibreEnd
from ..mesh.splitting import at_nodes, hat_functions, original_elements, was_changed
from .builtin_terms import (
    Corners,
    CornerTerm,
    bending_term,
    checked_ends,
    corner_stiffness,
)
from .formulations import DEFAULT
from .parameters import NO_VALUES, with_slip_of
from .sum_of_terms import SumOfTerms
from .term_check import check_term, contradiction
from .terms import FormTerm, Formulation, Load, TensionTerm, Term


class Ply(SumOfTerms):
    """Energy of a ply and its derivatives.

    Only the terms required by the fabric and the formulation are built: no shear term
    without shear stiffness, no hourglass basis without stabilisation.

    Parameters
    ----------
    mesh
        Reference configuration: a `skfem.MeshQuad`, a `skfem.MeshTri`, or a result of
        `read_mesh` for a file with both kinds of elements.
    fabric
        Fibre directions and laws; or a fabric for each of the mesh's subdomains, by
        name: ``Fabric(0.0)`` where there is none.  Values per element refer to the
        user's elements or to the elements of ``ply.mesh``.
    formulation
        `Macro`, `OnePoint`, `Full` or `Quadratic`.
    terms
        Further terms and loads with unique names.  Terms whose bases are built on
        ``ply.mesh`` are added with `with_terms`.
    dimension
        Number d of displacement components: 2 for a ply in its plane, 3 for a ply in
        space, whose mesh and fibre directions lie in the plane z = 0 at rest.
    fibre_ends
        Rotational boundary conditions of fibres with bending stiffness, by boundary
        name: ``clamped`` fixes their initial direction, ``mirror`` is a plane of
        symmetry.  A function of the load factor is a rotating clamp: it returns the
        axis times the angle in radians, shape (3,), or the angle in the plane.  Other
        fibre ends are hinged.

    Attributes
    ----------
    mesh
        The computational mesh.  `Macro` splits the user's elements (`split`), unless
        they were split already; `OnePoint` and `Full` split triangles, and `Quadratic`
        cuts quadrilaterals (`cut`).  The user's nodes come first, with the same
        numbers, and the names of boundaries, subdomains and nodes are kept.
    users_mesh
        Mesh of the user: as passed, or the one of which it was cut or fitted.
    cells
        The user's elements as node numbers, arrays of shape (3, n) and (4, n).
    parent
        Index into ``cells`` of the user's element that contains each element of
        ``mesh``, shape (n_elements,).
    basis
        `skfem.CellBasis` of the displacement at the integration points of the ply.
        Every ``u`` below is a DOF vector of this basis, and every ``t`` a load factor,
        which enters loads and some user terms.
    nodes
        Reference positions of the nodes, shape (2, n_nodes): the vertices of the mesh,
        then, for `Quadratic`, the edge midpoints in the order of ``mesh.facets``.
    centre, fine_points
        Reference coordinates of the element centre, shape (2, 1), and of the points at
        which strain and folding are checked, (2, n_points): 2×2 for quadrilaterals, six
        for quadratic triangles.
    corners
        Det F at the nodes of the elements, where folding is also checked.
    further_terms, user_terms
        Terms and loads besides fabric and formulation: as terms on the basis of the
        ply, and as passed by the user.
    follows_load_factor
        True if the energy may change with the load factor.

    Raises
    ------
    MeshError
        If the mesh is not valid, or was changed after splitting.
    ValueError
        If the fabric has no stiffness, a fibre direction is invalid on the mesh, a law
        is inconsistent (`check_laws`), a term is invalid, the dimension is not 2 or 3,
        or fibre ends are unknown.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply
    >>> ply = Ply(MeshQuad().refined(2), Fabric(1e4))
    >>> u = ply.basis.zeros()
    >>> float(ply.energy(u)), ply.residual(u).shape, ply.tangent(u).shape
    (0.0, (162,), (162, 162))
    """

    @shown("preparing the ply")
    def __init__(
        self,
        mesh: Mesh,
        fabric: Fabric | Mapping[str, Fabric],
        formulation: Formulation = DEFAULT,
        terms: Iterable[Term | Load] = (),
        *,
        dimension: int = 2,
        fibre_ends: Mapping[str, FibreEnd] | None = None,
    ) -> None:
        _refuse_other_kinds(dimension, formulation, fabric)
        self.users_mesh = mesh.original if was_changed(mesh) else mesh
        self.mesh = mesh = formulation.working_mesh(mesh)
        self.basis = formulation.basis(mesh, dimension)
        self._build(fabric, formulation, terms, fibre_ends)

    def _build(
        self,
        fabric: Fabric | Mapping[str, Fabric],
        formulation: Formulation,
        terms: Iterable[Term | Load],
        fibre_ends: Mapping[str, FibreEnd] | None,
    ) -> None:
        """Build the terms on the mesh and the basis."""
        mesh = self.mesh
        self.cells, self.parent = original_elements(mesh)
        if isinstance(fabric, Mapping):
            fabric = fabric_of_regions(mesh, fabric, self.parent)
        self.fabric = fabric = fabric_on(self.parent, fabric)
        self.formulation = formulation
        self.fibre_ends = checked_ends(mesh, fibre_ends or {})
        basis: Any = self.basis
        basis.mirrors = [
            mesh.boundaries[x] for x, end in self.fibre_ends.items() if end == "mirror"
        ]
        check_laws(fabric.at(), self.basis.dx.shape)
        if fabric.yarns is not None:
            from .slip import friction_of

            friction_of(self, fabric.yarns)  # refuses yarns without friction
        self.nodes = node_positions(self.basis)
        self.fine_points = formulation.fine_points
        self.corners = Corners(self.basis)
        tension, corners = None, None
        if not all(is_zero(family.tension) for family in fabric.families):
            tension = formulation.tension_term(self.basis, fabric)
        if (kappa := corner_stiffness(fabric, self.basis)) > 0:
            corners = CornerTerm(kappa, self.basis, self.corners)
        needed = self._needed_terms(tension, corners)
        bases = {term.basis: None for term in needed if isinstance(term, FormTerm)}
        for of_term in bases:  # rejects invalid directions
            directions(fabric, FormExtraParams(of_term.default_parameters()))
        self.user_terms = tuple(terms)
        every = *needed, *self.user_terms
        super().__init__(self.basis, fabric, every, tension)
        self.further_terms = self.terms[len(needed) :]
        turning = any(map(callable, self.fibre_ends.values()))
        self.follows_load_factor = bool(self.further_terms) or turning
        for term in self.further_terms:
            check_term(term, self.basis, self.element_size)

    def _needed_terms(
        self, tension: TensionTerm | None, corners: CornerTerm | None
    ) -> list[Term]:
        fabric, basis = self.fabric, self.basis
        terms: list[Term] = [tension] if tension else []
        if not is_zero(fabric.shear_law):
            slip = with_slip_of(None, fabric, basis, "shear")
            shear = FormTerm("shear", forms.shear(fabric), basis, parameters=slip)
            terms.append(shear)
        if not terms:
            raise ValueError("the fabric has no stiffness: specify tension or shear")
        if corners:
            terms.append(corners)
        if fabric.bends:
            terms.append(bending_term(basis, fabric, self.fibre_ends))
        of_fibres: Any = tension.basis if tension else basis
        return terms + self.formulation.stabilising_terms(of_fibres, fabric)

    def with_terms(self, *terms: Term | Load) -> "Ply":
        """A copy of the ply at rest, on the same mesh, with further terms.

        Build the bases of the terms on ``ply.mesh``.

        Raises
        ------
        ValueError
            If a term is not valid, or its name is not unique.
        """
        further = (*self.user_terms, *terms)
        arguments = self.mesh, self.fabric, self.formulation, further
        ply = Ply(*arguments, **self.placement)
        ply.users_mesh = self.users_mesh
        return ply

    def contradictions(self, states: Sequence[Any]) -> list[str]:
        """Contradictions of terms in the states of a run, in one line each.

        Between energy, residual and tangent of users' terms at the last state; terms of
        this package are not evaluated, except users' forms.  And those that a method
        ``contradictions`` of a term finds in the states, such as friction without
        contact.
        """
        u, t, parameters = (
            getattr(states[-1], x) for x in ("u", "load_factor", "parameters")
        )
        package, pairs = __package__.split(".")[0], []
        for given, term in zip(self.user_terms, self.further_terms, strict=True):
            own = type(given).__module__.split(".")[0] == package
            if isinstance(given, FormTerm) or not own:
                pairs.append((term, parameters.get(term.name, NO_VALUES)))
        found = (contradiction(x, u, t, p, self.element_size) for x, p in pairs)
        lines = [line for line in found if line]
        for term in self.further_terms:
            if of_states := getattr(term, "contradictions", None):
                lines += of_states(states)
        return lines

    @property
    def placement(self) -> dict[str, Any]:
        """Dimension and fibre ends, as arguments for another ply of the same fabric."""
        return {"dimension": components(self.basis), "fibre_ends": self.fibre_ends}

    def positions(self, u: ndarray) -> ndarray:
        """Positions of the nodes in mm, shape (d, n_nodes)."""
        return self.at_rest + self.nodal(u)

    @property
    def at_rest(self) -> ndarray:
        """Positions of the nodes of the undeformed ply in mm, shape (d, n_nodes)."""
        if layers := getattr(self.basis, "layers", None):  # of a stack
            return np.asarray(layers.X)
        flat = components(self.basis) - 2
        return np.pad(self.nodes, ((0, flat), (0, 0)))

    def hat_functions(self) -> csr_matrix:
        """Hat functions of the corners of the user's elements at all nodes.

        Shape (n_corners, n_nodes).
        """
        return hat_functions(self.mesh, self.nodes.shape[1])

    def on_users_elements(self, values: ndarray) -> ndarray:
        """Area-weighted mean of a field over each of the user's elements.

        Parameters
        ----------
        values
            One value per element of ``mesh``, shape (..., n_elements).

        Returns
        -------
        ndarray
            Shape (..., n_users_elements), in the order of ``cells``.

        Raises
        ------
        ValueError
            If the number of values differs from the number of elements.

        Examples
        --------
        >>> from skfem import MeshQuad
        >>> from skfem_textile import Fabric, Ply
        >>> ply = Ply(MeshQuad(), Fabric())
        >>> x, y = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
        >>> ply.on_users_elements(x)
        array([0.5])
        """
        matrix = self._means_on_users_elements
        return _mapped("elements of ply.mesh", values, matrix)

    @cached_property
    def _means_on_users_elements(self) -> csr_matrix:
        """Shares of the elements in the user's, (n_users_elements, n_elements)."""
        mesh, parent, number = self.mesh, self.parent, np.arange(self.mesh.nelements)
        area = self.basis.dx.sum(axis=1)
        total = np.zeros(sum(cell.shape[1] for cell in self.cells))
        np.add.at(total, parent, area)
        rows, columns, share = parent, number, area / total[parent]
        if (lost := np.flatnonzero(total == 0)).size:  # by a fit: a neighbour is there
            corners = (self.users_points[:, cell].mean(axis=1) for cell in self.cells)
            centre = np.hstack([*corners])[:, lost]
            centres = mesh.p[:, mesh.t].mean(axis=1)
            _, nearest = KDTree(centres.T).query(centre.T)
            rows, columns = np.append(parent, lost), np.append(number, nearest)
            share = np.append(share, np.ones(len(lost)))
        return csr_matrix((share, (rows, columns)))

    def on_users_nodes(self, values: ndarray) -> ndarray:
        """Nodal field at the ``users_points``, where they were before a fit.

        Parameters
        ----------
        values
            One value per node of ``nodes``, shape (..., n_nodes), such as ``nodal(u)``.

        Returns
        -------
        ndarray
            Shape (..., n_users_points).

        Raises
        ------
        ValueError
            If the number of values differs from the number of nodes.

        Examples
        --------
        >>> from skfem import MeshQuad
        >>> from skfem_textile import Fabric, Ply
        >>> ply = Ply(MeshQuad(), Fabric())
        >>> ply.on_users_nodes(ply.nodes).tolist()
        [[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]]
        """
        return _mapped("nodes of ply.nodes", values, self._at_users_nodes)

    @cached_property
    def recovery(self) -> csr_matrix:
        """Smooth values at the nodes of the mesh of values at `centre`.

        See `mesh.recovery.recovery`.
        """
        from ..mesh.recovery import recovery  # not imported for plies in the plane

        return recovery(self.mesh)

    def largest_shear_angle(self, u: ndarray) -> float:
        """Largest shear angle in radians, recovered at the nodes or at the centres."""
        angle = self.shear_angle(u, self.centre)[:, 0]
        at_nodes = self.recovery @ angle
        return float(max(np.abs(at_nodes).max(), np.abs(angle).max()))

    @cached_property
    def _at_users_nodes(self) -> csr_matrix:
        """Values of nodal fields at the user's nodes, (n_users_points, n_nodes)."""
        d = components(self.basis)
        nodes = self.basis.element_dofs[::d] // d
        return at_nodes(self.users_points, self.cells, self.nodes, nodes, self.parent)

    @property
    def users_points(self) -> ndarray:
        """Positions of the nodes of the user's elements, shape (2, n_users_points)."""
        n = 1 + max(int(cell.max()) for cell in self.cells)
        points: ndarray = self.users_mesh.p[:, :n]
        return points

    @property
    def element_size(self) -> float:
        """Size of the largest element in mm."""
        return self.mesh.param()

    def __repr__(self) -> str:
        terms = ", ".join(term.name for term in self.terms)
        return (
            f"<Ply of {self.mesh.nelements} elements, {self.basis.N} unknowns, "
            f"{self.formulation}, terms: {terms}>"
        )


def _mapped(places: str, values: ndarray, matrix: csr_matrix) -> ndarray:
    """Product of a matrix with the last axis of values, one for each of the places."""
    values, n = np.asarray(values), matrix.shape[1]
    if values.shape[-1:] != (n,):
        raise ValueError(
            f"a field must have a value for each of the {n} {places} along its last "
            f"axis, got shape {values.shape}"
        )
    columns = values.reshape(-1, values.shape[-1]).T
    return (matrix @ columns).T.reshape(*values.shape[:-1], -1)


def _refuse_other_kinds(dimension: Any, formulation: Any, fabric: Any) -> None:
    """Reject arguments of the wrong type."""
    if dimension not in (2, 3):
        raise ValueError(
            "dimension must be 2 for a ply in its plane or 3 for one in space, got "
            f"{dimension!r}"
        )
    if isinstance(formulation, type) or not hasattr(formulation, "tension_term"):
        raise ValueError(
            "formulation must be a formulation such as Macro() or OnePoint(), not "
            f"{formulation!r}"
        )
    if not isinstance(fabric, Fabric | Mapping):
        raise ValueError(f"fabric must be a Fabric such as Fabric(1e4), not {fabric!r}")
