"""Rows that deviate from a smooth curve through their neighbours."""

import numpy as np
import scipy  # whose modules are imported on first use
from numpy import ndarray

#: Minimum number of rows; with fewer, noise is not distinguishable from the curve.
FEWEST = 12

# Probability that a curve with normal noise has a row that is taken for an outlier.
_FALSE = 1e-3

# Smallest deviation of an outlier relative to the range of the curve.  Chosen: below
# it, a row changes a law by less than its usual band.
_LEAST = 0.01

# Smallest deviation of a wild reading relative to the median, where others agree by
# rounding.  Chosen: far above the scatter of strips of a fabric.
_LEAST_OF_REPEATS = 0.5

# Rows per interval of the smooth curve, and the maximum number of intervals.  Chosen:
# curves of fabrics have at most one inflection and one kink.
_PER_INTERVAL, _MOST_INTERVALS = 10, 8

# Number of neighbours whose median is the systematic part of a deviation, and number
# of rows of a local noise level.
_NEIGHBOURS, _LOCAL = 9, 21

# Steps between neighbouring rows by which a running median may be behind: two, and
# their curvature.
_STEPS = 3.0

# Efficiency of the median absolute deviation for normal noise: its degrees of freedom
# per row.
_EFFICIENCY = 0.37

#: Rows of a running median that follows kinks and steps of a curve, but not spikes of
#: one or two rows.
CLOSE = 5

# Maximum number of rounds of fitting without the outliers found; two are usual.
_ROUNDS = 5

# Ratio of a few largest forces to all others, and their largest share of the rows, from
# which they are readings of an overload.  Chosen: no curve of a fabric falls this much.
_FAR, _FEW = 10.0, 0.1

# Ratio of the standard deviation to the median absolute deviation, normal noise.
NORMAL = 1.482602218505602


def outliers(x: ndarray, y: ndarray) -> ndarray:
    """Mask of the rows of a curve y(x) that deviate from it beyond its noise.

    A cubic spline is fitted with a robust loss (`scipy.optimize.least_squares` with
    ``soft_l1``, scaled by the noise of the data), and again without the outliers found.
    The deviation of a row is that from the spline less the median of its neighbours, so
    that a misfit of the spline does not count.  It is an outlier beyond the quantile
    of Student's t that normal noise exceeds in one of a thousand curves, unless it
    continues the rows next to it, as at a kink.

    Parameters
    ----------
    x, y
        Values of one loading or unloading, shape (n,).

    Returns
    -------
    ndarray
        Mask of shape (n,).
    """
    n = x.size
    found = np.zeros(n, dtype=bool)
    if n < FEWEST or not np.ptp(x) > 0:
        return found
    order = np.argsort(x, kind="stable")
    z, v = (x[order] - x[order[0]]) / np.ptp(x), y[order]
    size = float(np.ptp(np.quantile(v, [0.02, 0.98]))) or float(np.ptp(v))
    if not size > 0:
        return found
    basis = _splines(z)
    freedom = _EFFICIENCY * (n - basis.shape[1])
    limit = scipy.special.stdtrit(freedom, 1 - 0.5 * _FALSE / n)
    jumps = departures(v) > _LEAST * size
    flagged = np.zeros(n, dtype=bool)
    for _ in range(_ROUNDS):
        deviation = v - basis @ _robust(basis, v / size, ~flagged) * size
        deviation -= running_median(deviation, _NEIGHBOURS)
        noise = NORMAL * float(np.median(np.abs(deviation[~flagged])))
        local = NORMAL * running_median(np.abs(deviation), _LOCAL)
        scale = np.maximum(noise, local)
        now = jumps & (np.abs(deviation) > np.maximum(limit * scale, _LEAST * size))
        if np.array_equal(now, flagged):
            break
        flagged = now
    found[order] = flagged
    return found


def overloads(y: ndarray) -> ndarray:
    """Mask of a few rows whose magnitude is far above all other rows.

    `outliers` does not find them in a curve of few rows, or if several follow one
    another.  The end of a curve that rises to them is not an overload.

    Parameters
    ----------
    y
        Values in the order of the driving quantity, shape (n,).
    """
    size = np.abs(y)
    highest = np.sort(size)[-max(1, round(_FEW * y.size)) - 1 :]
    gaps = np.flatnonzero(highest[1:] > _FAR * highest[:-1])
    far = size > highest[gaps[0]] if gaps.size else np.zeros(y.size, dtype=bool)
    at_the_end = far[np.argmax(far) :].all()
    return np.zeros(y.size, dtype=bool) if at_the_end else far


def wild(values: ndarray) -> ndarray:
    """Mask of repeated readings that deviate from their median beyond their noise.

    The limit is the quantile of `outliers`, for the noise of the readings.

    Parameters
    ----------
    values
        Readings of one quantity, shape (n,).
    """
    middle = float(np.median(values))
    off = np.abs(values - middle)
    limit = scipy.special.stdtrit(
        _EFFICIENCY * values.size, 1 - 0.5 * _FALSE / values.size
    )
    noise = NORMAL * float(np.median(off))
    return off > max(limit * noise, _LEAST_OF_REPEATS * abs(middle))


def running_median(values: ndarray, window: int = CLOSE) -> ndarray:
    """Median of the values in a window around each one, mirrored at the ends."""
    half = min(window // 2, values.size - 1)
    padded = np.pad(values, half, mode="reflect")
    return np.median(
        np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=-1
    )


def departures(values: ndarray) -> ndarray:
    """Distance of each value from its running median; 0 within a few steps of it.

    Next to a kink, a jump or an end, the median of a smooth curve is a step behind.
    """
    step = running_median(np.abs(np.gradient(values)), 2 * CLOSE + 1)
    off = np.abs(values - running_median(values))
    return np.where(off > _STEPS * step, off, 0.0)


def _splines(z: ndarray) -> ndarray:
    """Values of cubic B-splines at points between 0 and 1, shape (n, coefficients)."""
    intervals = int(np.clip(z.size // _PER_INTERVAL, 1, _MOST_INTERVALS))
    inside = np.quantile(z, np.linspace(0.0, 1.0, intervals + 1)[1:-1])
    knots = np.concatenate([np.zeros(4), np.unique(inside), np.ones(4)])
    return scipy.interpolate.BSpline.design_matrix(np.clip(z, 0, 1), knots, 3).toarray()


def _robust(basis: ndarray, v: ndarray, kept: ndarray) -> ndarray:
    """Coefficients by the loss ``soft_l1``, from the running median."""
    A, b = basis[kept], v[kept]
    start = np.linalg.lstsq(A, running_median(b, _NEIGHBOURS))[0]
    noise = NORMAL * float(np.median(np.abs(A @ start - b)))
    if not noise > 0:
        return start
    found = scipy.optimize.least_squares(
        lambda c: A @ c - b, start, lambda c: A, loss="soft_l1", f_scale=noise
    )
    return np.asarray(found.x)
