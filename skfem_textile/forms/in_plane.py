"""Forms of tension, shear, and resistance of corners to folding.

Fibre tension at the mean stretch of an element avoids tension locking.

Each integration point with nearly inextensible fibres adds a constraint.  With one
point per quadrilateral there are as many constraints as unknowns, with three points per
quadratic triangle there are more: both lock for realistic fibre stiffnesses where the
shear angle jumps along fibres.  Here the fibre law is evaluated at the mean λ̄ of the
stretches at the points of an element, and deviations from it have a stiffness E_d that
is independent of the fibre stiffness,

    ψ(ln λ̄) + ½ E_d (λ − λ̄)²,

where ψ depends on each family separately, or on the means of both.

The mean is taken of the stretch and not of its logarithm: the stretch has no second
derivative along the fibre, so that the stiffness of a deviation is E_d at any tension,
whereas with the logarithm it would be E_d − T.  The formulation is consistent:
deviations vanish under mesh refinement.

Stabilisation by the jump of the shear angle across interior edges vanishes for a
continuous shear angle, including a linear one, and couples neighbouring elements.

A bilinear quadrilateral is not folded if and only if det F is positive at its corners.
Fibre and stabilisation terms are not evaluated at corners, so that corners need a
separate resistance:

    κ Σ_corners A/n b(det F),   b(J) = ln³(J₀/J) where J < J₀, and 0 elsewhere,

an energy that is C² and exactly zero while every corner is open.  Below J₁ = J₀/4, b is
replaced by its osculating parabola, so that iterates may be folded; the acceptance
checks reject folded states.  In space det F is replaced by the area ratio, which has no
sign.
"""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..fabric.law import with_slip
from ..mesh.bases import JumpBasis, mean
from ..mesh.user_input import parameter
from .form import (
    Forms,
    builds_forms,
    contract,
    deformation,
    directions,
    elements,
    families_with_law,
    gradient,
    of_density,
    once,
    outer,
)


@builds_forms("TensionKernel")
def tension(fabric: Fabric) -> Forms:
    """Fibre tension: virtual work ∫ Σ_α T_α δε_α dΩ.

    A tension may depend on both strains; the tangent then couples warp and weft.

    The tangent has an optional parameter ``tension``, shape (2, n_elements, n_points):
    fibre tensions (warp, weft) for its geometric part instead of T(ε).  For laws with
    friction elements the forms have an optional parameter ``slip``, shape (2, n_slips,
    n_elements, n_points), see `WithFriction`.

    Raises
    ------
    ValueError
        If the fabric has no tension stiffness.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem import MeshQuad, asm
    >>> from skfem_textile import CENTRE, Fabric, quad_basis
    >>> mesh = MeshQuad().refined(2)
    >>> u = 0.01 * mesh.p.T.ravel()  # both families stretched by 1 %
    >>> energy = asm(tension(Fabric(1e4)).energy, quad_basis(mesh, CENTRE), u=u)
    >>> bool(np.isclose(energy, 1e4 * np.log(1.01) ** 2))
    True
    """
    if not (families := families_with_law(fabric)):
        raise ValueError("the fabric has no tension stiffness: omit this term")

    def law(w):
        """Tensions T(ε₁, ε₂)."""
        return _held(fabric.at(elements(w)).tensions, w)

    def strains(w):
        F, A = deformation(w), directions(fabric, w)
        return np.array([kin.fibre_strain(F, a) for a in A])

    def energy(w):
        return sum(law(w).energies(strains(w)))

    def stress(w):
        F, A = deformation(w), directions(fabric, w)
        T = law(w).value(strains(w))
        return sum(T[i] * kin.fibre_strain_d(F, A[i]) for i in families)

    def stiffness(w):
        F, A = deformation(w), directions(fabric, w)
        slopes, d_eps = law(w).slopes(strains(w)), [kin.fibre_strain_d(F, a) for a in A]
        T = w["tension"] if "tension" in w else law(w).value(strains(w))
        C = np.zeros(1)
        for i in families:
            C = C + slopes.own[i] * outer(d_eps[i], d_eps[i])
            C = C + T[i] * kin.fibre_strain_dd(F, A[i])
        if slopes.cross is not None:
            C = C + slopes.cross * (outer(*d_eps) + outer(*d_eps[::-1]))
        return C

    return of_density(energy, stress, stiffness)


