"""Scene `trellis`: prescribed motion without fibre strain.

Every planar motion without fibre strain is x = f(X₁) + g(X₂) with ‖f′‖ = ‖g′‖ = 1,
where X = X₁ A₁ + X₂ A₂ are coordinates along warp and weft: a trellis of bars.  The
angles through which f′ and g′ turn away from A₁ and A₂ describe the motion here.  The
boundary follows it; sides may be free or on inclined rollers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from numbers import Real

import numpy as np
from numpy import ndarray
from numpy.polynomial.legendre import leggauss
from skfem import Mesh

from ..declarations import scenes as declared
from ..declarations.scenes import Edge, Turn
from ..mesh.scikit_fem import with_names
from ..mesh.user_input import errors_in, refuse_unknown
from ..solve.conditions import Condition
from .rectangle import given_or_rectangle, require_edges
from .scene import Scene, with_parameters
from .shear_test import FrameTest

#: Side of the ply in mm.
SIDE = 100.0

#: Sides; the first that is not free is the driven edge.
SIDES = ("top", "right", "bottom", "left")

_XI, _WEIGHTS = leggauss(24)


@with_parameters(declared.Trellis)
def trellis(given: declared.Trellis) -> Scene:
    """Ply whose boundary follows a motion without fibre strain.

    Without shear stiffness the motion requires no force, whichever sides are free. With
    shear stiffness it is the solution only if every side is held and the fibres stay
    straight, because the shear moment moves free sides and rollers.

    Parameters
    ----------
    mesh
        A mesh, or the kind of `rectangle` to generate, a square of side `SIDE`. A mesh
        may have any outline and holes, whose edges also follow the motion.
    size, jitter, seed
        As for `rectangle`.
    warp, weft
        Inclination of the fibres in radians.
    turns
        Rotations of warp and weft; by default `sheared` by 45° and bent by 30°.
    edges
        Supports of the sides ``left``, ``bottom``, ``right`` and ``top``: ``"free"``,
        or the inclination in radians of the line along which a roller rolls.  On a
        roller only the displacement across that line follows the motion.  Other sides,
        and boundary edges on no side, are held, and so are their corners.  The driven
        edge is the first of top, right, bottom and left that is not free.

    Raises
    ------
    ValueError
        If the mesh is not valid, the fibres are parallel or would fold onto each other;
        if a side or its support is unknown, or no side is held.

    Examples
    --------
    >>> scene = trellis(edges={"right": "free", "left": np.radians(60)})
    >>> list(scene.conditions), scene.driven
    (['held', 'left', 'top'], 'top')
    """
    warp, weft, edges = given.warp, given.weft, given.edges or {}
    mesh = given_or_rectangle(given, SIDE, SIDE, warp, weft)
    require_edges("trellis", mesh, ("top",))
    motion = Motion((warp, weft), given.turns or sheared(np.pi / 4, np.pi / 6))
    motion.check(mesh.p)
    mesh = _with_held(mesh, edges)
    conditions, driven = _conditions(mesh, edges, motion)
    return Scene(
        name="trellis",
        mesh=mesh.with_boundaries({"boundary": mesh.boundary_facets()}),
        warp=(float(np.cos(warp)), float(np.sin(warp))),
        weft=(float(np.cos(weft)), float(np.sin(weft))),
        conditions=conditions,
        driven=driven,
        displacement=motion.displacement,
        shear_angle=motion.shear_angle,
    )


def sheared(shear_angle: float, bend: float = 0.0) -> tuple[Turn, Turn]:
    """Rotate both families by half of the shear angle, and bend them.

    Parameters
    ----------
    shear_angle
        Final shear angle at the origin in radians.
    bend
        Final bending angle of a fibre of length `SIDE` in radians.
    """
    half = shear_angle / 2
    return partial(_bent, angle=half, bend=bend), partial(
        _bent, angle=-half, bend=-bend
    )


def _with_held(mesh: Mesh, edges: Mapping[str, Edge]) -> Mesh:
    """Mesh with the boundary ``held``: all edges except free sides and rollers."""
    held = mesh.boundary_facets()
    for side, edge in edges.items():
        with errors_in("trellis: "):
            refuse_unknown("side", side, SIDES)
        is_angle = isinstance(edge, Real) and np.isfinite(edge)
        if edge not in ("held", "free") and not is_angle:
            raise ValueError(
                f"trellis: the {side} side must be 'held', 'free' or the finite "
                f"inclination of a roller in radians, got {edge!r}"
            )
        require_edges("trellis", mesh, (side,))
        if edge != "held":
            held = np.setdiff1d(held, mesh.boundaries[side])
    if held.size == 0:
        raise ValueError("trellis: no side is held: hold at least one")
    return with_names(mesh, {**mesh.boundaries, "held": held}, mesh.subdomains)


def _conditions(
    mesh: Mesh, edges: Mapping[str, Edge], motion: "Motion"
) -> tuple[dict[str, Condition], str]:
    """Conditions by name, and the name of the driven one."""
    conditions = {"held": Condition("held", motion.displacement)}
    conditions |= {
        side: _roller(side, edge, motion)
        for side, edge in edges.items()
        if not isinstance(edge, str)
    }
    carried = (s for s in SIDES if s in mesh.boundaries and edges.get(s) != "free")
    driven = next(carried, "held")
    conditions.setdefault(driven, Condition(driven, motion.displacement))
    return conditions, driven


def _roller(side: str, inclination: float, motion: "Motion") -> Condition:
    """Condition of a roller: displacement across an inclined line is prescribed."""
    normal = np.array([-np.sin(inclination), np.cos(inclination)])
    return Condition(side, partial(_across, normal=normal, motion=motion), normal)


def _across(X: ndarray, t: float, normal: ndarray, motion: "Motion") -> ndarray:
    return normal @ motion.displacement(X, t)


class Motion:
    """Motion x = f(X₁) + g(X₂) by the inclinations of the fibres and their rotations.

    Parameters
    ----------
    inclinations
        Inclinations of warp and weft in radians.
    turns
        Rotations of warp and weft.
    kinks
        Ascending coordinates along warp and weft at which the rotation jumps.

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
            raise ValueError(
                "warp and weft are parallel: give them different directions"
            )
        directions = np.array([np.cos(inclinations), np.sin(inclinations)])
        self._coordinates = np.linalg.inv(directions)

    def displacement(self, X: ndarray, t: float) -> ndarray:
        """Displacement x − X."""
        along = zip(self._families, self._coordinates @ X, strict=True)
        return sum(_curve(*family, s, t) for family, s in along) - X

    def shear_angle(self, X: ndarray, t: float) -> ndarray:
        """Rotation of the warp minus the rotation of the weft."""
        s1, s2 = self._coordinates @ X
        (_, turn1, _), (_, turn2, _) = self._families
        return turn1(s1, t) - turn2(s2, t)

    def check(self, X: ndarray) -> None:
        """Refuse fibres that fold onto each other at some load factor."""
        for t in np.linspace(0.0, 1.0, 11):
            shear = self.shear_angle(X, t)
            angle = np.sign(self._crossing) * (self._crossing - shear)
            if not np.all((angle > 0) & (angle < np.pi)):
                worst = np.degrees(shear[np.abs(angle - np.pi / 2).argmax()])
                raise ValueError(
                    "warp and weft would fold onto each other: they cross at "
                    f"{np.degrees(self._crossing):.6g} degrees and shear by "
                    f"{worst:.6g} degrees at load factor {t:.1f}"
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


@with_parameters(declared.PictureFrame)
def picture_frame(given: declared.PictureFrame) -> Scene:
    """Square ply in a hinged frame with fibres along its sides.

    The bottom bar is fixed and the side bars rotate: at the load factor t the shear
    angle is γ = t·shear_angle everywhere. With sides of length L the force on the top
    bar is L·C(γ)·(cos γ, −sin γ), where C is the shear moment per area; a machine that
    pulls two hinges apart requires F = L²/L_frame·C(γ)/sin(π/4 − γ/2).  The nodes at
    the ends of the top bar also carry half an element of each side bar.  These two
    parts cancel if the elements are equally high.

    Parameters
    ----------
    mesh, size, jitter, seed
        As for `trellis`.
    shear_angle
        Final shear angle in radians.
    side
        Side L of a generated mesh in mm.
    frame
        Side of the frame between its hinges in mm; by default the side of the fabric.

    Raises
    ------
    ValueError
        If the mesh is not valid, the frame would close, or it is smaller than the
        fabric.
    """
    mesh = given_or_rectangle(given, given.side, given.side)
    turns = partial(_bent, angle=0.0), partial(_bent, angle=-given.shear_angle)
    scene = trellis(mesh, turns=turns)
    fabric = float(np.ptp(scene.mesh.p[1]))
    frame = fabric if given.frame is None else given.frame
    test = FrameTest(frame, fabric)
    return replace(scene, name="picture_frame", shear_test=test)


def _bent(s: ndarray, t: float, angle: float, bend: float = 0.0) -> ndarray:
    return t * (angle - bend * s / SIDE)
