"""Deformation of the fibres."""

import numpy as np

from .elements import CORNERS, SIX_NODES, gradients, shape


def deformation_gradient(x, p):
    """F = Σ_a x_a ⊗ ∂N_a/∂X, shape (2, 2, m)."""
    return np.einsum("iam,aJ->iJm", x[:, p.nodes], p.dN_dX)


def fibre(F, A):
    return np.einsum("iJm,J->im", F, A)


def strain(F, A):
    """ε = ln|F A|."""
    a = fibre(F, A)
    return np.log(a[0] ** 2 + a[1] ** 2) / 2


def angle(b, c):
    """Angle from b to c in (−π, π): twice the angle whose tangent is sin/(1 + cos)."""
    cos, sin = b[0] * c[0] + b[1] * c[1], b[0] * c[1] - b[1] * c[0]
    return 2 * np.arctan(sin / (np.sqrt(cos**2 + sin**2) + cos))


def shear_angle(F, A):
    """Γ = ∠(A₁, A₂) − ∠(a₁, a₂)."""
    return angle(*A) - angle(fibre(F, A[0]), fibre(F, A[1]))


def smallest_det_F(cloth, x):
    """The smallest det F at the nodes of all elements, for positions (2, n_nodes)."""
    found = []
    for nodes in cloth.elements:
        for at in CORNERS if len(nodes) == 4 else SIX_NODES:
            _, dN = shape(nodes, at)
            F = x[:, nodes] @ gradients(cloth.X[:, nodes], dN)
            found.append(np.linalg.det(F))
    return min(found)
