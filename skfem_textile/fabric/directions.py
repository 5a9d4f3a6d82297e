"""Fibre directions: per element, along a reference curve, and their validation.

Some programs take the first edge of an element as the first material axis, so that
directions depend on the numbering of its nodes.  On a mesh whose edges have several
directions, such fibre directions vary arbitrarily between elements;
`directions_warning` detects them.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy import ndarray
from numpy.polynomial.chebyshev import chebval2d, chebvander2d
from numpy.typing import ArrayLike
from skfem import Mesh

from ..mesh.splitting import original_elements
from ..mesh.user_input import MOST_DEGREES
from .fabric import Fabric, unit_vectors
from .kinematics import rotated
from .regions import fabric_on


@dataclass(frozen=True, eq=False)
class FibreDirections:
    """Directions of warp and weft in each of the user's elements.

    Parameters
    ----------
    warp, weft
        Vectors of any length, shape (2, n_elements); not normalised.

    Raises
    ------
    ValueError
        If their numbers differ, if one is zero or not finite, or if warp and weft are
        parallel.

    Examples
    --------
    >>> directions = FibreDirections.of_angles([0.0, 10.0], [90.0, 100.0])
    >>> directions.angles_deg()[0].round(12)
    array([ 0., 10.])
    """

    warp: ndarray
    weft: ndarray

    def __post_init__(self) -> None:
        for name in ("warp", "weft"):
            vector = np.array(getattr(self, name), dtype=float)
            if vector.ndim != 2 or len(vector) != 2 or not vector.size:
                raise ValueError(
                    f"{name} must have the shape (2, n_elements), not {vector.shape}"
                )
            object.__setattr__(self, name, vector)
        if self.warp.shape != self.weft.shape:
            raise ValueError(
                f"there are {self.warp.shape[1]} warp directions but "
                f"{self.weft.shape[1]} weft directions; specify both for each element"
            )
        Fabric(warp=self.warp, weft=self.weft)  # refuses invalid vectors

    @classmethod
    def of_angles(cls, warp_deg: ArrayLike, weft_deg: ArrayLike) -> Self:
        """Directions at angles to the x axis in degrees, each of shape (n_elements,).

        Multiples of 90° are exact.
        """
        return cls(at_angles(warp_deg), at_angles(weft_deg))

    def angles_deg(self) -> tuple[ndarray, ndarray]:
        """Angles of warp and weft to the x axis in degrees, in (−180, 180]."""
        pair = self.warp, self.weft
        warp, weft = (np.degrees(np.arctan2(y + 0.0, x)) for x, y in pair)  # no -0.0
        return warp, weft

    def refuse_other(self, cells: Sequence[ndarray]) -> None:
        """Refuse elements, arrays (k, n_k), unless there is one per direction.

        Raises
        ------
        ValueError
            If there is not one direction for each element.
        """
        n_elements, n = sum(cell.shape[1] for cell in cells), self.warp.shape[1]
        if n != n_elements:
            raise ValueError(
                f"there are {n} fibre directions for {n_elements} elements; specify "
                "one per element"
            )

    def on(self, fabric: Fabric) -> Fabric:
        """Fabric with the laws of the given fabric and these directions."""
        return replace(fabric, warp=self.warp, weft=self.weft)


def at_angles(degrees: ArrayLike) -> ndarray:
    """Unit vectors; quarter turns are separated first, so that they are exact."""
    angles = np.asarray(degrees, dtype=float)
    if angles.ndim != 1 or not np.isfinite(angles).all():
        raise ValueError("angles must be finite numbers, one for each element")
    if np.abs(angles).max(initial=0.0) > MOST_DEGREES:
        raise ValueError(f"angles must be within ±{MOST_DEGREES:g}°, a hundred turns")
    turns = np.rint(angles / 90.0)
    rest = np.radians(angles - 90.0 * turns)
    c, s = np.cos(rest), np.sin(rest)
    quarter = (turns % 4).astype(int)
    x = np.choose(quarter, [c, -s, -c, s])
    y = np.choose(quarter, [s, c, -s, -c])
    return np.stack([x, y])


# Maximum array size for distances to all segments: 80 MB.
_AT_A_TIME = 10_000_000


@dataclass(frozen=True, eq=False)
class AlongCurve:
    """Directions at a constant angle to the nearest point of a polyline.

    At a corner of the polyline the tangent is the mean of both sides; of several
    nearest points the first is used.

    Parameters
    ----------
    points
        Corners of the polyline in mm, in order, shape (2, n), n >= 2.
    angle
        Angle in radians from the tangent to the fibres, anticlockwise.

    Raises
    ------
    ValueError
        If there are fewer than two points, one is not finite, two consecutive ones
        coincide, the line turns back on itself, or the angle is not finite.

    Examples
    --------
    >>> from skfem_textile import Fabric
    >>> arc = np.array([[0.0, 10.0, 20.0], [0.0, 0.0, 10.0]])
    >>> fabric = Fabric(warp=AlongCurve(arc), weft=AlongCurve(arc, np.pi / 2))
    >>> fabric.warp(np.array([[5.0], [3.0]])).ravel()
    array([1., 0.])
    """

    points: ArrayLike
    angle: float = 0.0

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or len(points) != 2 or points.shape[1] < 2:
            raise ValueError(
                "the points of a reference curve must have the shape (2, n), n >= 2, "
                f"not {points.shape}"
            )
        if not (np.isfinite(points).all() and np.isfinite(self.angle)):
            raise ValueError("a reference curve and its angle must be finite")
        if not (side := np.diff(points)).any(axis=0).all():
            raise ValueError("consecutive points of a reference curve must be distinct")
        unit = side / np.hypot(*side)
        if not (unit[:, 1:] + unit[:, :-1]).any(axis=0).all():
            raise ValueError("a reference curve must not turn back on itself")
        object.__setattr__(self, "points", points)

    def __call__(self, x: ndarray) -> ndarray:
        """Unit vectors at positions, both of shape (2, ...)."""
        points = np.reshape(x, (2, -1))
        n = max(1, _AT_A_TIME // np.shape(self.points)[1])
        parts = [
            self._tangent(points[:, i : i + n]) for i in range(0, len(points[0]), n)
        ]
        c, s = np.cos(self.angle), np.sin(self.angle)
        turned = np.array([[c, -s], [s, c]]) @ np.hstack(parts)
        return turned.reshape(np.shape(x))

    def _tangent(self, x: ndarray) -> ndarray:
        """Unit tangents at the nearest points, shape (2, n)."""
        points = np.asarray(self.points)
        start, side = points[:, :-1, None], np.diff(points)[:, :, None]
        share = ((x[:, None] - start) * side).sum(axis=0) / (side**2).sum(axis=0)
        share = share.clip(0.0, 1.0)
        distance = ((x[:, None] - start - share * side) ** 2).sum(axis=0)
        nearest = distance.argmin(axis=0)
        share = np.take_along_axis(share, nearest[None], axis=0)[0]
        unit = np.diff(points) / np.hypot(*np.diff(points))
        last = unit.shape[1] - 1
        before = unit[:, np.where(share == 0, nearest - 1, nearest).clip(0)]
        after = unit[:, np.where(share == 1, nearest + 1, nearest).clip(0, last)]
        tangent = before + after
        return tangent / np.hypot(*tangent)


def directions_of(mesh: Mesh, fabric: Fabric) -> FibreDirections:
    """Directions of a fabric at the mean of the corners of each element.

    Parameters
    ----------
    mesh
        The mesh; for a split or cut mesh the user's elements are used.
    fabric
        The fabric, with directions of any kind.

    Raises
    ------
    ValueError
        If the fabric has directions for a different number of elements.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> directions_of(MeshQuad(), Fabric(warp=(1, 1), weft=(-1, 1))).angles_deg()
    (array([45.]), array([135.]))
    """
    cells, _ = original_elements(mesh)
    centres = np.hstack([mesh.p[:, cell].mean(axis=1) for cell in cells])
    every = np.arange(centres.shape[1])
    fabric = fabric_on(every, fabric)
    x = centres[:, :, None]
    families = fabric.families
    vectors = (unit_vectors(f.name, f.direction, x, every[:, None]) for f in families)
    warp, weft = (np.broadcast_to(A, x.shape)[..., 0] for A in vectors)
    return FibreDirections(warp, weft)


# Angle in radians within which a smooth field follows directions per element: a tenth
# of a degree, the last digit of most tables; and the largest degree of its polynomials.
_FOLLOWS, _HIGHEST_DEGREE = 2e-3, 10


@dataclass(frozen=True, eq=False)
class SmoothField:
    """Direction field whose components are polynomials of position.

    Attributes
    ----------
    centre, size
        Middle and half of the sides of the rectangle on which they are given, in mm,
        shape (2,).
    coefficients
        Coefficients of products of Chebyshev polynomials, shape (n, n, 2).
    """

    centre: ndarray
    size: ndarray
    coefficients: ndarray

    def __call__(self, x: ndarray) -> ndarray:
        """Vectors at positions, both of shape (2, ...)."""
        along, across = ((x.T - self.centre) / self.size).T
        field: ndarray = chebval2d(along, across, self.coefficients)
        return field


def with_smooth_fields(mesh: Mesh, fabric: Fabric) -> Fabric:
    """Fabric with functions of position in place of directions per element.

    They are polynomials of the lowest degree that follows the directions, and vectors
    if the directions are constant.

    Raises
    ------
    ValueError
        If there is not one direction for each element, or the directions are not
        smooth.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> mesh = MeshQuad().refined(3).scaled(80.0)
    >>> x, y = mesh.p[:, mesh.t].mean(axis=1)
    >>> rays, arcs = np.stack([x + 50, y + 50]), np.stack([-y - 50, x + 50])
    >>> fabric = with_smooth_fields(mesh, Fabric(warp=arcs, weft=rays))
    >>> bool(np.abs(fabric.warp(np.array([40.0, 20.0])) @ [90, 70]) < 0.1)
    True
    """
    given = [f.name for f in fabric.families if np.shape(f.direction)[1:]]  # type: ignore[arg-type]
    if not given:
        return fabric
    cells, _ = original_elements(mesh)
    x = np.hstack([mesh.p[:, cell].mean(axis=1) for cell in cells])
    of = directions_of(mesh, fabric)
    return replace(
        fabric, **{name: _smooth(name, x, getattr(of, name)) for name in given}
    )


def _smooth(name: str, x: ndarray, directions: ndarray) -> Any:
    """Vector or field that follows unit vectors at points, both of shape (2, n)."""
    low, high = x.min(axis=1), x.max(axis=1)
    centre, size = 0.5 * (low + high), np.maximum(0.5 * (high - low), 1e-300)
    along, across = ((x.T - centre) / size).T
    for degree in range(_HIGHEST_DEGREE + 1):
        i, j = np.nonzero(np.add.outer(range(degree + 1), range(degree + 1)) <= degree)
        if 2 * len(i) > x.shape[1]:
            break
        products = chebvander2d(along, across, [degree, degree])
        products = products.reshape(-1, degree + 1, degree + 1)[:, i, j]
        found = np.linalg.lstsq(products, directions.T)[0]
        follows = (products @ found).T
        off = np.abs(follows[0] * directions[1] - follows[1] * directions[0])
        if (off <= _FOLLOWS * (follows * directions).sum(axis=0)).all():
            if degree == 0:
                return tuple(found[0].tolist())
            coefficients = np.zeros((degree + 1, degree + 1, 2))
            coefficients[i, j] = found
            return SmoothField(centre, size, coefficients)
    raise ValueError(
        f"the {name} directions of the elements do not follow a smooth field within "
        f"{np.degrees(_FOLLOWS):.1g} degrees"
    )


log = logging.getLogger(__name__)

# Angle in radians within which a direction follows an edge.  Chosen: far above the six
# digits of a deck (1e-6 rad), and so small that one element in 1500 meets it by chance.
_ALONG_DEG = 0.05

# Share of the elements whose direction must follow the edge.  Chosen: most.
_SHARE = 0.9

# Spread of the edge directions below which they are uniform, as on a regular mesh,
# where fibres along edges are intended.
_ONE_WAY_DEG = 1.0


def directions_warning(mesh: Mesh, directions: FibreDirections) -> str:
    """Warning if directions seem to depend on the node numbering; empty otherwise.

    It reports a family that is aligned with, or normal to, the same local edge of
    nearly every element while the directions of these edges vary.

    Parameters
    ----------
    mesh
        The mesh; for a split or cut mesh the user's elements are used.
    directions
        Directions in these elements.
    """
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    for name in ("warp", "weft"):
        direction = getattr(directions, name)
        for number, edges in _edges(mesh, cells).items():
            for how, turned in (("along", edges), ("across", rotated(edges))):
                near = _apart_deg(direction, turned) < _ALONG_DEG
                if near.mean() >= _SHARE and _spread_deg(edges) > _ONE_WAY_DEG:
                    return (
                        f"the {name} runs {how} edge {number} in {near.sum()} of "
                        f"{near.size} elements, although the directions of these "
                        "edges vary; the fibre directions seem to depend on the node "
                        "numbering: specify angles, vectors or a reference curve"
                    )
    return ""


def warn_of_directions(mesh: Mesh, directions: FibreDirections) -> None:
    """Log the result of `directions_warning` as a warning, if there is one."""
    if warning := directions_warning(mesh, directions):
        log.warning(warning)


def _edges(mesh: Mesh, cells: tuple[ndarray, ...]) -> dict[int, ndarray]:
    """Edge vectors of all elements, by local edge number from 1 on."""
    least = min(len(cell) for cell in cells)
    return {
        i + 1: np.hstack(
            [
                mesh.p[:, cell[(i + 1) % len(cell)]] - mesh.p[:, cell[i]]
                for cell in cells
            ]
        )
        for i in range(least)
    }


def _apart_deg(u: ndarray, v: ndarray) -> ndarray:
    """Angles in degrees between lines, from 0 to 90."""
    cross, dot = u[0] * v[1] - u[1] * v[0], (u * v).sum(axis=0)
    return np.degrees(np.arctan2(np.abs(cross), np.abs(dot)))


def _spread_deg(edges: ndarray) -> float:
    """Deviation of lines from their mean direction, in degrees."""
    z = edges[0] + 1j * edges[1]
    z = (z / np.abs(z)) ** 2  # independent of the sense of a line
    mean = z.mean()
    if abs(mean) == 0:
        return 90.0
    return float(np.degrees(np.abs(np.angle(z / mean)).max()) / 2)
