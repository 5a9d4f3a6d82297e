"""Surfaces of users, whose errors say of what they are."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from ...mesh.user_input import call_user_function
from ..states import NoEquilibriumError
from .surface import Surface


class SurfaceError(NoEquilibriumError, ValueError):
    """A surface that fails: before a run it is not valid, in a run an attempt fails."""


@dataclass(frozen=True, eq=False)
class Asked:
    """A surface of a user, whose errors say of what they are.

    Its methods raise a `SurfaceError` with the error of the user as its cause, or if an
    array has another shape.

    Parameters
    ----------
    name
        Name of the condition.
    surface
        The surface.
    """

    name: str
    surface: Surface

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return self._value("level", x, ())

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return self._value("gradient", x, (3,))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        return self._value("hessian", x, (3, 3))

    def _value(self, method: str, x: ndarray, rows: tuple[int, ...]) -> ndarray:
        what = f"condition {self.name!r}: {method} of the surface"
        try:
            found = call_user_function(what, getattr(self.surface, method), x)
        except ValueError as error:
            advice = "a surface that goes on beyond the ply, or a smaller ply"
            raise SurfaceError(str(error), advice=advice) from error.__cause__
        shape = *rows, x.shape[1]
        if np.shape(found) != shape:
            raise SurfaceError(
                f"{what} must have the shape {shape}, not {np.shape(found)}"
            )
        return np.asarray(found)
