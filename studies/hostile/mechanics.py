"""Whether a ply has the energies and forces that it must have, in plain numpy."""

import numpy as np
from numpy import ndarray
from numpy.random import Generator

from skfem_textile import Ply

from . import bilinear

#: How far an energy or a force may be off, as a share.
_OFF = 1e-6


class WrongError(Exception):
    """An answer that is not what it must be."""


def check_ply(
    ply: Ply,
    fibres: ndarray,
    stiffness: tuple[float, float],
    rng: Generator,
    size: float,
) -> None:
    """Compare a ply with plain formulas.

    Parameters
    ----------
    ply
        A ply of linear laws, that is at rest.
    fibres
        Angles of warp and weft at rest.
    stiffness
        Of fibres and of shear, E and G.
    rng
        Gives the displacements.
    size
        Length of a short edge, in the units of the mesh.

    Raises
    ------
    WrongError
        If it differs.
    """
    _check_stretch(ply, fibres, stiffness, rng)
    _check_balance(ply, rng, size)
    if ply.formulation.name in ("one-point", "full"):
        _check_wobble(ply, fibres, stiffness, rng, size)


def _near(what: str, found: float, expected: float, scale: float) -> None:
    if not abs(found - expected) <= _OFF * scale:
        raise WrongError(f"{what}: {found}, expected {expected}")


def _check_stretch(
    ply: Ply, fibres: ndarray, stiffness: tuple[float, float], rng: Generator
) -> None:
    """The energy of a stretch that is the same everywhere."""
    E, G = stiffness
    F = np.eye(2) + 0.1 * (2 * rng.random((2, 2)) - 1)
    middle = ply.nodes.mean(axis=1, keepdims=True)
    energies = ply.energies(_dofs(ply, (F - np.eye(2)) @ (ply.nodes - middle)))
    area = bilinear.areas(ply.mesh.p, ply.mesh.t).sum()
    strain = bilinear.strains(F[None, None], fibres).ravel()
    gamma = float(bilinear.shear_angles(F[None, None], fibres)[0, 0])
    tension = area * E / 2 * (strain**2).sum()
    _near("tension", energies["tension"], tension, tension)
    _near("shear", energies["shear"], area * G / 2 * gamma**2, tension)
    _near("stabilisation", energies.get("stabilisation", 0.0), 0.0, tension)
    _near("corners", energies["corners"], 0.0, tension)


def _dofs(ply: Ply, nodal: ndarray) -> ndarray:
    """Displacements of the nodes, shape (2, n), as the ply numbers them."""
    numbers = ply.nodal(np.arange(ply.basis.N))
    u = np.empty(ply.basis.N)
    u[numbers] = nodal
    return u


def _check_balance(ply: Ply, rng: Generator, size: float) -> None:
    """Forces sum to nothing, turn nothing, and are the derivative of the energy."""
    u = 0.01 * size * rng.standard_normal(ply.basis.N)
    f = ply.nodal(ply.residual(u))
    x = ply.nodes + ply.nodal(u)
    arms = x - x.mean(axis=1, keepdims=True)
    largest = np.abs(f).max() * len(f[0])
    _near("sum of the forces", float(np.abs(f.sum(axis=1)).max()), 0.0, largest)
    moment = float((arms[0] * f[1] - arms[1] * f[0]).sum())
    _near("moment of the forces", moment, 0.0, largest * np.abs(arms).max())
    way = rng.standard_normal(ply.basis.N)
    step = 1e-5 * size
    ahead, behind = ply.energy(u + step * way), ply.energy(u - step * way)
    slope = ply.residual(u) @ way
    scale = 100 * (np.abs(ply.residual(u) * way).max() + 1e-10 * ahead / step)
    _near("slope of the energy", (ahead - behind) / (2 * step), slope, scale)


def _check_wobble(
    ply: Ply,
    fibres: ndarray,
    stiffness: tuple[float, float],
    rng: Generator,
    size: float,
) -> None:
    """The energies of an arbitrary displacement."""
    u = 0.02 * size * rng.standard_normal(ply.basis.N)
    X, x, t = ply.nodes, ply.nodes + ply.nodal(u), ply.mesh.t
    one_point = ply.formulation.name == "one-point"
    E, G = stiffness
    tension, shear = bilinear.energies(X, x, t, fibres, E, (G, False), one_point)
    found = ply.energies(u)
    _near("tension", found["tension"], tension, tension)
    _near("shear", found["shear"], shear, shear)
    if one_point:
        held = bilinear.hourglass(X, x, t, fibres, ply.formulation.stabilisation)
        _near("stabilisation", found["stabilisation"], held, held)
