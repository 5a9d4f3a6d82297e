"""Stabilisation forms: non-constant shear, out-of-plane, and isotropic.

Hourglass stabilisation of the shear angle, with an energy or by rates.

Both give nodal forces Σ_k A/4 M̃_k δΓ̃_k from a moment M̃ at the four 2×2 points,
conjugate to the non-constant part Γ̃ of the shear angle (Hamila & Boisse 2013, §3.2).
The forms require an `HourglassBasis` and have the displacement as their parameter
``u``.

Isotropic hourglass control, for comparison with the stabilisation of shear alone.

Flanagan & Belytschko (1981) stabilise all hourglass modes equally, Hamila & Boisse
(2013) only to the extent that they change the shear angle.

Stabilisation of the out-of-plane hourglass mode.

In space the hourglass mode normal to the ply, which raises two opposite corners and
lowers the others, does not change the gradient at the centre of a quadrilateral.  To
first order it does not change the shear angle either, so that `hourglass` does not
stabilise it.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, DiscreteField, Functional, LinearForm
from skfem.helpers import ddot, dot, grad, inv

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..mesh.bases import centre_grad
from ..mesh.scikit_fem import FormExtraParams
from ..mesh.user_input import parameter
from .form import (
    Forms,
    builds_forms,
    contract,
    directions,
    displacement,
    once,
)

#: A function of the parameters of a form.
Pointwise: TypeAlias = Callable[[FormExtraParams], ndarray]


@builds_forms("HourglassKernel")
def hourglass(fabric: Fabric, C_s: float | None = None) -> Forms:
    """Stabilisation with the energy ½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))².

    M̃_k = C_s (Γ(ξ_k) − Γ(0)) on the reference area A is path-independent.  Both angles
    use the fibre directions at ξ_k, and Γ(0) the deformation gradient at the centre, so
    that a homogeneous deformation has zero energy even with curved fibres.

    Parameters
    ----------
    fabric
        Fibre directions; the stiffnesses are not used.
    C_s
        Stabilisation stiffness in N/mm.  If not given, the forms have a parameter
        ``C_s``, shape (n_elements, 1), see `HeldStabilisation`.
    """

    def difference(w):
        (F, F0), A = _gradients(w), directions(fabric, w)
        return kin.shear_angle(F, *A) - kin.shear_angle(F0, *A)

    def variation(w):
        (F, F0), A = _gradients(w), directions(fabric, w)
        return kin.shear_angle_d(F, *A), kin.shear_angle_d(F0, *A)

    def stiffness(w):
        return parameter(w, "C_s") if C_s is None else C_s

    @Functional
    def energy(w):
        return 0.5 * stiffness(w) * difference(w) ** 2

    def moment(w):
        return stiffness(w) * difference(w)

    return Forms(energy, *_residual_and_tangent(fabric, variation, moment, stiffness))


@builds_forms()
def hourglass_rate(fabric: Fabric, C_s: float) -> Forms:
    """Stabilisation by accumulated rates, the procedure of the paper.

    M̃_k = M̃_k(last) + C_s f_k·(B_HGL,k Δu), with f_k, B_HGL,k and the element area in
    the configuration ``u`` and Δu from the last converged one (Hamila & Boisse 2013,
    §3.2, where the rate must read B_HGL, not its transpose).  There is no energy: the
    energy form gives the work of the step.  The tangent is symmetric and approximate:
    f_k, B_HGL,k and the area are treated as constant, except for the curvature of the
    shear angle at the point and at the centre.

    The forms have two more parameters: ``last``, the last converged displacement, and
    ``moment``, the moments M̃ there, shape (n_elements, 4), see `AccumulatedMoment`.

    Parameters
    ----------
    fabric, C_s
        See `hourglass`.
    """

    def variation(w):
        return _rate_variation(fabric, w)

    def increment(w):
        return rate_increment(fabric, w)

    @Functional
    def work(w):
        mean_moment = parameter(w, "moment") + 0.5 * C_s * increment(w)
        return _area(w) * mean_moment * increment(w)

    def moment(w):
        return _area(w) * (parameter(w, "moment") + C_s * increment(w))

    def stiffness(w):
        return _area(w) * C_s

    return Forms(work, *_residual_and_tangent(fabric, variation, moment, stiffness))


def _rate_variation(fabric: Fabric, w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """f·B_HGL as the pair (f·F⁻ᵀ, f·F(0)⁻ᵀ), conjugate to ∇u(ξ) and ∇u(0)."""
    F, F0 = _gradients(w)
    d = kin.shear_angle_d(F, *directions(fabric, w))
    return d, np.einsum("iJ...,jJ...,Kj...->iK...", d, F, inv(F0))


def rate_increment(fabric: Fabric, w: FormExtraParams) -> ndarray:
    """f·(B_HGL Δu) of `hourglass_rate`, Δu from the parameter ``last`` to ``u``."""
    d = _rate_variation(fabric, w)
    return _along(d, displacement(w)) - _along(d, parameter(w, "last"))


def _residual_and_tangent(
    fabric: Fabric, variation: Callable, moment: Pointwise, stiffness: Pointwise
) -> tuple[LinearForm, BilinearForm]:
    """Residual and tangent of a moment conjugate to δΓ̃ = d : δ∇u(ξ) − d₀ : δ∇u(0)."""

    def curvature(w):
        (F, F0), A = _gradients(w), directions(fabric, w)
        return kin.shear_angle_dd(F, *A), kin.shear_angle_dd(F0, *A)

    @LinearForm
    def residual(v, w):
        return once(w, moment) * _along(once(w, variation), v)

    @BilinearForm
    def tangent(u, v, w):
        d, (dd, dd0) = once(w, variation), once(w, curvature)
        return once(w, stiffness) * _along(d, u) * _along(d, v) + once(w, moment) * (
            contract(_grad(v), dd, _grad(u))
            - contract(centre_grad(v), dd0, centre_grad(u))
        )

    return residual, tangent


def _gradients(w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """Deformation gradients at the point and at the element centre."""
    u = displacement(w)
    at_centre = centre_grad(u)
    return kin.deformation_gradient(_grad(u)), kin.deformation_gradient(at_centre)


def _area(w: FormExtraParams) -> ndarray:
    """Current area of the element per reference area."""
    return kin.area_ratio(kin.deformation_gradient(centre_grad(displacement(w))))


def _along(d: tuple[ndarray, ndarray], v: DiscreteField) -> ndarray:
    return ddot(d[0], _grad(v)) - ddot(d[1], centre_grad(v))


def _grad(u: DiscreteField) -> ndarray:
    """Full gradient of a field on the hourglass basis."""
    return centre_grad(u) + grad(u)


def _fluctuation(u: DiscreteField) -> ndarray:
    """Its fluctuation ∇u(ξ) − ∇u(0)."""
    return _grad(u) - centre_grad(u)


@builds_forms()
def isotropic_hourglass(stiffness: float) -> Forms:
    """Stabilisation with the energy ½ κ Σ_k A/4 ‖∇u(ξ_k) − ∇u(0)‖².

    It vanishes for homogeneous deformations and is invariant under rotations of the
    ply.  The forms require an `HourglassBasis`.

    Parameters
    ----------
    stiffness
        κ in N/mm.
    """

    @Functional
    def energy(w):
        u = displacement(w)
        return 0.5 * stiffness * ddot(_fluctuation(u), _fluctuation(u))

    @LinearForm
    def residual(v, w):
        return stiffness * ddot(_fluctuation(displacement(w)), _fluctuation(v))

    @BilinearForm
    def tangent(u, v, w):
        return stiffness * ddot(_fluctuation(u), _fluctuation(v))

    return Forms(energy, residual, tangent)


@builds_forms()
def out_of_plane() -> Forms:
    """Stabilisation with the energy ½ C_s Σ_k A/4 ‖N·(∇u(ξ_k) − ∇u(0))‖².

    N is the area vector of the deformation at the centre, normal to the element with
    the area ratio as its length.  The energy is invariant under rotations in space, and
    vanishes for all motions in a plane.  The forms require an `HourglassBasis` and have
    the parameter ``C_s`` in N/mm, a number or an array of shape (n_elements, 1), see
    `HeldStabilisation`.
    """

    def at_centre(w):
        return kin.deformation_gradient(centre_grad(displacement(w)))

    def normal(w):
        return kin.area_vector(at_centre(w))

    def lift(w):
        return _across(once(w, normal), grad(displacement(w)))

    def turn(w, v):
        """Increment of the area vector."""
        return kin.area_vector_d(once(w, at_centre), centre_grad(v))

    def variation(w, v):
        return _across(turn(w, v), grad(displacement(w))) + _across(
            once(w, normal), grad(v)
        )

    @Functional
    def energy(w):
        return 0.5 * parameter(w, "C_s") * dot(lift(w), lift(w))

    @LinearForm
    def residual(v, w):
        return parameter(w, "C_s") * dot(once(w, lift), variation(w, v))

    @BilinearForm
    def tangent(u, v, w):
        bend = kin.area_vector_d(centre_grad(u), centre_grad(v))
        second = (
            _across(bend, grad(displacement(w)))
            + _across(turn(w, u), grad(v))
            + _across(turn(w, v), grad(u))
        )
        square = dot(variation(w, u), variation(w, v))
        return parameter(w, "C_s") * (square + dot(once(w, lift), second))

    return Forms(energy, residual, tangent)


def _across(c: ndarray, gradient: ndarray) -> ndarray:
    """N·∇u, shape (2, ...)."""
    return np.einsum("i...,iJ...->J...", c, gradient)
