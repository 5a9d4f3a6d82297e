"""Strains, tensions, shear angle and directions of fibres on a basis.

`fibre_fields` evaluates them for the unknowns of any scikit-fem script; a `Ply` is a
`FabricOnBasis`, with the same fields.
"""

from collections.abc import Callable, Iterator
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import (
    AbstractBasis,
    CellBasis,
    ElementComposite,
    ElementH1,
    ElementQuad1,
    ElementTriP1,
    ElementVector,
)

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..fabric.regions import fabric_on
from ..mesh.bases import (
    CENTRE,
    ElementQuad1Fluctuation,
    MeanBasis,
    mean,
    quad_basis,
    sided,
)
from ..mesh.splitting import original_elements
from ..mesh.user_input import real_numbers, with_article
from .form import refuse_basis

#: Where fields are evaluated.
Place = Literal["points", "elements", "nodes"]


class FibreFields(NamedTuple):
    """Fields of warp and weft, the first axis of all except the shear angle.

    The last axes depend on the place: (n_elements, n_points) for points,
    (n_elements,) for elements, (n_vertices,) for nodes.

    Attributes
    ----------
    strain
        Logarithmic fibre strain ε = ln λ, shape (2, ...).  On a `MeanBasis` or a
        `MacroBasis` ln λ̄, of the mean stretch, as in `mean_tension`.
    tension
        Tension T(ε) in N/mm of ply width, shape (2, ...); for a law with friction at
        the first loading.
    shear_angle
        Shear angle Γ in radians, shape (...).
    direction
        Unit direction in the deformed ply, shape (2, d, ...).
    reference
        Unit direction in the undeformed ply, shape (2, 2, ...).
    """

    strain: ndarray
    tension: ndarray
    shear_angle: ndarray
    direction: ndarray
    reference: ndarray


def fibre_fields(
    basis: AbstractBasis, u: ndarray, fabric: Fabric, at: Place = "points"
) -> FibreFields:
    """Strains, tensions, shear angle and directions of the fibres.

    Parameters
    ----------
    basis
        `skfem.CellBasis` with the displacement as its first vector field, as for the
        forms, on a mesh of triangles or quadrilaterals, or on some of its elements.
    u
        DOF vector of the basis, shape (basis.N,), displacements in mm.
    fabric
        Fibre directions and laws.  Values per element belong to all elements of the
        mesh, also for a basis on some of them.
    at
        ``points``: the points of the basis.  ``elements``: area-weighted means over the
        elements of the basis, in its order.  ``nodes``: projection onto the vertices of
        the mesh with the lumped mass matrix, Σ ∫ N_i x / Σ ∫ N_i; not a number at
        vertices without elements of the basis.

    Returns
    -------
    FibreFields
        Arrays of strains, tensions (N/mm), shear angle (radians) and unit directions.
        On a `MacroBasis` its elements are the quadrilaterals of the split mesh.

    Raises
    ------
    ValueError
        If the basis has no displacement, is not a basis of elements, or has the
        gradient of an `HourglassBasis`; if ``u`` has another shape or is not finite, or
        the fabric is not a `Fabric` or has values for another number of elements.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem import Basis, ElementQuad1, ElementVector, MeshQuad
    >>> from skfem_textile import Fabric, fibre_fields
    >>> mesh = MeshQuad().refined(2)
    >>> basis = Basis(mesh, ElementVector(ElementQuad1()))
    >>> u = basis.project(lambda x: np.array([0.02 * x[0], 0.1 * x[0]]))
    >>> fields = fibre_fields(basis, u, Fabric(tension=1e3), at="elements")
    >>> fields.strain.shape, fields.direction.shape
    ((2, 16), (2, 2, 16))
    >>> float(np.degrees(fields.shear_angle[0]).round(2))
    5.6
    """
    if at not in get_args(Place):
        raise ValueError(f"at must be one of {', '.join(get_args(Place))}, not {at!r}")
    sheet, u = on_basis(basis, u, fabric)
    reduced = {"points": _unchanged, "elements": _of_elements, "nodes": _of_nodes}[at]
    of, shape = reduced(sheet.basis), sheet.basis.dx.shape
    reference = [np.broadcast_to(A, (2, *shape)) for A in sheet.directions()]
    return FibreFields(
        strain=of(sheet.law_strain(u)),
        tension=of(sheet.fibre_tension(u)),
        shear_angle=of(sheet.shear_angle(u)),
        direction=_unit(of(sheet.fibre_direction(u))),
        reference=_unit(of(np.array(reference))),
    )


