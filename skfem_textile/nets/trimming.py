"""Part of a net inside a trimming curve and outside of holes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.requirements import require
from .crossings import Net
from .flat_pattern import FlatPattern, flat_pattern
from .sheet import Sheet


@dataclass(frozen=True, eq=False)
class TrimmedNet:
    """Net with its flat pattern, and the share of each cell inside it.

    Attributes
    ----------
    net
        The whole net.
    pattern
        Outlines in the flat ply.
    shares
        Share of the area of each cell inside the outline and outside the holes, shape
        (n_warp, n_weft); 0 for cells that were not laid.
    """

    net: Net
    pattern: FlatPattern
    shares: ndarray

    @property
    def area(self) -> float:
        """Area on the tool in mm²."""
        inside = self.shares > 0
        return float((self.net.areas()[inside] * self.shares[inside]).sum())

    def shear_angle(self) -> ndarray:
        """Shear angle of the cells inside in radians, NaN outside."""
        return np.where(self.shares > 0, self.net.shear_angle(), np.nan)


def trimmed(
    net: Net,
    curve: ArrayLike,
    holes: Sequence[ArrayLike] = (),
    spacing: float | None = None,
) -> TrimmedNet:
    """Trim a net along curves on the tool.

    Parameters
    ----------
    net
        The net, which covers the curves.
    curve, holes, spacing
        See `flat_pattern`.

    Raises
    ------
    ValueError
        See `flat_pattern`.
    """
    require("a trimmed net", "outlines", "shapely")
    pattern = flat_pattern(Sheet.of_net(net), curve, spacing, holes)
    return TrimmedNet(net, pattern, shares_inside(net, pattern))


def shares_inside(net: Net, pattern: FlatPattern) -> ndarray:
    """Share of the area of each cell inside a pattern, shape (n_warp, n_weft)."""
    import shapely

    region = shapely.Polygon(
        pattern.outline.T, [hole.outline.T for hole in pattern.holes]
    )
    s, t = np.meshgrid(*net.along, indexing="ij")
    flat = np.einsum("ij,jab->iab", net.directions, np.array([s, t]))
    flat += net.touch[:, None, None]
    corners = flat[:, :-1, :-1], flat[:, 1:, :-1], flat[:, 1:, 1:], flat[:, :-1, 1:]
    cells = shapely.polygons(np.stack(corners).transpose(2, 3, 0, 1)[net.cells])
    shapely.prepare(region)
    inside = shapely.contains(region, cells).astype(float)
    cut = shapely.intersects(region, cells) & (inside == 0)
    parts = shapely.area(shapely.intersection(region, cells[cut]))
    inside[cut] = parts / shapely.area(cells[cut])
    shares = np.zeros(net.cells.shape)
    shares[net.cells] = inside
    return shares
