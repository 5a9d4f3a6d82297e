"""Columns that contain only noise."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

# Fewest rows: with fewer, noise may follow a curve.
_FEWEST = 12

# Degree of the smooth curve of a trend, such as loading and unloading; and number of
# classes in which a force is compared with its scatter.
_DEGREE, _CLASSES = 3, 10

# Share of a variance above which a trend exceeds the scatter.
_HALF = 0.5


def _without_spikes(values: ndarray) -> ndarray:
    """Values with their outliers moved to the 5 % and 95 % quantiles."""
    return np.clip(values, *np.quantile(values, [0.05, 0.95]))


def explained_by_order(values: ndarray) -> float:
    """Share of the variance that a cubic trend over the rows explains."""
    rows = np.linspace(-1.0, 1.0, values.size)
    trend = np.polynomial.Polynomial.fit(rows, values, _DEGREE)
    return _share(values, trend(rows))


def explained(values: ndarray, by: ndarray) -> float:
    """Share of the variance that means in classes of another column explain."""
    rank = np.searchsorted(np.sort(by), by)
    of_class = _CLASSES * rank // by.size
    counts = np.bincount(of_class)
    means = np.bincount(of_class, values) / np.maximum(counts, 1)
    return _share(values, means[of_class])


def is_no_motion(moved: ndarray, forces: Sequence[ndarray]) -> bool:
    """True if a column is noise: no trend over the rows, and no force depends on it.

    Parameters
    ----------
    moved
        The column, shape (n,).
    forces
        Forces in the same rows.
    """
    known = np.all(np.isfinite([moved, *forces]), axis=0)
    if known.sum() < _FEWEST:
        return False
    x, *of_forces = (_without_spikes(each[known]) for each in (moved, *forces))
    if explained_by_order(x) >= _HALF:
        return False
    return all(explained(force, x) < _HALF for force in of_forces)


def is_noise(force: ndarray, moved: ndarray) -> bool:
    """True if a force neither depends on the motion nor on its previous values.

    The mean square of the differences of successive values is twice the variance of
    independent ones (von Neumann 1941, Ann. Math. Statist. 12:367).
    """
    known = np.isfinite(force) & np.isfinite(moved)
    if known.sum() < _FEWEST:
        return False
    f, x = (_without_spikes(each[known]) for each in (force, moved))
    independent = np.mean(np.diff(f) ** 2) > 2 * _HALF * f.var() > 0
    return bool(independent and explained(f, x) < _HALF)


def _share(values: ndarray, smooth: ndarray) -> float:
    """Share of the variance of values that a smooth curve explains."""
    total = float(np.sum((values - values.mean()) ** 2))
    return 1 - float(np.sum((values - smooth) ** 2)) / total if total else 0.0
