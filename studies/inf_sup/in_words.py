"""Results of the study of the inf-sup constant that its page gives in prose."""

from collections.abc import Sequence

import numpy as np

from ..study import Row
from .cases import (
    CHECKED_ACROSS,
    IRREGULAR,
    LAYOUTS,
    MACRO,
    MACRO_TRIANGLES,
    METHODS,
    ONE_POINT_TRIANGLES,
    QUADRATIC,
    QUADRATIC_MEAN,
    REFINED,
    SHEARED,
    TWO_BY_TWO,
    Layout,
)
from .tables import COUNTED_ACROSS, of

#: The methods whose law takes a mean.
MEANS = QUADRATIC_MEAN, MACRO, MACRO_TRIANGLES


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results by name; needs the rows of all cases."""
    meshes = [[*of(rows, m, layout).values()] for m in MEANS for layout in LAYOUTS]
    finest = [found[-1] for found in meshes]
    regular = [found for found in meshes if found[0]["layout"] != IRREGULAR.name]
    along = [row["inf_sup"] for row in of(rows, TWO_BY_TWO, Layout(0)).values()]
    erratic = [
        f"{row['inf_sup']:.2g}"
        for row in of(rows, ONE_POINT_TRIANGLES, IRREGULAR).values()
    ]
    twice, thrice = (
        [
            of(rows, method, Layout(30), refined=n)[CHECKED_ACROSS]["inf_sup"]
            for method in METHODS
        ]
        for n in (REFINED, REFINED + 1)
    )
    smaller = [
        100 * (1 - fine / coarse) for coarse, fine in zip(twice, thrice, strict=True)
    ]
    falls = [1 - found[-1]["inf_sup"] / found[-2]["inf_sup"] for found in regular]
    sine = np.sin(np.radians(SHEARED))
    return {
        "means": _range([row["inf_sup"] for row in finest], ".2f"),
        "means_fall": f"{100 * max(falls):.1f} %",
        "means_distance": f"{100 * (max(map(_from_best, finest)) - 1):.0f} %",
        "along": _range(along, ".2f"),
        "erratic": f"{', '.join(erratic[:-1])} and {erratic[-1]}",
        "finer_norm": f"{_range(smaller, '.1f')} %",
        "sheared_most": f"{np.sqrt((1 + sine) / (1 - sine)):.1f}",
        "kernel_along": str(of(rows, TWO_BY_TWO, Layout(0))[COUNTED_ACROSS]["kernel"]),
        "kernel_quadratic": str(
            of(rows, QUADRATIC, Layout(45))[COUNTED_ACROSS]["kernel"]
        ),
    }


def _from_best(row: Row) -> float:
    """The larger distance of the kernel from a motion over that of the mesh."""
    kinds = "smooth", "kinked"
    return max(row[f"{kind}_from_kernel"] / row[f"{kind}_from_mesh"] for kind in kinds)


def _range(values: Sequence[float], form: str) -> str:
    """The smallest and the largest value, or the one that both are.

    Examples
    --------
    >>> _range([0.873, 0.791], ".2f"), _range([0.936, 0.938], ".2f")
    ('0.79 to 0.87', '0.94')
    """
    ends = dict.fromkeys(format(end(values), form) for end in (min, max))
    return " to ".join(ends)
