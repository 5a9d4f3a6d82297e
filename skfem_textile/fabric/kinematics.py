"""Fibre strain and shear angle of a deformation gradient, with their derivatives.

Pointwise formulas, without meshes.  Every tensor has its components first and the
points last, as in scikit-fem: a deformation gradient
``F`` has shape ``(d, 2, ...)``, a reference fibre direction ``A`` shape
``(2, ...)``; first derivatives with respect to ``F`` have shape ``(d, 2, ...)``
and second derivatives ``(d, 2, d, 2, ...)``.  The points may broadcast.

Here d = 2: the ply stays in its plane.
"""

import numpy as np
from numpy import ndarray
from skfem.helpers import cross, det, dot, mul


def deformation_gradient(grad_u: ndarray) -> ndarray:
    """Deformation gradient F = I + ∇u.

    Parameters
    ----------
    grad_u
        Displacement gradient, shape (2, 2, ...).
    """
    identity = np.eye(*grad_u.shape[:2])
    return identity.reshape(identity.shape + (1,) * (grad_u.ndim - 2)) + grad_u


def area_ratio(F: ndarray) -> ndarray:
    """Current area per reference area, det F; zero or negative where the ply folds."""
    return det(F)


def cofactor(F: ndarray) -> ndarray:
    """Derivative of the area ratio, ∂ det F/∂F = cof F, shape (2, 2, ...).

    It is linear in F: the second derivative along H and H′ is cof H : H′.
    """
    return np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])


def fibre(F: ndarray, A: ndarray) -> ndarray:
    """Current fibre vector a = F·A, shape (d, ...); its length is the stretch λ."""
    return mul(F, A)


def fibre_strain(F: ndarray, A: ndarray) -> ndarray:
    """Logarithmic fibre strain ε = ln λ, with λ = ‖a‖ and a = F·A.

    Parameters
    ----------
    F
        Deformation gradient, shape (d, 2, ...).
    A
        Unit reference direction of the fibre, shape (2, ...).
    """
    a = fibre(F, A)
    return 0.5 * np.log(dot(a, a))


def fibre_strain_d(F: ndarray, A: ndarray) -> ndarray:
    """First derivative ∂ε/∂F = a ⊗ A / λ², shape (d, 2, ...)."""
    a = fibre(F, A)
    return np.einsum("i...,J...->iJ...", a / dot(a, a), A)


def fibre_strain_dd(F: ndarray, A: ndarray) -> ndarray:
    """Second derivative ∂²ε/∂F² = (δ_ik/λ² − 2 a_i a_k/λ⁴) A_J A_L."""
    a = fibre(F, A)
    e = a / dot(a, a)
    delta = np.eye(len(a)).reshape(len(a), len(a), *(1,) * (a.ndim - 1))
    second = delta / dot(a, a) - 2 * np.einsum("i...,k...->ik...", e, e)
    return np.einsum("ik...,J...,L...->iJkL...", second, A, A)


def stretch(F: ndarray, A: ndarray) -> ndarray:
    """Stretch λ = ‖a‖ of a fibre, a = F·A."""
    a = fibre(F, A)
    return np.sqrt(dot(a, a))


def stretch_d(F: ndarray, A: ndarray) -> ndarray:
    """First derivative ∂λ/∂F = e ⊗ A with e = a/λ, shape (d, 2, ...)."""
    return np.einsum("i...,J...->iJ...", fibre(F, A) / stretch(F, A), A)


def stretch_dd(F: ndarray, A: ndarray) -> ndarray:
    """Second derivative ∂²λ/∂F² = (δ_ik − e_i e_k)/λ A_J A_L; none along the fibre."""
    a, length = fibre(F, A), stretch(F, A)
    e = a / length
    delta = np.eye(len(a)).reshape(len(a), len(a), *(1,) * (a.ndim - 1))
    m = (delta - np.einsum("i...,k...->ik...", e, e)) / length
    return np.einsum("ik...,J...,L...->iJkL...", m, A, A)


def shear_angle(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Shear angle Γ = ∠(A₁, A₂) − ∠(a₁, a₂) in radians.

    It is positive when the families approach each other and negative when they open,
    if the weft lies anticlockwise of the warp.  It is smooth until they coincide.  Its
    rate is Γ̇ = f²·L·f₁ + f¹·L·f₂ (Hamila & Boisse 2013, §3.2).

    Parameters
    ----------
    F
        Deformation gradient, shape (d, 2, ...).
    A1, A2
        Unit reference directions of warp and weft, shape (2, ...).
    """
    return _angle(A1, A2) - _angle(fibre(F, A1), fibre(F, A2))


def cos_angle(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Cosine of the angle ∠(a₁, a₂) at which the families cross."""
    a1, a2 = fibre(F, A1), fibre(F, A2)
    return dot(a1, a2) / np.sqrt(dot(a1, a1) * dot(a2, a2))


def shear_angle_d(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """First derivative ∂Γ/∂F = ∂θ₁/∂F − ∂θ₂/∂F, shape (d, 2, ...).

    θ_α is the inclination of a_α: ∂θ/∂F = p ⊗ A / λ² with p = a rotated by 90°.
    """
    return _inclination_d(F, A1) - _inclination_d(F, A2)


def shear_angle_dd(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Second derivative ∂²Γ/∂F² = ∂²θ₁/∂F² − ∂²θ₂/∂F², shape (d, 2, d, 2, ...)."""
    return _inclination_dd(F, A1) - _inclination_dd(F, A2)


def _angle(b: ndarray, c: ndarray) -> ndarray:
    """Angle from b to c in (−π, π]."""
    return np.arctan2(cross(b, c), dot(b, c))


def _rotated(a: ndarray) -> ndarray:
    """The vector a rotated by +90°."""
    return np.stack([-a[1], a[0]])


def _inclination_d(F: ndarray, A: ndarray) -> ndarray:
    a = fibre(F, A)
    return np.einsum("i...,J...->iJ...", _rotated(a) / dot(a, a), A)


def _inclination_dd(F: ndarray, A: ndarray) -> ndarray:
    """∂²θ/∂F² = −(p_i a_k + a_i p_k) A_J A_L / λ⁴."""
    a = fibre(F, A)
    e = a / dot(a, a)
    half = np.einsum("i...,k...->ik...", _rotated(e), e)
    second = half + half.swapaxes(0, 1)
    return -np.einsum("ik...,J...,L...->iJkL...", second, A, A)
