"""Inextensional modes: their approximation by a formulation, and its stiffness.

To first order about a homogeneous state, a displacement u is inextensional if u·a₁
depends only on s₂ and u·a₂ only on s₁, with X = s₁ A₁ + s₂ A₂ and the current fibre
vectors a_α.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.linalg import solve
from skfem import CellBasis, LinearForm, asm
from skfem.helpers import ddot, dot, grad

from skfem_textile.fabric import kinematics as kin
from skfem_textile.ply import Ply

from .constraints import ORDER, Constraints, gram

#: A function of one variable and its derivative.
Profile = tuple[Callable[[ndarray], ndarray], Callable[[ndarray], ndarray]]

#: One wave along the side of the square.
SMOOTH: tuple[Profile, ...] = (
    (lambda s: np.sin(2 * np.pi * s), lambda s: 2 * np.pi * np.cos(2 * np.pi * s)),
)


def _kink(k: float) -> Profile:
    return (lambda s: np.abs(s - k)), (lambda s: np.sign(s - k))


# The kinks are evenly distributed relative to the lines of each mesh: their number is
# coprime to the 2 to 12 spacings in the half of the side that they occupy.
_KINKS = 11

#: Kinks in the middle half of a line along a side.
KINKED: tuple[Profile, ...] = tuple(
    _kink((i + 0.5) / (2 * _KINKS) - 0.25) for i in range(_KINKS)
)


class Field(NamedTuple):
    """A displacement field: values, shape (2, ...), and gradients, (2, 2, ...)."""

    value: ndarray
    grad: ndarray


def unstretched(profile: Profile, x: ndarray, directions: ndarray, F: ndarray) -> Field:
    """The field with u·a₁ = p(s₂) and u·a₂ = p(s₁), s from the centre of the square.

    Parameters
    ----------
    profile
        p and its derivative.
    x
        Points, shape (2, ...).
    directions
        Orthogonal unit reference directions A₁, A₂ as columns.
    F
        Deformation gradient of the state, shape (2, 2).
    """
    p, dp = profile
    s = np.einsum("ia,i...->a...", directions, x - 0.5)
    dual = np.linalg.inv(F @ directions)  # rows e¹ and e² with e^α·a_β = δ_αβ
    value = np.einsum("ai,a...->i...", dual, p(s[::-1]))
    slopes = np.einsum("ai,Ja,a...->iJ...", dual, directions[:, ::-1], dp(s[::-1]))
    return Field(value, slopes)


def distances(
    constraints: Constraints,
    kernel: ndarray,
    profiles: tuple[Profile, ...],
) -> tuple[float, float]:
    """Relative H¹ distances of inextensional modes from the mesh space and the kernel.

    Root mean squares over the profiles.
    """
    basis = constraints.basis
    points = CellBasis(basis.mesh, basis.elem, intorder=ORDER, dofs=basis.dofs)
    x, A = np.asarray(points.global_coordinates()), _directions(constraints)
    sizes, forms = [], []
    for profile in profiles:
        u = unstretched(profile, x, A, constraints.F)
        sizes.append(((dot(u.value, u.value) + ddot(u.grad, u.grad)) * points.dx).sum())
        form = LinearForm(lambda v, w, u=u: dot(u.value, v) + ddot(u.grad, grad(v)))
        forms.append(asm(form, points))
    total, f = sum(sizes), np.array(forms).T
    met_by_mesh = np.sum(f * solve(gram(basis).toarray(), f, assume_a="pos"))
    met_by_kernel = np.sum((kernel.T @ f) ** 2)
    missed = np.maximum(0.0, 1 - np.array([met_by_mesh, met_by_kernel]) / total)
    from_mesh, from_kernel = np.sqrt(missed)
    return float(from_mesh), float(from_kernel)


def stiffness(constraints: Constraints, profiles: tuple[Profile, ...]) -> float:
    """Work of the forces of a mode on the mode, over their work on the ply's response.

    The forces are the shear forces of the mode.  The exact response of a flat ply is
    the mode itself for any fibre stiffness; the exact ratio is one.  Returns the mean
    over the profiles.
    """
    fabric, basis = constraints.fabric, constraints.basis
    ply = Ply(constraints.mesh, fabric, constraints.formulation)
    K = ply.tangent(basis.zeros()).toarray()
    rigid = _rigid(ply.nodes)
    K += (K.trace() / basis.N) * rigid @ rigid.T
    points = CellBasis(basis.mesh, basis.elem, intorder=ORDER, dofs=basis.dofs)
    x, A = np.asarray(points.global_coordinates()), _directions(constraints)
    identity = np.eye(2)[:, :, None, None]
    slope = fabric.shear_law.tangent(np.zeros(1))
    d_angle = kin.shear_angle_d(identity, *fabric.directions(x))
    works, forces = [], []
    for profile in profiles:
        angle = ddot(d_angle, unstretched(profile, x, A, np.eye(2)).grad)
        form = LinearForm(lambda v, w, m=slope * angle: m * ddot(d_angle, grad(v)))
        works.append((slope * angle**2 * points.dx).sum())
        forces.append(asm(form, points))
    f = np.array(forces).T
    return float(np.mean(works / np.sum(f * solve(K, f, assume_a="pos"), axis=0)))


def _directions(constraints: Constraints) -> ndarray:
    """Unit reference directions of warp and weft, as columns."""
    A = constraints.fabric.directions(np.full((2, 1), 0.5))
    return np.array(A).reshape(2, 2).T


def _rigid(nodes: ndarray) -> ndarray:
    """Rigid-body modes as orthonormal columns, shape (2 n_nodes, 3)."""
    x, y = nodes
    zero, one = np.zeros_like(x), np.ones_like(x)
    motions = [np.stack(m, axis=1).ravel() for m in ((one, zero), (zero, one), (-y, x))]
    return np.linalg.qr(np.array(motions).T)[0]
