"""Terms of bending, and of resistance to folding at corners and out of plane."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from scipy.linalg import expm
from scipy.sparse import csr_matrix
from skfem import CellBasis, Element, Mesh
from skfem.helpers import cross

from ..fabric import Fabric
from ..fabric.fabric import is_law
from ..fabric.law import LARGEST_CURVATURE, law_at
from ..forms.in_plane import RESISTING, resistance
from ..forms.kernels.elements import hourglass_mode
from ..mesh.bases import components, node_positions, sided
from ..mesh.selection import FIBRE_ENDS, FibreEnd, Turning
from ..mesh.user_input import call_user_function, real_numbers, shortened
from .parameters import NO_VALUES, TermParameters, Values
from .terms import ElementTerm, FormTerm, MatrixTerm, named_edges

if TYPE_CHECKING:
    from ..forms.bending_laws import BentFibres

# Lower bound of κ relative to the fibre stiffness.  A larger value adds energy where
# corners close; a smaller one lets them come closer to folding.  One tenth and ten
# times this value also keep corners open: pytest -m slow tests/ply/test_corners.py
_SHARE_OF_FIBRES = 1e-5


# A corner is flat if det J is below this share of the largest value of its element.
# Chosen: far above rounding, as in `checks`.
_FLAT = 1e-9

# ε_ijk of the cross product.
_EPSILON = np.cross(np.eye(3)[:, None], np.eye(3))


@np.errstate(over="ignore")  # a run rejects non-finite values
def corner_stiffness(fabric: Fabric, basis: CellBasis) -> float:
    """κ in N/mm: the shear stiffness at rest, at least 10⁻⁵ of the fibre stiffness."""
    unstrained = np.zeros(basis.dx.shape)
    E_1, E_2, G = (float(np.mean(law.tangent(unstrained))) for law in fabric.at().laws)
    return max(G, _SHARE_OF_FIBRES * (E_1 + E_2) / 2)


class Corners:
    """Area ratio det F at the nodes of the elements of a basis.

    det F = det(∂x/∂ξ) / det(∂X/∂ξ): at a corner the columns of ∂x/∂ξ are edges of the
    element; computing them takes half the time of F.  In space the determinant is
    replaced by the cross product of the columns: its length, negative at a node where
    it opposes its mean over the element (`sided`).  The last result is cached, because
    an iteration uses it several times.

    Parameters
    ----------
    basis
        Basis of the displacement.
    """

    def __init__(self, basis: CellBasis) -> None:
        vector: Any = basis.elem
        kind: Any = type(vector.elem)
        self._edges, self._pairs = _edges_at_nodes(kind)
        self._d = d = components(basis)
        self._nodes = basis.element_dofs[::d] // d
        self._X = np.ascontiguousarray(node_positions(basis).T)
        reference = self._of_plane(self._X)
        self._turn = np.sign(reference.sum(axis=0))
        positive = reference * self._turn
        self._reflex = positive <= _FLAT * positive.max(axis=0)
        self._per_area = 1 / np.where(self._reflex, np.inf, reference)
        self._last = b"", np.empty(0)

    def area_ratio(self, u: ndarray) -> ndarray:
        """Current area per reference area, det F, shape (n_points, n_elements).

        Infinite at a corner that is flat or reflex in the reference configuration,
        where det F is undefined.
        """
        key, (last, ratio) = u.tobytes(), self._last
        if key == last:
            return ratio
        moved = u.reshape(-1, self._d)
        if self._d == 2:
            ratio = self._of_plane(self._X + moved) * self._per_area
        else:
            vectors = self._vectors(moved)
            normals = vectors.sum(axis=1, keepdims=True)
            ratio = sided(vectors, normals) * np.abs(self._per_area)
        ratio[self._reflex] = np.inf
        self._last = key, ratio
        return ratio

    def derivatives(
        self, u: ndarray, corners: ndarray, elements: ndarray
    ) -> tuple[ndarray, ndarray]:
        """First and second derivative of the area ratio J at n corners of elements.

        With ξ and η, ∂x/∂ξ and ∂x/∂η with the weights w of the nodes, c = ξ × η, y =
        w_ξ η − w_η ξ and the unit vector n of c, |c| has the derivatives y × n, and
        (w_ξa w_ηc − w_ηa w_ξc) e_i×e_j · n + (δ_ij y_a·y_c − y_aj y_ci − (y_a × n)_i
        (y_c × n)_j)/|c|.  In the plane n is constant, and the last part is zero.

        Returns
        -------
        tuple of ndarray
            ∂J/∂x of each node, shape (n_nodes, d, n), and the blocks of ∂²J/∂x² of the
            pairs of nodes in the order of `numpy.triu_indices`, (n_pairs, d, d, n).
        """
        d, moved = self._d, u.reshape(-1, self._d)
        x = np.pad(self._X, ((0, 0), (0, d - 2))) + moved
        w = self._edges[self._pairs[corners]].transpose(1, 2, 0)
        xi, eta = np.einsum("san,ani->sin", w, x[self._nodes[:, elements]])
        y = w[0][:, None] * eta - w[1][:, None] * xi
        a, c = np.triu_indices(len(y))
        scale, turns = self._per_area[corners, elements], w[0][a] * w[1][c]
        turns -= w[1][a] * w[0][c]
        if d == 2:
            first = np.stack([y[:, 1], -y[:, 0]], axis=1)
            second = turns[:, None, None] * _EPSILON[:2, :2, 2, None]
            return scale * first, scale * second
        normal = cross(xi, eta)
        length = np.linalg.norm(normal, axis=0)
        n = normal / length
        first = cross(*np.broadcast_arrays(y.swapaxes(0, 1), n[:, None])).swapaxes(0, 1)
        second = turns[:, None, None] * np.einsum("ijk,kn->ijn", _EPSILON, n)
        second += (
            np.eye(3)[:, :, None] * (y[a] * y[c]).sum(axis=1)[:, None, None] / length
        )
        second -= y[a][:, None] * y[c][:, :, None] / length
        second -= first[a][:, :, None] * first[c][:, None] / length
        return np.abs(scale) * first, np.abs(scale) * second

    def normals(self, u: ndarray) -> ndarray:
        """Normals of the elements in space, not normalised, shape (3, n_elements).

        At rest all point to the same side of the ply.
        """
        return self._turn * self._vectors(u.reshape(-1, 3)).sum(axis=1)

    def _of_plane(self, x: ndarray) -> ndarray:
        """det(∂x/∂ξ) of positions (n_nodes, 2), shape (n_points, n_elements)."""
        edges = self._edges @ x.view(complex)[self._nodes, 0]
        det = np.empty((len(self._pairs), edges.shape[1]))
        for i, (xi, eta) in enumerate(self._pairs):
            det[i] = edges[xi].real * edges[eta].imag
            det[i] -= edges[xi].imag * edges[eta].real
        return det

    def _vectors(self, moved: ndarray) -> ndarray:
        """∂x/∂ξ × ∂x/∂η of displacements (n_nodes, 3), (3, n_points, n_elements)."""
        x = np.pad(self._X, ((0, 0), (0, 1))) + moved
        edges = [self._edges @ component[self._nodes] for component in x.T]
        first, second = np.array(edges)[:, self._pairs].transpose(2, 0, 1, 3)
        return cross(first, second)


@cache
def _edges_at_nodes(element: type[Element]) -> tuple[ndarray, ndarray]:
    """Weights of the nodes in ∂x/∂ξ and ∂x/∂η at the nodes of an element.

    Distinct weights, and the numbers of both at each node.
    """
    scalar: Any = element()
    dN = [scalar.lbasis(scalar.doflocs.T, i)[1] for i in range(len(scalar.doflocs))]
    tangents = np.array(dN).transpose(2, 1, 0).reshape(-1, len(dN))
    edges, edge_of = np.unique(tangents, axis=0, return_inverse=True)
    return edges, edge_of.reshape(-1, 2)


class CornerTerm(ElementTerm):
    """Corner term, active only where corners close.

    The stiffness is κ in N/mm.
    """

    name, role = "corners", "internal"

    def __init__(self, stiffness: float, basis: CellBasis, corners: Corners) -> None:
        self._corners, self._d = corners, components(basis)
        self.nodes = basis.element_dofs[:: self._d] // self._d
        self._stiffness = stiffness * basis.dx.sum(axis=1) / len(self.nodes)

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """κ Σ A/n b(det F)."""
        closing = self._closing(u)
        return float(closing[0][0].sum()) if closing else 0.0

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Derivative of the energy."""
        f = np.zeros((len(u) // self._d, self._d))
        if closing := self._closing(u):
            (_, d, _), elements, J, _ = closing
            np.add.at(f, self.nodes[:, elements], (d * J).swapaxes(1, 2))
        return f.ravel()

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray | None:
        """See `ElementTerm`; None if all corners are open."""
        if not (closing := self._closing(u)):
            return None
        (_, d, dd), elements, J, JJ = closing
        a, c = np.triu_indices(len(self.nodes))
        blocks = dd * J[a, :, None] * J[c, None] + d * JJ
        matrices = np.zeros((self.nodes.shape[1], *blocks.shape[:-1]))
        np.add.at(matrices, elements, np.moveaxis(blocks, -1, 0))
        return np.moveaxis(matrices, 0, -1)

    def _closing(
        self, u: ndarray
    ) -> tuple[list[ndarray], ndarray, ndarray, ndarray] | None:
        """Of the closing corners κ A/n times b, b′ and b″, elements, ∂J/∂x and ∂²J/∂x².

        None if all corners are open.
        """
        ratio = self._corners.area_ratio(u)
        if self._d == 3:  # the area ratio of the form has no sign
            ratio = np.abs(ratio)
        if not (closes := ratio < RESISTING).any():
            return None
        corners, elements = np.nonzero(closes)
        scale = self._stiffness[elements]
        b = [scale * x for x in resistance(ratio[closes])]
        return b, elements, *self._corners.derivatives(u, corners, elements)


# Cyclic pairs of the vectors y of `OutOfPlane`, and the third.
_CYCLE = (0, 1, 2), (1, 2, 0), (2, 0, 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class OutOfPlane(FormTerm):
    """Term of `out_of_plane`, evaluated for all elements at once.

    With γ and ∇h of `hourglass_mode`, the energy of an element is ½ k v², where ``k =
    C_s Σ_k A/4 |∇h(ξ_k)|²`` and v = (y₁ × y₂)·y₃: y₁ and y₂ are the columns of the
    deformation gradient at the centre, y₃ = Σ γ_a u_a.  Each y_s = Σ_a B_sa x_a is
    linear in the nodal positions x_a, because γ maps reference positions to zero.

    Parameters
    ----------
    basis
        The `HourglassBasis` of the forms.
    C_s
        Stiffness in N/mm, one for each element, shape (n_elements, 1); if the term has
        parameters, an upper limit of their ``C_s``.
    """

    C_s: ndarray

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """Energy in N·mm."""
        k, _, _, v = self._state(u, p)
        return 0.5 * float((k * v**2).sum())

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Nodal forces in N, shape (n_unknowns,)."""
        k, _, gradients, v = self._state(u, p)
        f, nodes = np.empty((3, len(u) // 3)), self.nodes.ravel()
        local = k * v * gradients
        for i in range(3):
            f[i] = np.bincount(nodes, local[:, i].ravel(), f.shape[1])
        return f.T.ravel()

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Blocks of the pairs of nodes of the elements, shape (10, 3, 3, n)."""
        k, y, gradients, v = self._state(u, p)
        (a, c), (B, _, _) = np.triu_indices(4), self._undeformed
        K = np.einsum("n,pin,pjn->pijn", k, gradients[a], gradients[c])
        across = sum(
            (B[s, a] * B[t, c] - B[t, a] * B[s, c])[:, None] * y[third]
            for s, t, third in _CYCLE
        )
        K += np.einsum("n,ijk,pkn->pijn", k * v, _EPSILON, across)
        return K

    def _form_parameters(self, t: float, p: Values) -> dict[str, Any]:
        C_s = np.minimum(p.get("C_s", np.inf), self.C_s)
        return {**super()._form_parameters(t, p), "C_s": C_s}

    @cached_property
    def _undeformed(self) -> tuple[ndarray, ndarray, ndarray]:
        """B, Σ_k A/4 |∇h(ξ_k)|² at the points, and positions of the nodes."""
        basis: Any = self.basis
        at_centre, gamma, slope = hourglass_mode(basis, basis.gradients()[0])
        B = np.array([*at_centre[..., 0].swapaxes(0, 1), gamma])
        weight = basis.dx * (slope**2).sum(axis=0)
        return B, weight, np.pad(basis.mesh.p, ((0, 1), (0, 0)))

    def _state(
        self, u: ndarray, p: Values
    ) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """k, (n,), the y_s, (3, 3, n), ∂v/∂x_a, (4, 3, n), and v, (n,)."""
        B, weight, X = self._undeformed
        k = (np.minimum(p.get("C_s", np.inf), self.C_s) * weight).sum(axis=1)
        x = (X + u.reshape(-1, 3).T)[:, self.nodes]
        y = np.einsum("san,ian->sin", B, x)
        d = np.array([cross(y[s], y[t]) for s, t, _ in _CYCLE])
        gradients = np.einsum("san,sin->ain", B[[2, 0, 1]], d)
        return k, y, gradients, (y[2] * d[0]).sum(axis=0)


@dataclass(frozen=True, eq=False)
class BendingTerm(MatrixTerm):
    """Energy ½ v·K·v, and of families with bending laws; v as in `bending_matrix`.

    ``matrix`` is the displacement block of K, ``whole`` is K, ``turning`` are the
    rotating clamps by boundary name, ``bent`` the families with laws, and
    ``parameters`` the slip of their friction elements.
    """

    whole: csr_matrix = field(kw_only=True)
    turning: Mapping[str, Turning] = field(kw_only=True)
    bent: Sequence["BentFibres"] = field(kw_only=True, default=())
    parameters: TermParameters | None = field(kw_only=True, default=None)

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """½ v·K·v, and the energies of the laws."""
        v = self._with_turns(u, t)
        of_laws = sum(fibres.energy(v, p.get(_slip_of(fibres))) for fibres in self.bent)
        return 0.5 * float(v @ (self.whole @ v)) + of_laws + float(p.get("work", 0.0))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Derivative of the energy: rows that belong to the displacement."""
        v = self._with_turns(u, t)
        forces = self.whole @ v
        for fibres in self.bent:
            forces = forces + fibres.forces(v, p.get(_slip_of(fibres)))
        return forces[: len(u)]

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix:
        """K, and the second derivatives of the energies of the laws."""
        K, v = super().tangent(u, t, p), self._with_turns(u, t)
        for fibres in self.bent:
            of_law = fibres.stiffness(v, p.get(_slip_of(fibres)))
            K = K + of_law[: len(u), : len(u)]
        return K

    def couples(self) -> Sequence[ndarray] | None:
        """See `Term`; at rest some stiffnesses of the laws may be zero."""
        if not self.bent:
            return None
        n = self.matrix.shape[0]
        d = self.bent[0].d
        of_laws = [fibres.couples() for fibres in self.bent]
        pairs = (np.array(self.matrix.nonzero()) // d, *of_laws)
        return [x[:, (x < n // d).all(axis=0)] for x in pairs]

    def ends(self, u: ndarray, t: float) -> Iterator[tuple[str, ndarray, Any, Any]]:
        """Of each law: name of its curvature, curvatures at points, smallest, largest.

        Curvatures have the shape (n_elements, n_points).
        """
        v = self._with_turns(u, t)
        for fibres in self.bent:
            yield f"{fibres.name}_curvature", fibres.curvatures(v), *fibres.ends

    def _with_turns(self, u: ndarray, t: float) -> ndarray:
        d = (self.whole.shape[0] - len(u)) // (2 * max(len(self.turning), 1))
        return with_turns(u, t, self.turning, d)


def with_turns(u: ndarray, t: float, turning: Mapping[str, Turning], d: int) -> ndarray:
    """Displacement, and changes of the fibres in rotating clamps, with d components."""
    if not turning:
        return u
    every = (turn_of(name, end, t, d) for name, end in turning.items())
    changes = [(R - np.eye(d))[:, :2].T.ravel() for R in every]
    return np.concatenate([u, *changes])


def _slip_of(fibres: "BentFibres") -> str:
    """Name of the slip of a family among the parameters of the term."""
    return f"{fibres.name} slip"


@dataclass(frozen=True, eq=False)
class BendingSlip(TermParameters):
    """Slip of the friction elements of bending laws, and the energy that it lost.

    The values are the slip of each family with friction, such as ``warp slip``, see
    `WithFriction`, and ``work`` in N·mm; ``turning`` and ``d`` as in `with_turns`.
    """

    bent: Sequence["BentFibres"]
    turning: Mapping[str, Turning]
    d: int

    def at_rest(self) -> Values:
        """No slip, and no energy lost."""
        slips = {_slip_of(fibres): fibres.slip_at_rest() for fibres in self.bent}
        return Values(slips | {"work": np.zeros(())})

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Slip and energy lost at the end of a step to ``u``."""
        v, after = with_turns(u, t, self.turning, self.d), dict(values)
        for fibres in self.bent:
            slip, lost = fibres.slip_after(v, values[_slip_of(fibres)])
            after[_slip_of(fibres)] = slip
            after["work"] = after["work"] + lost
        return Values(after)


def turn_of(name: str, end: Turning, t: float, d: int) -> ndarray:
    """Rotation of a clamp at the load factor t, shape (d, d).

    The rotation must be a finite vector in space, and a finite angle in the plane.
    """
    subject = f"fibre_ends: the rotation of {name!r}"
    angle = real_numbers(subject, call_user_function(subject, end, t))
    if angle.shape != ((3,) if d == 3 else ()) or not np.isfinite(angle).all():
        kind = "a vector of 3 angles" if d == 3 else "an angle"
        raise ValueError(
            f"{subject} must be {kind} in radians, got {shortened(angle)} at load "
            f"factor {t:g}"
        )
    axis = angle if d == 3 else np.array([0.0, 0.0, angle])
    return expm(np.cross(np.eye(3), axis))[:d, :d]


def bending_term(
    basis: CellBasis, fabric: Fabric, ends: Mapping[str, FibreEnd]
) -> BendingTerm:
    """Term ½ ∫ (D₁ |κ₁|² + D₂ |κ₂|² + D_t |τ|²), or of laws instead of D₁ and D₂.

    Directions are evaluated at the mean of the nodes of each element.  ``ends`` are the
    fibre ends by boundary name.
    """
    from ..forms.bending import bending_matrix, twist_matrix

    mesh = basis.mesh
    centres = mesh.p[:, mesh.t].mean(axis=1)[:, :, None]
    warp, weft = both = tuple(
        np.broadcast_to(A, centres.shape)[..., 0] for A in fabric.directions(centres)
    )

    def by_element(D: Any) -> ndarray:
        return np.broadcast_to(D, mesh.nelements).astype(float)

    turning = {name: end for name, end in ends.items() if callable(end)}
    n = basis.N + 2 * len(turning) * components(basis)
    K: Any = 0.0
    bent: list[BentFibres] = []
    bending: tuple[Any, Any] = fabric.bending
    for family, D in enumerate(bending):
        if is_law(D):
            bent.append(_bent_fibres(basis, fabric, both, family, ends))
        elif np.any(D):
            K = K + bending_matrix(basis, both[family], by_element(D), ends)
    if np.any(fabric.twist):
        of_twist = twist_matrix(basis, warp, weft, by_element(fabric.twist))
        of_twist.resize(n, n)
        K = K + of_twist
    full = csr_matrix((n, n)) if np.isscalar(K) else csr_matrix(K)
    matrix = full[: basis.N, : basis.N]
    slipping = [fibres for fibres in bent if fibres.friction is not None]
    slip = BendingSlip(slipping, turning, components(basis)) if slipping else None
    term = BendingTerm(
        "bending", matrix, whole=full, turning=turning, bent=bent, parameters=slip
    )
    term.energy(basis.zeros(), 0.0)  # refuses invalid rotations
    return term


def _bent_fibres(
    basis: CellBasis,
    fabric: Fabric,
    directions: Sequence[ndarray],
    family: int,
    ends: Mapping[str, FibreEnd],
) -> "BentFibres":
    """Family with a bending law, whose sign is defined if it is not symmetric."""
    from ..fabric.laws.friction import parted
    from ..forms.bending_laws import BentFibres, frame_of, is_symmetric
    from ..forms.curvature import curvature_of

    law, friction = parted(fabric.bending[family])
    name = fabric.families[family].name
    d, frame = components(basis), None
    curvature = curvature_of(basis, directions[family], ends)
    symmetric = is_symmetric(law_at(law, None), LARGEST_CURVATURE)
    if not symmetric or friction is not None:
        needed = directions if d == 3 else [directions[family]]
        x = np.pad(node_positions(basis), ((0, d - 2), (0, 0))).T.ravel()
        frame = frame_of(basis, needed, curvature, x)
    return BentFibres(name, law, curvature, frame, d, symmetric, friction)


def checked_ends(mesh: Mesh, ends: Mapping[str, FibreEnd]) -> dict[str, FibreEnd]:
    """Fibre ends by boundary name.

    Raises an error if a boundary or an end is unknown, or two boundaries share an edge.
    """
    if not isinstance(ends, Mapping):
        raise ValueError(
            "fibre_ends must be a mapping from names of boundaries to "
            f"{' or '.join(FIBRE_ENDS)}, not {ends!r}"
        )
    earlier = np.empty(0, dtype=int)
    for name, end in ends.items():
        edges = named_edges("fibre_ends", mesh, name)
        if end not in FIBRE_ENDS and not callable(end):
            raise ValueError(
                f"fibre_ends: the value for {name!r} must be {', '.join(FIBRE_ENDS)} "
                "or a function of the load factor that returns the rotation of a "
                f"clamp, not {end!r}"
            )
        if not np.isin(edges, mesh.boundary_facets()).all():
            raise ValueError(
                f"fibre_ends: the boundary {name!r} has edges inside the ply"
            )
        if np.isin(edges, earlier).any():
            raise ValueError(
                f"fibre_ends: the boundary {name!r} shares edges with another "
                "boundary in fibre_ends"
            )
        earlier = np.append(earlier, edges)
    return dict(ends)
