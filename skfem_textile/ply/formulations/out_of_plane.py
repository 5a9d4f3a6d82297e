"""The term that holds the corners of an element in space to a plane."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from numpy import ndarray

from ..kernels.element_groups import Parameters
from ..kernels.out_of_plane import OutOfPlaneKernel
from ..memory import HeldStabilisation
from ..terms import FormTerm


@dataclass(frozen=True, eq=False, kw_only=True)
class OutOfPlane(FormTerm):
    """The term of `out_of_plane`, with the numbers of its kernel.

    Parameters
    ----------
    C_s
        A number in N/mm, or what another term holds: both have one stiffness.
    """

    C_s: float | HeldStabilisation

    def parameters(self, t: float) -> Parameters:
        """What the forms are given beside the displacement."""
        return {**super().parameters(t), "C_s": self._stiffness}

    def energy(self, u: ndarray, t: float) -> float:
        """See `OutOfPlaneKernel`."""
        return self._numbers.energy(u, self._stiffness)

    def residual(self, u: ndarray, t: float) -> ndarray:
        """See `OutOfPlaneKernel`."""
        return self._numbers.forces(u, self._stiffness)

    def matrices(self, u: ndarray, t: float, convex: bool = False) -> ndarray:
        """See `OutOfPlaneKernel`."""
        return self._numbers.matrices(u, self._stiffness, convex)

    @property
    def _stiffness(self) -> Any:
        held = isinstance(self.C_s, HeldStabilisation)
        return self.C_s.parameters["C_s"] if held else self.C_s  # type: ignore[union-attr]

    @cached_property
    def _numbers(self) -> OutOfPlaneKernel:
        return OutOfPlaneKernel(self.basis)
