"""Hourglass stabilisation of the shear angle: with an energy, or by the paper's rates.

Both give nodal forces Σ_k A/4 M̃_k δΓ̃_k from a moment M̃ at the four 2×2 points that
works on the non-constant part Γ̃ of the shear angle (Hamila & Boisse 2013, §3.2).  The
forms go with `HourglassBasis` and take the displacement as their parameter ``u``.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, CellBasis, DiscreteField, Functional, LinearForm, asm
from skfem.assembly.form.form import FormExtraParams
from skfem.helpers import ddot, grad, inv

from . import kinematics as kin
from .elements import CENTRE, centre_grad
from .fabric import Fabric, is_zero
from .forms import Forms, contract, directions, fused, once
from .kernels import HourglassKernel

# C_s by default, as a share of the secant shear stiffness or of the fibre stiffness.
_OF_SHEAR, _OF_FIBRES = 8.0, 1e-4

# Below this shear angle (radians) the secant is the tangent at rest.
_SMALL_ANGLE = 1e-6

#: A function of the parameters of a form.
Pointwise: TypeAlias = Callable[[FormExtraParams], ndarray]


def hourglass(fabric: Fabric, C_s: float | None = None) -> Forms:
    """Stabilisation with the energy ½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))².

    M̃_k = C_s (Γ(ξ_k) − Γ(0)) on the reference area A: independent of the path.
    Both angles are those of the fibres at ξ_k: Γ(0) is what the gradient at the centre
    makes of them, so that a homogeneous motion costs nothing where fibres are curved.

    Parameters
    ----------
    fabric
        Gives the fibre directions; its stiffnesses play no part.
    C_s
        Stabilisation stiffness in N/mm.  Without it the forms take a parameter
        ``C_s``, shape (n_elements, 1); `HeldStabilisation` keeps one.
    """

    def difference(w):
        (F, F0), A = _F(w), directions(fabric, w)
        return kin.shear_angle(F, *A) - kin.shear_angle(F0, *A)

    def variation(w):
        (F, F0), A = _F(w), directions(fabric, w)
        return kin.shear_angle_d(F, *A), kin.shear_angle_d(F0, *A)

    def stiffness(w):
        return w["C_s"] if C_s is None else C_s

    @Functional
    def energy(w):
        return 0.5 * stiffness(w) * difference(w) ** 2

    def moment(w):
        return stiffness(w) * difference(w)

    forms = Forms(energy, *_forms(fabric, variation, moment, stiffness))
    return fused(forms, HourglassKernel(fabric, C_s))


class HeldStabilisation:
    """C_s of `hourglass` in each element, from its shear at the last converged state.

    Eight times the secant shear stiffness M_s/Γ at the centre, at least a tenth of what
    it was at rest; without shear stiffness at rest 10⁻⁴ of the fibre stiffness, or more
    where the secant is.  It is held during a step, so that the tangent is exact.

    Parameters
    ----------
    fabric
        Gives fibre directions, tension and shear laws.
    basis
        The `HourglassBasis` of the forms.

    Attributes
    ----------
    parameters
        Parameter ``C_s`` of the forms.
    work
        Work of the stabilisation so far in N·mm beyond its energy at this C_s.
    drift, held
        By how much its energy changed with C_s when that last did, and what it was
        before, in N·mm.
    """

    def __init__(self, fabric: Fabric, basis: CellBasis) -> None:
        self._fabric, self._basis = fabric, basis
        self._energy = hourglass(fabric).energy
        self.reset()

    def reset(self) -> None:
        """Return to the undeformed state."""
        self.parameters = {"C_s": self._stabilisation(self._basis.zeros())}
        self.work = self.drift = self.held = 0.0

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; tell whether C_s changed."""
        basis, before = self._basis, self.parameters["C_s"]
        C_s = self._stabilisation(u)
        if np.array_equal(C_s, before):
            self.drift = 0.0
            return False
        # What is stored stays stored, however stiff the element is from now on.
        self.work += asm(self._energy, basis, u=u, C_s=before - C_s)
        self.drift = asm(self._energy, basis, u=u, C_s=np.abs(before - C_s))
        self.held = asm(self._energy, basis, u=u, C_s=before)
        self.parameters = {"C_s": C_s}
        return True

    @np.errstate(over="ignore")  # a run refuses what is not finite
    def _stabilisation(self, u: ndarray) -> ndarray:
        law, least = self._fabric.shear_law, _at_rest(self._fabric)
        if is_zero(law):
            return np.full((self._basis.nelems, 1), least)
        # The centre's gradient is the same at the four points of an element.
        field: Any = self._basis.interpolate(u)
        F = kin.deformation_gradient(centre_grad(field)[..., :1])
        centre, _ = CENTRE
        x = self._basis.mapping.F(centre, self._basis.tind)
        angle = kin.shear_angle(F, *self._fabric.directions(x))
        at_rest = law.tangent(np.zeros(1))
        sheared = np.abs(angle) > _SMALL_ANGLE
        divisor = np.where(sheared, angle, 1.0)
        secant = np.where(sheared, law.value(angle) / divisor, at_rest)
        return np.maximum(_OF_SHEAR * secant, least)


