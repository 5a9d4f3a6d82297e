"""What a displacement makes of the fibres of a ply."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis, Mesh
from skfem.helpers import ddot

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..fabric.law_end import LawEnd
from ..mesh.bases import components, node_dofs
from ..mesh.corners import Corners, sided
from .term import PlyParameters


class Measures:
    """Strains, tensions, angles and directions at the points of a basis.

    Attributes
    ----------
    basis
        `skfem.CellBasis` of the displacement at the ply's own points.
    fabric
        Fibre directions and laws.
    mesh, parent
        The mesh that is computed on, and for each of its elements the user's element
        that it is part of, shape (n_elements,).
    centre
        Reference coordinates of the centre of an element, shape (2, 1).
    fine_points
        Reference coordinates at which strain and folding are judged, (2, n_points).
    corners
        Det F at the nodes of the elements, at which folding is judged too.
    gradient
        Displacement gradient, ``(u, points) -> gradient``.
    """

    basis: CellBasis
    fabric: Fabric
    mesh: Mesh
    parent: ndarray
    centre: ndarray
    fine_points: ndarray
    corners: Corners
    gradient: Callable[..., ndarray]
    _tension: Any  # the term of the fibres, or None
    _of: Callable[..., Any]  # the values of a term among parameters

    def deformation_gradient(
        self, u: ndarray, points: ndarray | None = None
    ) -> ndarray:
        """Deformation gradient F, shape (d, 2, n_elements, n_points)."""
        return kin.deformation_gradient(self.gradient(u, points))

    def area_ratio(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current area per reference area, shape (n_elements, n_points).

        In the plane it is det F.  In space it is negative where a point faces the other
        way than the centre of its element.
        """
        F = self.deformation_gradient(u, points)
        if len(F) == 2:
            return kin.area_ratio(F)
        at_centre = self.deformation_gradient(u, self.centre)
        return sided(kin.area_vector(F), kin.area_vector(at_centre))

    def largest_gradient(self, u: ndarray) -> float:
        """Largest component of the displacement gradient at the fine points."""
        return float(np.abs(self.gradient(u, self.fine_points)).max())

    def fibre_strain(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Fibre strain of warp and weft, shape (2, n_elements, n_points)."""
        F = self.deformation_gradient(u, points)
        return np.array([kin.fibre_strain(F, A) for A in self.directions(points)])

    def law_strain(self, u: ndarray) -> ndarray:
        """Fibre strain of warp and weft that enters the law of tension.

        At the ply's own points, shape (2, n_elements, n_points): the fibre strain
        there, or where fibres have the tension of the mean stretch (`Macro`,
        `Quadratic` with a deviation) this mean.
        """
        strain = self.fibre_strain(u)
        return strain if self._tension is None else self._tension.seen(strain)

    def fibre_tension(
        self, u: ndarray, parameters: PlyParameters | None = None
    ) -> ndarray:
        """Tension of warp and weft in N/mm at the ply's own points.

        Parameters
        ----------
        u
            Displacement.
        parameters
            Parameters of the terms, such as ``State.parameters``: with mean stretches
            the tension then includes the part of deviations from them, whose stiffness
            is one of the parameters.  Without parameters it is the law at `law_strain`.

        Returns
        -------
        ndarray
            Shape (2, n_elements, n_points).
        """
        if parameters is not None:
            return self.predicted_tension(u, np.zeros_like(u), parameters)
        strain = self.law_strain(u)
        if self._tension is None:
            return np.zeros_like(strain)
        return np.array(self.fabric.at().tensions.value(strain))

    def predicted_tension(
        self, u: ndarray, du: ndarray, parameters: PlyParameters | None = None
    ) -> ndarray:
        """Tensions that act on the nodes after the increment ``du``, to first order.

        At the ply's own points, shape (2, n_elements, n_points): T(ε) + T′ ∂ε·∇du.
        With mean stretches they have the part of the deviations, whose stiffness is one
        of the ``parameters``, at rest if these are not given.
        """
        F, dF, A = self.deformation_gradient(u), self.gradient(du), self.directions()
        strain = np.array([kin.fibre_strain(F, A_i) for A_i in A])
        change = np.array([ddot(kin.fibre_strain_d(F, A_i), dF) for A_i in A])
        if self._tension is None:
            return np.zeros_like(strain)
        return self._tension.predicted(
            self._of(self._tension, parameters), strain, change
        )

    def fibre_direction(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Current unit direction of warp and weft, (2, d, n_elements, n_points).

        The first axis is the family, the second the component.
        """
        F = self.deformation_gradient(u, points)
        a = np.array([kin.fibre(F, A) for A in self.directions(points)])
        return a / np.linalg.norm(a, axis=1, keepdims=True)

    def shear_angle(self, u: ndarray, points: ndarray | None = None) -> ndarray:
        """Shear angle Γ in radians, shape (n_elements, n_points)."""
        F = self.deformation_gradient(u, points)
        return kin.shear_angle(F, *self.directions(points))

    def directions(self, points: ndarray | None = None) -> tuple[ndarray, ndarray]:
        """Unit reference directions of warp and weft at the points."""
        xi = self.basis.X if points is None else points
        return self.fabric.directions(self.basis.mapping.F(xi))

    def on_users_elements(self, values: ndarray) -> ndarray:
        """The mean of a field over each of the user's elements, weighted by area.

        Fields at nodes need no such method: the user's nodes are the first.

        Parameters
        ----------
        values
            A value for each element of ``mesh``, shape (..., n_elements).

        Returns
        -------
        ndarray
            Shape (..., n_users_elements), in the order of ``cells``.

        Raises
        ------
        ValueError
            If there are fewer or more values than elements.

        Examples
        --------
        >>> from skfem import MeshQuad
        >>> from skfem_textile import Fabric, Ply
        >>> ply = Ply(MeshQuad(), Fabric())
        >>> x, y = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
        >>> ply.on_users_elements(x)
        array([0.5])
        """
        values, n = np.asarray(values), self.mesh.nelements
        if values.shape[-1:] != (n,):
            raise ValueError(
                f"a field must have a value for each of the {n} elements of ply.mesh "
                f"along its last axis, not the shape {values.shape}"
            )
        area = self.basis.dx.sum(axis=1)
        share = area / np.bincount(self.parent, area)[self.parent]
        mean = csr_matrix((share, (self.parent, np.arange(n))))
        return (mean @ values.reshape(-1, n).T).T.reshape(*values.shape[:-1], -1)

    def nodal(self, u: ndarray) -> ndarray:
        """A DOF vector as one column per node of ``nodes``, shape (d, n_nodes)."""
        return u[node_dofs(self.basis)]

    def least_area_ratio(self, u: ndarray) -> ndarray:
        """Smallest det F of each element at its nodes and the ply's fine points."""
        fine = self.area_ratio(u, self.fine_points).min(axis=1)
        return np.minimum(fine, self.corners.area_ratio(u).min(axis=0))

    def normals(self, u: ndarray) -> ndarray:
        """Normals of the elements in space, of any length, shape (3, n_elements).

        At rest all lie on the same side of the ply.
        """
        return self.corners.normals(u)

    def creased(self, u: ndarray) -> ndarray:
        """Elements that turn by more than a right angle against a neighbour.

        Numbers of elements; there are none in the plane.  So sharp a crease is one of
        the mesh: another mesh puts it elsewhere.
        """
        if components(self.basis) == 2:
            return np.empty(0, dtype=int)
        one, other = self.mesh.f2t[:, self.mesh.f2t[1] >= 0]
        n = self.normals(u)
        sharp = ~((n[:, one] * n[:, other]).sum(axis=0) > 0)
        return np.unique([one[sharp], other[sharp]])

    def past_peak(self, u: ndarray) -> ndarray:
        """Elements where T/λ falls with λ, as ∂T/∂ε is below T, or ε is not finite.

        Beyond the peak of T/λ, the force per reference width, a fibre tears.
        """
        strains = self.fibre_strain(u, self.fine_points)
        past = ~np.isfinite(strains).all(axis=(0, 2))
        law = self.fabric.at().tensions
        pairs = zip(law.slopes(strains).own, law.value(strains), strict=True)
        for slope, tension in pairs:
            past |= (slope < np.abs(tension)).any(axis=1)
        return past

    def in_domain(self, u: ndarray) -> bool:
        """Whether no law is asked beyond the domain that it states."""
        if self.fabric.unbounded:
            return True
        fabric = self.fabric.at()
        return fabric.in_domain(self.law_strain(u), self.shear_angle(u))

    def closest_end(self, u: ndarray) -> LawEnd | None:
        """The end of a law that is closest; None if every law holds everywhere."""
        return self.fabric.at().closest_end(self.law_strain(u), self.shear_angle(u))