@builds_forms("MeanTensionKernel")
def mean_tension(fabric: Fabric) -> Forms:
    """Fibre tension with the energy ψ(ln λ̄) + ½ E_d (λ − λ̄)².

    The forms require a `MeanBasis` and have the parameter ``E_d`` in N/mm, shape (2,
    n_elements, 1).  The tangent has an optional parameter ``tension``, shape (2,
    n_elements, n_points), see `tension`; ``slip`` has the shape (2, n_slips,
    n_elements, 1).

    Parameters
    ----------
    fabric
        Fibre directions and tension laws.
    """
    families = families_with_law(fabric)

    def law(w):
        """Tensions T(ε₁, ε₂) of the means, from the laws at the first points."""
        element = elements(w)
        return _held(fabric.at(None if element is None else element[:, :1]).tensions, w)

    def stretches(w):
        F, A = deformation(w), directions(fabric, w)
        return [kin.stretch(F, a) for a in A]

    def mean_stretches(w):
        return np.array([mean(w, lam) for lam in once(w, stretches)])

    def state(w):
        """λ, E_d and λ̄."""
        return once(w, stretches), parameter(w, "E_d"), once(w, mean_stretches)

    def variation(w):
        """∂λ/∂F."""
        F, A = deformation(w), directions(fabric, w)
        return [kin.stretch_d(F, a) for a in A]

    def force(w):
        """∂ψ/∂λ: the tension over the stretch."""
        lam, E_d, means = state(w)
        T = law(w).value(np.log(means))
        return {i: T[i] / means[i] + E_d[i] * (lam[i] - means[i]) for i in families}

    def stress(w):
        N, d_lam = force(w), once(w, variation)
        return sum(N[i] * d_lam[i] for i in families)

    def local_stiffness(w):
        """Local part of the tangent at one point."""
        F, A = deformation(w), directions(fabric, w)
        (lam, E_d, _), d_lam = state(w), once(w, variation)
        if "tension" in w:
            N = {i: w["tension"][i] / lam[i] for i in families}
        else:
            N = force(w)
        return sum(
            E_d[i] * outer(d_lam[i], d_lam[i]) + N[i] * kin.stretch_dd(F, A[i])
            for i in families
        )

    def mean_stiffness(w):
        """Stiffness of the mean of each family, and coupling of the two means."""
        _, E_d, means = state(w)
        T, slopes = law(w).value(np.log(means)), law(w).slopes(np.log(means))
        direct = {i: (slopes.own[i] - T[i]) / means[i] ** 2 - E_d[i] for i in families}
        if slopes.cross is None:
            return direct, None
        return direct, slopes.cross / (means[0] * means[1])

    @Functional
    def energy(w):
        lam, E_d, means = state(w)
        return sum(law(w).energies(np.log(means))) + sum(
            0.5 * E_d[i] * (lam[i] - means[i]) ** 2 for i in families
        )

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), gradient(v))

    @BilinearForm
    def tangent(u, v, w):
        d_lam, (direct, cross) = once(w, variation), once(w, mean_stiffness)
        of_u, of_v = ([mean(w, ddot(d, gradient(x))) for d in d_lam] for x in (u, v))
        means = sum(direct[i] * of_u[i] * of_v[i] for i in families)
        if cross is not None:
            means = means + cross * (of_u[0] * of_v[1] + of_u[1] * of_v[0])
        return means + contract(gradient(v), once(w, local_stiffness), gradient(u))

    return Forms(energy, residual, tangent)


@builds_forms("ShearKernel")
def shear(fabric: Fabric) -> Forms:
    """In-plane shear: virtual work ∫ M_s δΓ dΩ.

    For a law with friction elements the forms have an optional parameter ``slip``,
    shape (n_slips, n_elements, n_points), see `WithFriction`.
    """

    def law(w):
        return _held(fabric.at(elements(w)).shear_law, w)

    def energy(w):
        M_s = law(w)
        return M_s.energy(kin.shear_angle(deformation(w), *directions(fabric, w)))

    def stress(w):
        F, A, M_s = deformation(w), directions(fabric, w), law(w)
        return M_s.value(kin.shear_angle(F, *A)) * kin.shear_angle_d(F, *A)

    def stiffness(w):
        F, A, M_s = deformation(w), directions(fabric, w), law(w)
        angle, d_angle = kin.shear_angle(F, *A), kin.shear_angle_d(F, *A)
        return M_s.tangent(angle) * outer(d_angle, d_angle) + M_s.value(
            angle
        ) * kin.shear_angle_dd(F, *A)

    return of_density(energy, stress, stiffness)


