"""Bending of fibres: the constant matrix of ½ D ∫ |κ|², one fibre family at a time.

κ = ∇∇x : A⊗A is the second derivative of the position along the fibre in mm⁻¹.  It is
linear in the displacement, turns with a rotation in space, and vanishes at rest, also
where fibres are curved in the plane at rest.
"""

from .matrix import FIBRE_ENDS, FibreEnd, Turning, bending_matrix, twist_matrix

__all__ = ["FIBRE_ENDS", "FibreEnd", "Turning", "bending_matrix", "twist_matrix"]
