"""Curves of tests, to be drawn beside that of a run."""

import os

import numpy as np
from numpy import ndarray

from ...mesh.user_input import printable

#: Headings of the columns.
DISPLACEMENT, FORCE = "displacement (mm)", "force (N)"
ANGLE, NORMALISED = "angle (deg)", "normalised shear force (N/mm)"

# What heads a column of `read_curve`, and how much its unit is in that of the heading.
_HEADINGS = {
    "displacement": (DISPLACEMENT, 1.0),
    "shear angle": (ANGLE, 180 / np.pi),
    "force": (FORCE, 1.0),
    "normalised shear force": (NORMALISED, 1.0),
}


def read_test_curve(path: str | os.PathLike[str]) -> dict[str, ndarray]:
    """Columns of the curve of a test by their headings.

    The first row names the columns, as for `calibration.curves.read_curve`: at least a
    displacement or an angle, and at least one force.  Cells may be empty.

    Parameters
    ----------
    path
        The file, in UTF-8.

    Returns
    -------
    dict
        For each column that is there its numbers, shape (n,); NaN for empty cells.

    Raises
    ------
    ValueError
        If it is no such file; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    from ...calibration.curves import read_curve  # loads much of scipy

    found = read_curve(path, gaps=True)
    curve = {
        heading: found[name] * factor
        for name, (heading, factor) in _HEADINGS.items()
        if name in found
    }
    if not ({DISPLACEMENT, ANGLE} & set(curve) and {FORCE, NORMALISED} & set(curve)):
        raise ValueError(
            f"{printable(path)}, row 1: the header must name a displacement or an "
            f"angle, and a force, like {', '.join(map(repr, (DISPLACEMENT, FORCE)))}"
        )
    if len(next(iter(curve.values()))) < 2:
        raise ValueError(
            f"{printable(path)}: a curve needs at least two rows of numbers"
        )
    return curve
