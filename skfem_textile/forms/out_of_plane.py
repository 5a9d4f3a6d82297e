"""Stabilisation of the motion that lifts the corners of an element off a plane.

In space a point at the centre of a quadrilateral does not see the hourglass motion
across the ply, which lifts two opposite corners and lowers the others.  The shear angle
does not change with it either, to first order, so that `hourglass` does not see it.
"""

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import dot, grad

from ..fabric import kinematics as kin
from ..mesh.bases import centre_grad
from .form import Forms, once


def out_of_plane() -> Forms:
    """Stabilisation with the energy ½ C_s Σ_k A/4 ‖N·(∇u(ξ_k) − ∇u(0))‖².

    N is the area vector of the deformation at the centre, normal to the element and as
    long as its area ratio.  The energy does not change with rotations in space, and it
    vanishes for all motions in a plane.  The forms go with `HourglassBasis` and take
    the parameter ``C_s`` in N/mm, a number or an array of shape (n_elements, 1), as
    `HeldStabilisation` stores it.
    """

    def at_centre(w):
        return kin.deformation_gradient(centre_grad(w["u"]))

    def normal(w):
        return kin.area_vector(at_centre(w))

    def lift(w):
        return _across(once(w, normal), grad(w["u"]))

    def turn(w, v):
        """Change of the area vector."""
        return kin.area_vector_d(once(w, at_centre), centre_grad(v))

    def variation(w, v):
        return _across(turn(w, v), grad(w["u"])) + _across(once(w, normal), grad(v))

    @Functional
    def energy(w):
        return 0.5 * w["C_s"] * dot(lift(w), lift(w))

    @LinearForm
    def residual(v, w):
        return w["C_s"] * dot(once(w, lift), variation(w, v))

    @BilinearForm
    def tangent(u, v, w):
        bend = kin.area_vector_d(centre_grad(u), centre_grad(v))
        second = (
            _across(bend, grad(w["u"]))
            + _across(turn(w, u), grad(v))
            + _across(turn(w, v), grad(u))
        )
        square = dot(variation(w, u), variation(w, v))
        return w["C_s"] * (square + dot(once(w, lift), second))

    return Forms(energy, residual, tangent)


def _across(c: ndarray, gradient: ndarray) -> ndarray:
    """N·∇u, shape (2, ...)."""
    return np.einsum("i...,iJ...->J...", c, gradient)