def _held(law: Any, w: Any) -> Any:
    """The law with the slip of its friction elements, by default none."""
    return with_slip(law, w["slip"]) if "slip" in w else law


@builds_forms(basis=JumpBasis)
def shear_continuity(fabric: Fabric, C_j: float) -> Forms:
    """Stabilisation with the energy ½ C_j Σ_edges (A⁺ + A⁻)/4 [[Γ]]².

    The forms require a `JumpBasis`.

    Parameters
    ----------
    fabric
        Fibre directions; the stiffnesses are not used.
    C_j
        Stabilisation stiffness in N/mm.
    """

    def jump(w):
        return _jump(kin.shear_angle(deformation(w), *directions(fabric, w)))

    def variation(w):
        return kin.shear_angle_d(deformation(w), *directions(fabric, w))

    def curvature(w):
        return kin.shear_angle_dd(deformation(w), *directions(fabric, w))

    @Functional
    def energy(w):
        return 0.5 * C_j * jump(w) ** 2

    @LinearForm
    def residual(v, w):
        return C_j * once(w, jump) * _jump(ddot(once(w, variation), gradient(v)))

    @BilinearForm
    def tangent(u, v, w):
        d = once(w, variation)
        second = contract(gradient(v), once(w, curvature), gradient(u))
        return C_j * (
            _jump(ddot(d, gradient(u))) * _jump(ddot(d, gradient(v)))
            + once(w, jump) * _jump(second)
        )

    return Forms(energy, residual, tangent)


def _jump(x: ndarray) -> ndarray:
    """[[x]], equal at both points of an edge."""
    return np.repeat(x[..., :1] - x[..., 1:], 2, axis=-1)


#: J₀, the area ratio det F below which a corner resists.  Inextensible orthogonal
#: fibres reach it at a shear angle of 85.4° (cos 85.4° = 0.08), beyond the locking
#: angles of fabrics.
RESISTING = 0.08

# J₁, the area ratio below which b is a parabola.  There b″ is 3·10⁴, compared with 1
# for a shear law (docs/theory/plane.md).
_PARABOLA = RESISTING / 4


def resistance(J: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """b(J) and its first and second derivative, for area ratios J of any sign."""
    J_in = np.clip(J, _PARABOLA, RESISTING)
    log, beyond = np.log(RESISTING / J_in), np.minimum(J - _PARABOLA, 0.0)
    b, d, dd = log**3, -3 * log**2 / J_in, (6 * log + 3 * log**2) / J_in**2
    return b + d * beyond + 0.5 * dd * beyond**2, d + dd * beyond, dd


@builds_forms()
def corner_resistance(stiffness: float) -> Forms:
    """Resistance of corners with the energy κ Σ A/n b(det F).

    The forms require a basis with one point, a node, in each of its elements, with the
    weight A/n: the area of the element over its number of nodes.

    Parameters
    ----------
    stiffness
        κ in N/mm.
    """

    def derivatives(w):
        return resistance(kin.area_ratio(deformation(w)))

    @Functional
    def energy(w):
        b, _, _ = derivatives(w)
        return stiffness * b

    @LinearForm
    def residual(v, w):
        _, d, _ = once(w, derivatives)
        return stiffness * d * kin.area_ratio_d(deformation(w), gradient(v))

    @BilinearForm
    def tangent(u, v, w):
        _, d, dd = once(w, derivatives)
        F = deformation(w)
        square = kin.area_ratio_d(F, gradient(u)) * kin.area_ratio_d(F, gradient(v))
        return stiffness * (
            dd * square + d * kin.area_ratio_dd(F, gradient(u), gradient(v))
        )

    return Forms(energy, residual, tangent)
