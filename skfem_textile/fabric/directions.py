"""Fibre directions: vectors, one per element, or a function of position."""

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.asking import asked, real_numbers


class Varied(Protocol):
    """Directions that are given in another way from one region to the next."""

    @property
    def region(self) -> ndarray:
        """Which of the regions each element is in."""
        ...

    def at(self, name: str, x: ndarray, element: ndarray | None) -> ndarray:
        """Unit vectors at points, given as for `unit_vectors`."""
        ...


Direction: TypeAlias = ArrayLike | Callable[[ndarray], ndarray] | Varied


def unit_vectors(
    name: str, direction: Direction, x: ndarray, element: ndarray | None = None
) -> ndarray:
    """Unit vectors of a direction field at the points ``x`` of some elements.

    Raises
    ------
    ValueError
        If the direction has a wrong shape, or is zero or not finite somewhere.
    """
    field: Any = direction
    if hasattr(field, "region"):
        return field.at(name, x, element)
    given = asked(name, direction, x) if callable(direction) else direction
    a = real_numbers(name, given)
    if element is not None and a.ndim == 2 and a.shape[1] > element.max():
        a = a[:, element]
    a = a.reshape(a.shape + (1,) * (x.ndim - a.ndim))
    try:
        fits = len(a) == 2 and np.broadcast_shapes(a.shape, x.shape) == x.shape
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise ValueError(
            f"{name} must be a vector, a function of position or one vector per "
            f"element, shape (2, n_elements); {a.shape} does not fit points {x.shape}"
        )
    largest = np.abs(a).max(axis=0)
    if not np.all(np.isfinite(largest) & (largest > 0)):
        raise ValueError(f"{name} must be a non-zero finite vector everywhere")
    a = np.ldexp(a, -np.frexp(largest)[1])  # no square of it overflows or vanishes
    return a / np.linalg.norm(a, axis=0)
