"""Compares energies and forces of a ply with plain formulas."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from numpy.random import Generator

from skfem_textile import Ply

from ..trial import WrongAnswerError
from . import bilinear

#: By how much an energy or a force may be off, as a share.
_TOLERANCE = 1e-6


@dataclass
class PlyCheck:
    """A ply, the data that its energies are computed from, and random displacements.

    Parameters
    ----------
    ply
        A ply of linear laws, at rest.
    fibres
        Angles of warp and weft at rest.
    E, G
        Stiffness of the fibres and in shear.
    rng
        Gives the displacements.
    size
        Length of a short edge, in the units of the mesh.
    """

    ply: Ply
    fibres: ndarray
    E: float
    G: float
    rng: Generator
    size: float

    def run(self) -> None:
        """Compare energies and forces with plain formulas.

        Raises
        ------
        WrongAnswerError
            If they differ.
        """
        self._check_uniform_stretch()
        self._check_forces()
        if self.ply.formulation.name in ("one-point", "full"):
            self._check_any_displacement()

    def _check_uniform_stretch(self) -> None:
        """Energies of a deformation gradient that is the same everywhere."""
        ply = self.ply
        F = np.eye(2) + 0.1 * (2 * self.rng.random((2, 2)) - 1)
        middle = ply.nodes.mean(axis=1, keepdims=True)
        u = np.empty(ply.basis.N)
        u[ply.nodal(np.arange(ply.basis.N))] = (F - np.eye(2)) @ (ply.nodes - middle)
        energies = ply.energies(u)
        area = bilinear.areas(ply.mesh.p, ply.mesh.t).sum()
        strain = bilinear.strains(F[None, None], self.fibres).ravel()
        gamma = float(bilinear.shear_angles(F[None, None], self.fibres)[0, 0])
        tension = area * self.E / 2 * (strain**2).sum()
        _check_near("tension", energies["tension"], tension, tension)
        _check_near("shear", energies["shear"], area * self.G / 2 * gamma**2, tension)
        held = energies.get("stabilisation", 0.0)
        _check_near("stabilisation", held, 0.0, tension)
        _check_near("corners", energies["corners"], 0.0, tension)

    def _check_forces(self) -> None:
        """Forces have no sum and no moment, and are the derivative of the energy."""
        ply, rng = self.ply, self.rng
        u = 0.01 * self.size * rng.standard_normal(ply.basis.N)
        f = ply.nodal(ply.residual(u))
        x = ply.nodes + ply.nodal(u)
        arms = x - x.mean(axis=1, keepdims=True)
        largest = np.abs(f).max() * len(f[0])
        total = float(np.abs(f.sum(axis=1)).max())
        _check_near("sum of the forces", total, 0.0, largest)
        moment = float((arms[0] * f[1] - arms[1] * f[0]).sum())
        _check_near("moment of the forces", moment, 0.0, largest * np.abs(arms).max())
        direction = rng.standard_normal(ply.basis.N)
        step = 1e-5 * self.size
        ahead = ply.energy(u + step * direction)
        behind = ply.energy(u - step * direction)
        slope = ply.residual(u) @ direction
        products = np.abs(ply.residual(u) * direction)
        scale = 100 * (products.max() + 1e-10 * ahead / step)
        _check_near("slope of the energy", (ahead - behind) / (2 * step), slope, scale)

    def _check_any_displacement(self) -> None:
        """Energies where every node is displaced on its own."""
        ply = self.ply
        u = 0.02 * self.size * self.rng.standard_normal(ply.basis.N)
        X, x, t = ply.nodes, ply.nodes + ply.nodal(u), ply.mesh.t
        one_point = ply.formulation.name == "one-point"
        tension, shear = bilinear.energies(
            X, x, t, self.fibres, self.E, (self.G, False), one_point
        )
        energies = ply.energies(u)
        _check_near("tension", energies["tension"], tension, tension)
        _check_near("shear", energies["shear"], shear, shear)
        if one_point:
            C_s = ply.formulation.stabilisation
            held = bilinear.hourglass(X, x, t, self.fibres, C_s)
            _check_near("stabilisation", energies["stabilisation"], held, held)


def _check_near(what: str, value: float, expected: float, scale: float) -> None:
    if not abs(value - expected) <= _TOLERANCE * scale:
        raise WrongAnswerError(f"{what}: {value}, expected {expected}")