def _at_rest(fabric: Fabric) -> float:
    """The least C_s of `HeldStabilisation`."""
    G = float(fabric.shear_law.tangent(np.zeros(1))[0])
    if G > 0:
        return 0.1 * _OF_SHEAR * G
    return _OF_FIBRES * float(
        np.mean([f.tension.tangent(np.zeros(1)) for f in fabric.families])
    )


def hourglass_rate(fabric: Fabric, C_s: float) -> Forms:
    """Stabilisation by accumulated rates: the paper's own procedure.

    M̃_k = M̃_k(last) + C_s f_k·(B_HGL,k Δu), with f_k, B_HGL,k and the element's area
    taken in the configuration ``u`` and Δu from the last converged one (Hamila &
    Boisse 2013, §3.2, where the rate must read B_HGL, not its transpose).  There is no
    energy: the first form gives the work of the step.  The tangent is symmetric and
    approximate: it takes f_k, B_HGL,k and the area as constant, but for the curvature
    of the shear angle at the point and at the centre.

    The forms take two more parameters: ``last``, the last converged displacement, and
    ``moment``, the moments M̃ there, shape (n_elements, 4); `AccumulatedMoment`
    keeps them.

    Parameters
    ----------
    fabric, C_s
        As for `hourglass`.
    """

    def variation(w):
        return _rate_variation(fabric, w)

    def increment(w):
        return _rate_increment(fabric, w)

    @Functional
    def work(w):
        mean_moment = w["moment"] + 0.5 * C_s * increment(w)
        return _area(w) * mean_moment * increment(w)

    def moment(w):
        return _area(w) * (w["moment"] + C_s * increment(w))

    def stiffness(w):
        return _area(w) * C_s

    return Forms(work, *_forms(fabric, variation, moment, stiffness))


class AccumulatedMoment:
    """Moments M̃ and work of `hourglass_rate` at the last converged state.

    Parameters
    ----------
    fabric, C_s
        As for `hourglass_rate`.
    basis
        The `HourglassBasis` of the forms.

    Attributes
    ----------
    parameters
        Parameters ``last`` and ``moment`` of the forms.
    work
        Work of the stabilisation so far in N·mm.
    drift, held
        Infinite and zero: the rates of a long step are those of its end.
    """

    drift, held = np.inf, 0.0

    def __init__(self, fabric: Fabric, C_s: float, basis: CellBasis) -> None:
        self._fabric, self._C_s, self._basis = fabric, C_s, basis
        self._work = hourglass_rate(fabric, C_s).energy
        self.reset()

    def reset(self) -> None:
        """Forget everything: the undeformed state."""
        self.parameters = {
            "last": self._basis.zeros(),
            "moment": self._basis.zero_w(),
        }
        self.work = 0.0

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; the forces stay what they are."""
        basis, parameters = self._basis, self.parameters
        self.work += asm(self._work, basis, u=u, **parameters)
        w = FormExtraParams(
            x=basis.global_coordinates(),
            u=basis.interpolate(u),
            last=basis.interpolate(parameters["last"]),
        )
        increment = _rate_increment(self._fabric, w)
        moment = parameters["moment"] + self._C_s * increment
        self.parameters = {"last": u.copy(), "moment": moment}
        return False


def _rate_variation(fabric: Fabric, w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """f·B_HGL as the pair (f·F⁻ᵀ, f·F(0)⁻ᵀ) that works on ∇u(ξ) and ∇u(0)."""
    F, F0 = _F(w)
    d = kin.shear_angle_d(F, *directions(fabric, w))
    return d, np.einsum("iJ...,jJ...,Kj...->iK...", d, F, inv(F0))


def _rate_increment(fabric: Fabric, w: FormExtraParams) -> ndarray:
    """f·(B_HGL Δu)."""
    d = _rate_variation(fabric, w)
    return _along(d, w["u"]) - _along(d, w["last"])


def _forms(
    fabric: Fabric, variation: Callable, moment: Pointwise, stiffness: Pointwise
) -> tuple[LinearForm, BilinearForm]:
    """Residual and tangent of a moment that works on δΓ̃ = d : δ∇u(ξ) − d₀ : δ∇u(0)."""

    def curvature(w):
        (F, F0), A = _F(w), directions(fabric, w)
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


def _F(w: FormExtraParams) -> tuple[ndarray, ndarray]:
    """Deformation gradients at the point and at the element's centre."""
    u = w["u"]
    at_centre = centre_grad(u)
    return kin.deformation_gradient(_grad(u)), kin.deformation_gradient(at_centre)


def _area(w: FormExtraParams) -> ndarray:
    """Current area of the element per reference area."""
    return kin.area_ratio(kin.deformation_gradient(centre_grad(w["u"])))


def _along(d: tuple[ndarray, ndarray], v: DiscreteField) -> ndarray:
    return ddot(d[0], _grad(v)) - ddot(d[1], centre_grad(v))


def _grad(u: DiscreteField) -> ndarray:
    """Whole gradient of a field on the hourglass basis."""
    return centre_grad(u) + grad(u)
