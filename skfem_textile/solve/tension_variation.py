"""Variation of the fibre tension within quadratic triangles.

If the fibre law acts on the mean stretch of an element, the tension of the discrete
solution is constant in it, apart from the small stiffness of deviations.  The tension
of the exact solution varies, and this variation does work over the deviations of the
stretch.  The omitted nodal forces, ∫ Σ_α (N*_α − N̄_α) δλ_α dΩ, estimate the residual of
the discrete solution.  N = T/λ is the force conjugate to the stretch, N̄ its value in an
element, and N* a piecewise linear field recovered from the values N̄ of the elements.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import LinearForm, asm
from skfem.helpers import ddot, grad

from ..fabric import kinematics as kin
from ..mesh.bases import MeanBasis, displacement_gradient, element_numbers
from ..mesh.graph import components
from ..mesh.selection import SINGULAR
from ..ply import Ply
from ..ply.terms import TensionTerm


def forces_of_tension_variation(ply: Ply, u: ndarray) -> ndarray:
    """Omitted nodal forces in N, shape (n_unknowns,).

    They are zero unless the fibre law acts on the mean stretch of triangles.
    """
    forces = np.zeros_like(u)
    for term in ply.terms:
        if isinstance(term, TensionTerm) and term.of_means is not None:
            basis: Any = term.basis
            if basis.parts is None:
                forces += _omitted(ply, basis, u)
    return forces


def _omitted(ply: Ply, basis: MeanBasis, u: ndarray) -> ndarray:
    """Nodal forces of the variation of both tensions on a basis."""
    w, element = basis.default_parameters(), element_numbers(basis)
    A = ply.fabric.directions(np.asarray(w["x"]), element)
    F = kin.deformation_gradient(displacement_gradient(basis, u))
    stretch = np.array([kin.stretch(F, a) for a in A])
    mean = (w["share"] * stretch).sum(axis=-1, keepdims=True)
    N = np.asarray(ply.fabric.at(element[:, :1]).tensions.value(np.log(mean))) / mean
    recovered = _recovered(basis, N[..., 0])
    variation = recovered - (w["share"] * recovered).sum(axis=-1, keepdims=True)
    stress = sum(n * kin.stretch_d(F, a) for n, a in zip(variation, A, strict=True))
    return asm(LinearForm(lambda v, _: ddot(stress, grad(v))), basis)


def _recovered(basis: MeanBasis, values: ndarray) -> ndarray:
    """Continuous piecewise linear field of values of elements, at the points.

    The value at a vertex is the mean of its elements, weighted with their areas.
    Elements on both sides of a singular fibre, across which the field jumps, have
    separate vertices.  Shapes (2, n_elements) and (2, n_elements, n_points).
    """
    vertex, area = _vertices(basis.mesh), basis.dx.sum(axis=1)

    def total(x: ndarray) -> ndarray:
        return np.bincount(vertex.ravel(), np.tile(x, len(vertex)))

    nodal = np.array([total(area * x) for x in values]) / total(area)
    x, y = basis.X
    hats = np.array([1.0 - x - y, x, y])
    return np.einsum("aie,iq->aeq", nodal[:, vertex], hats)


def smooth_edges(mesh: Any) -> ndarray:
    """Numbers of the edges inside the ply that are not on a singular fibre."""
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    return np.setdiff1d(inner, (mesh.boundaries or {}).get(SINGULAR, ()))


def _vertices(mesh: Any) -> ndarray:
    """Vertex number of each corner of triangles, shape (3, n_elements).

    Corners of two elements are the same vertex if the elements share an edge that ends
    there and is not on a singular fibre.
    """
    inner = smooth_edges(mesh)
    number = np.arange(mesh.t.size).reshape(mesh.t.shape)
    pairs = []
    for end in mesh.facets[:, inner]:
        corners = [(mesh.t[:, e] == end).argmax(axis=0) for e in mesh.f2t[:, inner]]
        pairs.append(
            [number[i, e] for i, e in zip(corners, mesh.f2t[:, inner], strict=True)]
        )
    joined = np.concatenate(pairs, axis=1)
    return components(mesh.t.size, joined).reshape(mesh.t.shape)
