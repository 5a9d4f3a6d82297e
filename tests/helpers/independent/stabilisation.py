"""Energies of stabilisation, and the paper's rates."""

import numpy as np

from .elements import EDGE_MIDDLES, GAUSS, area, bilinear, gradients, point, polygon
from .held_stiffness import automatic_stiffness
from .kinematics import deformation_gradient, fibre, shear_angle


def hourglass(cloth, x, C_s):
    """½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))²; C_s is a number or one of each element.

    Both angles are of the fibres at ξ_k, under F(ξ_k) and F(0).
    """
    C_s, energy = np.broadcast_to(C_s, len(cloth.elements)), 0.0
    for e in range(len(cloth.elements)):
        F_0 = deformation_gradient(x, point(cloth, e, (0, 0)))
        for at in GAUSS:
            p = point(cloth, e, at)
            F_k = deformation_gradient(x, p)
            difference = shear_angle(F_k, p.A) - shear_angle(F_0, p.A)
            energy = energy + C_s[e] / 2 * area(cloth, e) / 4 * difference**2
    return energy


def automatic_hourglass(cloth, x, macros, converged):
    """`hourglass` with C_s of the last converged state."""
    last = converged[-1] if converged else cloth.X[..., None]
    return hourglass(cloth, x, automatic_stiffness(cloth, last, macros))


def isotropic(cloth, x, kappa):
    """½ κ Σ_k A/4 ‖∇u(ξ_k) − ∇u(0)‖²."""
    energy = 0.0
    for e in range(len(cloth.elements)):
        F_0 = deformation_gradient(x, point(cloth, e, (0, 0)))
        for at in GAUSS:
            off = deformation_gradient(x, point(cloth, e, at)) - F_0
            energy = energy + kappa / 2 * area(cloth, e) / 4 * (off**2).sum(axis=(0, 1))
    return energy


def continuity(cloth, x, C_j):
    """½ C_j Σ_edges (A⁺ + A⁻)/4 [[Γ]]² at the middles of the interior edges."""
    sides = {}
    for e, nodes in enumerate(cloth.elements):
        for i, at in enumerate(EDGE_MIDDLES):
            edge = frozenset((nodes[i], nodes[(i + 1) % 4]))
            sides.setdefault(edge, []).append((e, at))
    energy = 0.0
    for side in sides.values():
        if len(side) == 1:
            continue  # an edge of the ply
        seen = [point(cloth, e, at) for e, at in side]
        one, other = (shear_angle(deformation_gradient(x, p), p.A) for p in seen)
        weight = sum(area(cloth, e) for e, _ in side) / 4
        energy = energy + C_j / 2 * weight * (one - other) ** 2
    return energy


# The paper's rates, which have work and forces, but no energy


def rate_vectors(cloth, x, e):
    """A/4 and, for each of the 2×2 points, (f·B_HGL)_ai: f·(B_HGL v) is its sum with v.

    Everything is of the current configuration x, shape (2, n_nodes).  With unit vectors
    f₁, f₂ along the fibres, f² normal to f₁ and f¹ to f₂, Γ̇ = f²·L f₁ + f¹·L f₂; where
    the weft lies anticlockwise of the warp f² is f₁ turned by 90° and f¹ is f₂ turned
    by −90°, so that both point between the fibres.
    """
    nodes = cloth.elements[e]
    now = x[:, nodes]
    vectors = []
    for at in GAUSS:
        p = point(cloth, e, at)
        a_1, a_2 = (fibre(deformation_gradient(x[..., None], p), A)[:, 0] for A in p.A)
        f_1, f_2 = a_1 / np.linalg.norm(a_1), a_2 / np.linalg.norm(a_2)
        normal_1, normal_2 = np.array([-f_1[1], f_1[0]]), np.array([f_2[1], -f_2[0]])
        f = np.outer(normal_1, f_1) + np.outer(normal_2, f_2)  # Γ̇ = Σ_ij f_ij L_ij
        B = gradients(now, bilinear(*at)[1]) - gradients(now, bilinear(0, 0)[1])
        vectors.append(B @ f.T)  # L_ij = Σ_a v_ai B_aj
    return polygon(now) / 4, vectors


def rate_step(cloth, x, last, moments, C_s):
    """Moments M̃_k after a step from ``last`` to ``x``, its work, and the forces at x.

    M̃_k grows by C_s f_k·(B_HGL,k Δu); the forces are Σ_k A/4 B_HGL,kᵀ f_k M̃_k, and the
    work is that of the mean of the old and the new M̃_k on the increment.
    """
    new, work, force = np.zeros_like(moments), 0.0, np.zeros_like(x)
    for e, nodes in enumerate(cloth.elements):
        quarter, vectors = rate_vectors(cloth, x, e)
        for k, vector in enumerate(vectors):
            increment = np.sum(vector.T * (x - last)[:, nodes])
            new[e, k] = moments[e, k] + C_s * increment
            work += quarter * (moments[e, k] + new[e, k]) / 2 * increment
            force[:, nodes] += quarter * vector.T * new[e, k]
    return new, work, force


def rate(cloth, x, C_s, converged):
    """Work of all steps over the converged states to x, and the forces at x."""
    last, moments, work = cloth.X, np.zeros((len(cloth.elements), 4)), 0.0
    for state in [*converged, x]:
        now = state[..., 0]
        moments, done, force = rate_step(cloth, now, last, moments, C_s)
        last, work = now, work + done
    return work, force
