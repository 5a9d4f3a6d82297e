"""Scenes `trellis` and `picture_frame`: motions that stretch no fibre, enforced.

Every planar motion without fibre strain is x = f(X₁) + g(X₂) with ‖f′‖ = ‖g′‖ = 1,
where X = X₁ A₁ + X₂ A₂ are coordinates along warp and weft: a trellis of bars.  Here
it is given by the angles through which f′ and g′ turn away from A₁ and A₂, and
enforced on the whole boundary.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy import ndarray
from numpy.polynomial.legendre import leggauss
from skfem import Mesh

from ..conditions import Condition
from ..meshes import MeshError, check_mesh, with_edges
from .rectangle import rectangle
from .scene import Scene

#: Side of the ply in mm.
SIDE = 100.0

#: Angle in radians through which a family has turned at the coordinate s along its
#: fibres (mm) and the load factor t: ``(s, t) -> (n,)``.
Turn: TypeAlias = Callable[[ndarray, float], ndarray]

_XI, _WEIGHTS = leggauss(24)


def picture_frame(
    mesh: str | Mesh = "irregular",
    size: tuple[int, int] = (10, 10),
    jitter: float = 0.3,
    seed: int = 1,
    shear_angle: float = np.pi / 4,
) -> Scene:
    """A square ply in a hinged frame, fibres along its sides.

    The bottom bar stays where it is and the side bars turn: at the load factor t the
    shear angle is γ = t·shear_angle everywhere.  With sides of length L the force on
    the top bar is L·C(γ)·(cos γ, −sin γ), where C is the shear moment per area; a
    machine that pulls two corners apart would need F = L·C(γ)/sin(π/4 − γ/2).  The
    nodes at its ends carry half an element of the side bars too, which cancels where
    these elements are equally high.

    Parameters
    ----------
    mesh, size, jitter, seed
        As for `trellis`.
    shear_angle
        Shear angle at the end in radians.

    Raises
    ------
    ValueError
        If the mesh is not valid, or the frame would close.
    """
    turns = (_straight, lambda s, t: np.full(s.shape, -t * shear_angle))
    return replace(trellis(mesh, size, jitter, seed, turns=turns), name="picture_frame")


def trellis(
    mesh: str | Mesh = "irregular",
    size: tuple[int, int] = (10, 10),
    jitter: float = 0.3,
    seed: int = 1,
    warp: float = 0.0,
    weft: float = np.pi / 2,
    turns: tuple[Turn, Turn] | None = None,
) -> Scene:
    """A ply whose boundary follows a motion that stretches no fibre.

    Parameters
    ----------
    mesh
        A mesh, or the kind of `rectangle` to make, a square of side `SIDE`.
    size, jitter, seed
        Of the mesh to make.
    warp, weft
        Inclination of the fibres in radians.
    turns
        How warp and weft turn; by default as `sheared` by 45° and bent by 30°.

    Raises
    ------
    ValueError
        If the mesh is not valid, the fibres are parallel, or they would fold onto one
        another somewhere.
    """
    if isinstance(mesh, str):
        mesh = rectangle(SIDE, SIDE, size, mesh, jitter, seed)
    else:
        check_mesh(mesh)
        mesh = with_edges(mesh)
        if "top" not in mesh.boundaries:
            raise MeshError("trellis: the mesh has no straight top edge; name it")
    turns = sheared(np.pi / 4, np.pi / 6) if turns is None else turns
    motion = Motion((warp, weft), turns)
    motion.check(mesh.p)
    return Scene(
        name="trellis",
        mesh=mesh.with_boundaries({"boundary": mesh.boundary_facets()}),
        warp=(float(np.cos(warp)), float(np.sin(warp))),
        weft=(float(np.cos(weft)), float(np.sin(weft))),
        conditions={
            "boundary": Condition("boundary", motion.displacement),
            "top": Condition("top", motion.displacement),
        },
        driven="top",
        displacement=motion.displacement,
        shear_angle=motion.shear_angle,
    )


def sheared(shear_angle: float, bend: float = 0.0) -> tuple[Turn, Turn]:
    """Both families turn by half of the shear angle, and bend along the way.

    Parameters
    ----------
    shear_angle
        Shear angle in radians at the origin, at the end.
    bend
        Angle in radians by which a fibre of length `SIDE` bends in the end.
    """

    def warp(s: ndarray, t: float) -> ndarray:
        return t * (shear_angle / 2 - bend * s / SIDE)

    def weft(s: ndarray, t: float) -> ndarray:
        return -t * (shear_angle / 2 - bend * s / SIDE)

    return warp, weft


class Motion:
    """x = f(X₁) + g(X₂), from the inclinations of the fibres and how they turn.

    Parameters
    ----------
    inclinations
        Of warp and weft in radians.
    turns
        How warp and weft turn.
    kinks
        Coordinates along warp and weft at which they turn in a jump, ascending.

    Raises
    ------
    ValueError
        If warp and weft are parallel.
    """

    def __init__(
        self,
        inclinations: tuple[float, float],
        turns: tuple[Turn, Turn],
        kinks: tuple[Sequence[float], Sequence[float]] = ((), ()),
    ) -> None:
        self._families = tuple(zip(inclinations, turns, kinks, strict=True))
        angle = inclinations[1] - inclinations[0]
        self._crossing = np.arctan2(np.sin(angle), np.cos(angle))
        if not abs(np.sin(self._crossing)) > 1e-6:
            raise ValueError("warp and weft are parallel: they must cross at an angle")
        directions = np.array([np.cos(inclinations), np.sin(inclinations)])
        self._coordinates = np.linalg.inv(directions)

    def displacement(self, X: ndarray, t: float) -> ndarray:
        """Displacement x − X."""
        along = zip(self._families, self._coordinates @ X, strict=True)
        return sum(_curve(*family, s, t) for family, s in along) - X

    def shear_angle(self, X: ndarray, t: float) -> ndarray:
        """The turn of the warp less that of the weft."""
        s1, s2 = self._coordinates @ X
        (_, turn1, _), (_, turn2, _) = self._families
        return turn1(s1, t) - turn2(s2, t)

    def check(self, X: ndarray) -> None:
        """Refuse fibres that fold onto one another on the way."""
        for t in np.linspace(0.0, 1.0, 11):
            shear = self.shear_angle(X, t)
            angle = np.sign(self._crossing) * (self._crossing - shear)
            if not np.all((angle > 0) & (angle < np.pi)):
                worst = np.degrees(shear[np.abs(angle - np.pi / 2).argmax()])
                raise ValueError(
                    "warp and weft would fold onto one another: they cross at "
                    f"{np.degrees(self._crossing):.6g} degrees and shear by "
                    f"{worst:.6g} at load factor {t:.1f}"
                )


def _curve(
    inclination: float, turn: Turn, kinks: Sequence[float], s: ndarray, t: float
) -> ndarray:
    """∫₀ˢ (cos, sin)(inclination + turn) ds, shape (2, n), piece by piece."""
    x = np.zeros((2, *s.shape))
    ends = (-np.inf, *kinks, np.inf)
    for low, high in pairwise(ends):
        start, end = np.clip(0.0, low, high), np.clip(s, low, high)
        half = 0.5 * (end - start)
        angle = inclination + turn(start + half[:, None] * (1 + _XI), t)
        x += half * (np.stack([np.cos(angle), np.sin(angle)]) @ _WEIGHTS)
    return x


def _straight(s: ndarray, t: float) -> ndarray:
    return np.zeros(s.shape)