class FabricOnBasis:
    """Fabric on a basis of the displacement: fields as functions of the displacement.

    Strains, tensions, angles and directions are evaluated at the points of the basis,
    or at other ``points``: reference coordinates in the unit square or triangle, shape
    (2, n_points).

    Parameters
    ----------
    basis
        Basis of the displacement, with an `ElementVector`.
    fabric
        Fibre directions and laws, with values for all elements of the mesh of the
        basis.
    means
        Basis of the elements at whose mean stretch the tension law is evaluated, if it
        is not evaluated at the points.

    Attributes
    ----------
    mesh
        Mesh of the elements of the basis.
    centre
        Reference coordinates of the element centre, shape (2, 1).
    """

    def __init__(
        self, basis: CellBasis, fabric: Fabric, means: MeanBasis | None = None
    ) -> None:
        self.basis, self.fabric, self.means = basis, fabric, means
        # By the points' coordinates: gradients of the shape functions in the reference
        # element with inverse Jacobian matrices, and directions.
        self._gradients: dict[bytes, tuple[ndarray, ndarray]] = {}
        self._directions: dict[bytes, tuple[ndarray, ndarray]] = {}
        self.mesh, elements = basis.mesh, basis.tind
        self._element = None if elements is None else elements[:, None]
        if elements is not None:
            self.mesh = basis.mesh.restrict(
                elements, skip_boundaries=True, skip_subdomains=True
            )
        self.centre = basis.mesh.refdom.p.mean(axis=1, keepdims=True)

    def refuse_other(self, u: ndarray) -> None:
        """Refuse a displacement of another ply.

        Raises
        ------
        ValueError
            If it is not an array with one real number for each unknown.
        """
        n, shape = self.basis.N, u.shape if isinstance(u, ndarray) else np.shape(u)
        if shape != (n,):
            raise ValueError(
                f"a displacement of this ply has the shape ({n},), one number for each "
                f"unknown, not {shape}: use one of the same ply"
            )
        if not isinstance(u, ndarray) or u.dtype.kind not in "biuf":
            found = u.dtype if isinstance(u, ndarray) else with_article(u)
            raise ValueError(f"a displacement is an array of real numbers, not {found}")

    def nodal(self, u: ndarray) -> ndarray:
        """Displacement of the vertices of ``mesh``, shape (d, n_vertices).

        Raises
        ------
        ValueError
            If the basis has no unknowns at vertices.
        """
        self.refuse_other(u)
        basis, every = self.basis, self.basis.mesh.t
        if not basis.elem.nodal_dofs:
            raise ValueError(
                "the displacement has no unknowns at the vertices: use an element such "
                "as ElementVector(ElementQuad1())"
            )
        vertices = np.unique(every if basis.tind is None else every[:, basis.tind])
        return np.asarray(u[basis.nodal_dofs[: basis.elem.dim, vertices]])

    def gradient(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Displacement gradient ∇u, shape (d, 2, n_elements, n_points)."""
        self.refuse_other(u)
        basis = self.basis
        xi = basis.X if points is None else points
        vector: Any = basis.elem
        scalar, key = vector.elem, xi.tobytes()
        n_nodes = len(scalar.doflocs)
        if key not in self._gradients:
            dN = np.array([scalar.lbasis(xi, i)[1] for i in range(n_nodes)])
            where = xi[:, :1] if basis.mesh.affine else xi  # constant in triangles
            self._gradients[key] = dN, basis.mapping.invDF(where, basis.tind)
        dN, inverse = self._gradients[key]
        nodal = u[basis.element_dofs].reshape(n_nodes, vector.dim, -1)
        du_dxi = nodal.transpose(1, 2, 0)[:, None] @ dN.transpose(1, 0, 2)
        return np.einsum("ijnq,jknq->iknq", du_dxi, inverse)

    def deformation_gradient(
        self, u: ndarray, points: ndarray | None = None
    ) -> ndarray:
        """Deformation gradient F, shape (d, 2, n_elements, n_points)."""
        return kin.deformation_gradient(self.gradient(u, points))

    def area_ratio(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current area per reference area, shape (n_elements, n_points).

        In the plane it is det F.  In space it is negative if the normal at a point
        opposes that at the centre of its element.
        """
        F = self.deformation_gradient(u, points)
        if len(F) == 2:
            return kin.area_ratio(F)
        at_centre = self.deformation_gradient(u, self.centre)
        return sided(kin.area_vector(F), kin.area_vector(at_centre))

    def least_area_ratio(self, u: ndarray) -> ndarray:
        """Smallest area ratio at the points and corners of each element."""
        at_corners = self.area_ratio(u, self.basis.mesh.refdom.p)
        return np.hstack([self.area_ratio(u), at_corners]).min(axis=1)

    def fibre_strain(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Fibre strain of warp and weft, shape (2, n_elements, n_points)."""
        F = self.deformation_gradient(u, points)
        return np.array([kin.fibre_strain(F, A) for A in self.directions(points)])

    def law_strain(self, u: ndarray) -> ndarray:
        """Fibre strain of warp and weft that enters the tension law.

        At the points of the basis, shape (2, n_elements, n_points): the local fibre
        strain, or the mean where the law is evaluated at the mean stretch (`Macro`,
        `Quadratic` with a deviation).
        """
        strain, basis = self.fibre_strain(u), self.means
        if basis is None:
            return strain
        stretch = np.exp(basis.from_ply_points(strain))
        means = mean({"share": basis.share}, stretch)
        return basis.to_ply_points(np.broadcast_to(np.log(means), stretch.shape))

    def fibre_tension(self, u: ndarray, parameters: Any = None) -> ndarray:
        """Tension of warp and weft in N/mm, the value of the law at `law_strain`.

        Shape (2, n_elements, n_points).  There are no ``parameters`` of terms, which a
        `Ply` has.
        """
        law = self.fabric.at(self._element).tensions
        return np.array(law.value(self.law_strain(u)))

    def fibre_direction(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current unit direction of warp and weft, (2, d, n_elements, n_points).

        The first axis is the family, the second the component.
        """
        F = self.deformation_gradient(u, points)
        return _unit(np.array([kin.fibre(F, A) for A in self.directions(points)]))

    def shear_angle(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Shear angle Γ in radians, shape (n_elements, n_points)."""
        F = self.deformation_gradient(u, points)
        return kin.shear_angle(F, *self.directions(points))

    def directions(self, points: ndarray | None = None) -> tuple[ndarray, ndarray]:
        """Unit reference directions of warp and weft at the points."""
        xi = self.basis.X if points is None else points
        if (key := xi.tobytes()) not in self._directions:
            x = self.basis.mapping.F(xi, self.basis.tind)
            self._directions[key] = self.fabric.directions(x, self._element)
        return self._directions[key]


def on_basis(
    basis: AbstractBasis, u: ndarray, fabric: Fabric
) -> tuple[FabricOnBasis, ndarray]:
    """Fabric on the displacement of a user's basis, and its DOF vector.

    Raises
    ------
    ValueError
        See `fibre_fields`.
    """
    if not isinstance(basis, AbstractBasis):
        raise ValueError(
            "basis must be a scikit-fem basis of the displacement, such as "
            f"quad_basis(mesh, CENTRE), not {with_article(basis)}: pass (basis, u, "
            "fabric)"
        )
    if not (fields := list(_vector_fields(basis))):
        raise ValueError(
            "the basis has no vector field, and so no displacement: pass a basis such "
            "as on ElementVector(ElementQuad1())"
        )
    if not isinstance(fabric, Fabric):
        raise ValueError(
            "fabric must be a Fabric such as Fabric(1e4), not "
            f"{with_article(fabric)}: pass (basis, u, fabric)"
        )
    displacement, unknowns = fields[0]
    _refuse_basis(displacement)
    values, n = real_numbers("u", u), basis.N
    if values.shape != (n,) or not np.isfinite(values).all():
        found = f"shape {values.shape}" if values.shape != (n,) else "other values"
        raise ValueError(
            f"u must be a DOF vector of the basis, {n} finite numbers in an array of "
            f"shape (basis.N,), got {found}"
        )
    fabric = fabric_on(original_elements(displacement.mesh)[1], fabric)
    means = displacement if isinstance(displacement, MeanBasis) else None
    if means and means.parts is not None:
        displacement = quad_basis(displacement.mesh, CENTRE, displacement.elem.dim)
    return FabricOnBasis(displacement, fabric, means), values[unknowns]


def _vector_fields(basis: Any) -> Iterator[tuple[Any, Any]]:
    """Basis and unknowns of each vector field of a basis."""
    if hasattr(basis, "bases"):  # a product of bases
        ends = np.cumsum([0, *(x.N for x in basis.bases)])
        for x, first in zip(basis.bases, ends, strict=False):
            start = 0 if basis.equal_dofnum else first
            if isinstance(x.elem, ElementVector):
                yield x, slice(start, start + x.N)
    elif isinstance(basis.elem, ElementComposite):
        pairs = zip(basis.elem.elems, basis.split_indices(), strict=True)
        for element, unknowns in pairs:
            if isinstance(element, ElementVector):
                yield basis.with_element(element), unknowns
    elif isinstance(basis.elem, ElementVector):
        yield basis, slice(None)


def _refuse_basis(basis: Any) -> None:
    """Refuse a basis on which the gradient of a displacement cannot be evaluated."""
    refuse_basis(basis, CellBasis)
    element: Any = basis.elem
    scalar = element.elem
    if isinstance(scalar, ElementQuad1Fluctuation):
        raise ValueError(
            "fields require the whole gradient of the displacement: pass a basis such "
            "as quad_basis(mesh, CENTRE), not an HourglassBasis"
        )
    if element.dim not in (2, 3):
        raise ValueError(
            "fields require a displacement with two or three components, not "
            f"{element.dim}"
        )
    if not isinstance(scalar, ElementH1):
        raise ValueError(
            "fields require a displacement of an H¹ element such as ElementQuad1, not "
            f"{type(scalar).__name__}"
        )
    if not basis.nelems:
        raise ValueError("the basis has no elements: choose others in with_elements")


def _unit(a: ndarray) -> ndarray:
    """Unit vectors of a field of shape (2, d, ...)."""
    return a / np.linalg.norm(a, axis=1, keepdims=True)


def _unchanged(basis: CellBasis) -> Callable[[ndarray], ndarray]:
    return lambda x: x


def _of_elements(basis: CellBasis) -> Callable[[ndarray], ndarray]:
    """Area-weighted means of values at points."""
    share = basis.dx / basis.dx.sum(axis=1, keepdims=True)
    return lambda x: (share * x).sum(axis=-1)


def _of_nodes(basis: CellBasis) -> Callable[[ndarray], ndarray]:
    """Projection of values at points onto linear functions, with the lumped mass."""
    mesh = basis.mesh
    t = mesh.t if basis.tind is None else mesh.t[:, basis.tind]
    linear = {3: ElementTriP1, 4: ElementQuad1}[len(t)]()
    N = np.array([linear.lbasis(basis.X, i)[0] for i in range(len(t))])
    weights = N[:, None] * basis.dx
    rows = np.broadcast_to(t[:, :, None], weights.shape).ravel()
    points = np.arange(basis.dx.size).reshape(basis.dx.shape)
    columns = np.broadcast_to(points, weights.shape).ravel()
    shape = mesh.nvertices, points.size
    sums = csr_matrix((weights.ravel(), (rows, columns)), shape)
    mass = np.asarray(sums.sum(axis=1))[:, 0]
    mass[mass == 0] = np.nan

    def projected(x: ndarray) -> ndarray:
        values = (sums @ x.reshape(-1, points.size).T).T / mass
        return values.reshape(*x.shape[:-2], mesh.nvertices)

    return projected
