"""Outlines of tools in the plane."""

import numpy as np
from numpy import ndarray


def inside(corners: ndarray, x: ndarray) -> ndarray:
    """True for points inside a polygon, by the number of edges to their right.

    An edge that the polygon follows in both directions has no effect.

    Parameters
    ----------
    corners
        Corners of the polygon in order, shape (2, n_corners).
    x
        Points, shape (2, n).
    """
    ends = np.array([corners, np.roll(corners, -1, axis=1)])
    order = np.argsort(ends[:, 1], axis=0)  # the same rounding in both directions
    begin, end = np.take_along_axis(ends, order[:, None], axis=0)[..., None]
    crosses = (begin[1] > x[1]) != (end[1] > x[1])
    rise = np.where(crosses, end[1] - begin[1], 1.0)
    at = begin[0] + (x[1] - begin[1]) / rise * (end[0] - begin[0])
    return (crosses & (x[0] < at)).sum(axis=0) % 2 == 1


def nearest(corners: ndarray, x: ndarray) -> ndarray:
    """Nearest points on the edges of a polygon, shape (2, n); arguments as `inside`."""
    begin = corners[:, :, None]
    along = np.roll(corners, -1, axis=1)[:, :, None] - begin
    squared = np.maximum((along**2).sum(axis=0), np.finfo(float).tiny)
    share = ((x[:, None] - begin) * along).sum(axis=0) / squared
    feet = begin + np.clip(share, 0.0, 1.0) * along
    distance = ((feet - x[:, None]) ** 2).sum(axis=0)
    return feet[:, distance.argmin(axis=0), np.arange(x.shape[1])]
