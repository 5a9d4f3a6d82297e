"""Results of the study of formulations that its page gives in prose."""

from collections.abc import Iterable, Sequence

from ..study import Row
from .cases import (
    ACROSS,
    AUTO,
    BIAS,
    BIAS_SIN2,
    LOCKING,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    QUADRATIC,
    SPLIT_ONE_POINT,
    STRIP,
    TRELLIS,
    Method,
    Specimen,
)
from .medians import median, of, over_angles, over_exact

_FOR_LOAD = {
    "quads": MACRO,
    "triangles": MACRO_TRIANGLES,
    "one_point": AUTO,
    "quadratic_mean": MEAN_QUADRATIC,
}


def in_words(rows: list[Row]) -> dict[str, str]:
    """The results by name; needs the rows of all cases."""
    middle, stiffest = ACROSS[1], BIAS[-1]

    def seeds(problem: Specimen, method: Method, across: int = middle) -> list[Row]:
        return of(rows, "methods", problem, method, across)

    def over(problem: Specimen, method: Method) -> float:
        return median(over_exact(seeds(problem, method), problem), "load")

    def position(problem: Specimen, method: Method) -> float:
        return median(seeds(problem, method), "position")

    smooth = [
        position(p, MACRO) / position(p, MEAN_QUADRATIC) for p in (STRIP, TRELLIS)
    ]
    at_jumps = position(stiffest, MEAN_QUADRATIC) / position(stiffest, MACRO)
    words = {
        "cases": str(len(rows)),
        "refused": str(sum(bool(row["refused"]) for row in rows)),
        "closer_where_smooth": f"{_range(smooth)} times",
        "locked": f"{_range(over(p, m) for p in BIAS for m in LOCKING)} times",
        "quadratic": f"{over(stiffest, QUADRATIC):.2g} times",
        "split_one_point": f"{over(stiffest, SPLIT_ONE_POINT):.2f} times",
        "position_quadratic_mean": f"{at_jumps:.1f} times",
    }
    for name, method in _FOR_LOAD.items():
        for across in ACROSS[1:]:
            furthest = [
                over_angles(seeds(problem, method, across), problem)
                for problem in (*BIAS, *BIAS_SIN2)
            ]
            medians, single = zip(*furthest, strict=True)
            words[f"{name}_{across}"] = _per_cent(medians)
            largest = max(abs(load - 1) for load in single)
            words[f"{name}_{across}_worst"] = f"{100 * largest:.1f} %"
    return words


def _range(values: Iterable[float]) -> str:
    """The smallest and the largest value with two digits.

    Examples
    --------
    >>> _range([1066.2, 2.27])
    '2.3 to 1100'
    """
    every = list(values)
    return " to ".join(f"{float(f'{end(every):.2g}'):g}" for end in (min, max))


def _per_cent(loads: Sequence[float]) -> str:
    """How far loads over the exact ones are from 1, with their signs.

    Examples
    --------
    >>> _per_cent([1.0441, 1.03]), _per_cent([0.977, 0.986])
    ('+3.0 to +4.4 %', '−2.3 to −1.4 %')
    """
    ends = (f"{100 * (end(loads) - 1):+.1f}" for end in (min, max))
    return " to ".join(ends).replace("-", "−") + " %"
