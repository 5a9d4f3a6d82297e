"""Random laws of further specimens of a fabric, from the laws of single specimens.

Stiffnesses and moments are positive: their logarithms are assumed to be normally
distributed.  From m specimens, a further one has a multivariate t-distribution with
m − 1 degrees of freedom about their mean, with their covariance times 1 + 1/m (Geisser
1993, Predictive Inference).  Its law is a product of powers of the laws of the
specimens.  The largest principal component follows a low-discrepancy sequence, so that
few samples fill the band evenly.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy import ndarray

from .fabric import Fabric
from .files import law_of_json, law_to_json
from .laws.polynomial import Polynomial
from .laws.tabulated import Tabulated
from .origin import Origin, SpecimenLaw, with_laws

#: Smallest number of specimens whose scatter is estimated.
FEWEST = 3

# Spacing and smallest end of the table of a polynomial, in radians.  Chosen: the table
# follows a polynomial of degree 5 to 1e-3, and contains the angles of intermediate
# states of usual parts.
_SPACING, _END = float(np.radians(1.0)), float(np.radians(80.0))

# Smallest slope of a sample, relative to its secant.  Chosen: without effect on loads,
# and far above rounding.
_LEAST_SLOPE = 1e-3

# Largest number of draws of one sample; a draw is repeated if its law is not valid.
_MOST_DRAWS = 100


def sampled_laws(origin: Origin | None, n: int, seed: int = 1) -> list[dict[str, Any]]:
    """Laws of n further specimens by part, independent of each other.

    Parts with fewer than three specimens are missing.  The first laws of a larger n
    are the same.

    Parameters
    ----------
    origin
        Origin of the fabric with laws of specimens; None is refused.
    n
        Number of samples.
    seed
        Seed of the random numbers.

    Raises
    ------
    ValueError
        If no part has three specimens, a law of a specimen is not positive, or n is
        not positive.
    """
    if n < 1:
        raise ValueError(f"the number of samples must be at least 1, got {n}")
    specimens = {} if origin is None else origin.specimens
    parts = {k: one for k, one in specimens.items() if len(one) >= FEWEST}
    if not parts:
        most = max(map(len, specimens.values()), default=0)
        raise ValueError(
            f"the scatter between specimens requires the laws of {FEWEST} specimens, "
            f"but the fabric contains {most or 'none'}: use a fabric of the catalogue "
            f"that contains them, or fit {FEWEST} specimens"
        )
    assert origin is not None
    levels = _levels(n, len(parts), seed)
    drawn = [
        _drawn(part, laws, origin.ranges.get(part, _END), levels[:, i], (seed, i))
        for i, (part, laws) in enumerate(parts.items())
    ]
    return [dict(zip(parts, laws, strict=True)) for laws in zip(*drawn, strict=True)]


def sampled(
    fabric: Fabric, origin: Origin | None, n: int, seed: int = 1
) -> list[Fabric]:
    """Fabrics with the laws of n further specimens, see `sampled_laws`."""
    return [with_laws(fabric, laws) for laws in sampled_laws(origin, n, seed)]


def band_of_law(
    specimens: Iterable[SpecimenLaw], x: ndarray, confidence: float
) -> ndarray | None:
    """Band of the law of a further specimen at arguments x > 0, shape (2, n).

    Geometric mean of the specimens times or divided by exp(t s √(1 + 1/m)), with the
    standard deviation s of the logarithms of m specimens.

    Parameters
    ----------
    specimens
        Laws of single specimens.
    x
        Arguments, shape (n,).
    confidence
        Probability that the band at one argument contains the law.

    Returns
    -------
    ndarray or None
        None for fewer than three specimens, or if a value is not positive.
    """
    values = np.array([one.law.value(x) for one in specimens])
    if len(values) < FEWEST or not np.all(values > 0):
        return None
    return np.exp(band_of_further(np.log(values), confidence))


def band_of_further(values: ndarray, confidence: float) -> ndarray:
    """Band of a further draw from a normal distribution, shape (2, n).

    Mean ± t s √(1 + 1/m) of m draws with the standard deviation s.

    Parameters
    ----------
    values
        The draws, shape (m, n).
    confidence
        Probability that the band contains a further one.
    """
    from scipy.special import stdtrit

    m = len(values)
    half = stdtrit(m - 1, 0.5 + 0.5 * confidence) * values.std(axis=0, ddof=1)
    half *= np.sqrt(1 + 1 / m)
    return np.asarray(values.mean(axis=0) + np.array([-half, half]))


def _levels(n: int, dimension: int, seed: int) -> ndarray:
    """Additive low-discrepancy sequence in the unit cube, shape (n, dimension).

    Multiples of the powers of 1/g, where g > 1 solves g^(d + 1) = g + 1, with a random
    shift.
    """
    g = 2.0
    for _ in range(64):  # a contraction
        g = (1 + g) ** (1 / (dimension + 1))
    shift = np.random.default_rng(seed).random(dimension)
    return (shift + np.outer(np.arange(n), g ** -np.arange(1.0, dimension + 1))) % 1


def _drawn(
    part: str,
    specimens: Sequence[SpecimenLaw],
    end: float,
    levels: ndarray,
    seed: Sequence[int],
) -> list[Any]:
    """Laws of further specimens, whose first component has the given levels."""
    from scipy.special import stdtrit

    laws = _tabulated(part, specimens, end)
    template = law_to_json(laws[0])
    every = np.array([_numbers(law_to_json(law)) for law in laws])
    varied = np.ptp(every, axis=0) > 0
    if not varied.any():
        return [laws[0]] * levels.size
    for one, row in zip(specimens, every[:, varied], strict=True):
        if not np.all(row > 0):
            raise ValueError(
                f"the {part} law of the specimen {one.name} has parameters that are "
                "not positive, so that samples cannot be drawn: fit a law with "
                "positive parameters, such as locking"
            )
    logs, m = np.log(every[:, varied]), len(laws)
    middle = logs.mean(axis=0)
    _, size, axes = np.linalg.svd(logs - middle, full_matrices=False)
    axes = np.where(axes.sum(axis=1) < 0, -1.0, 1.0)[:, None] * axes
    axes = (size * np.sqrt((1 + 1 / m) / (m - 1)))[: m - 1, None] * axes[: m - 1]

    def law_of(t: ndarray) -> Any:
        numbers = every[0].copy()
        numbers[varied] = np.exp(middle + t @ axes)
        law = law_of_json(_with_numbers(template, iter(numbers.tolist())))
        return _rising(law) if isinstance(law, Tabulated) else law

    first = stdtrit(m - 1, levels)
    return [
        _valid(part, law_of, t, axes.shape[0], m, np.random.default_rng((*seed, j)))
        for j, t in enumerate(first.tolist())
    ]


def _valid(
    part: str,
    law_of: Callable[[ndarray], Any],
    first: float,
    n: int,
    m: int,
    rng: np.random.Generator,
) -> Any:
    """Law with a given first component, its others drawn until it is valid."""
    for _ in range(_MOST_DRAWS):
        scale = np.sqrt((m - 1 + first**2) / rng.chisquare(m))
        others = scale * rng.standard_normal(n - 1)
        try:
            return law_of(np.array([first, *others]))
        except ValueError:
            continue
    raise ValueError(
        f"no valid {part} law follows from the scatter of {m} specimens: their laws "
        "differ too much"
    )


def _rising(law: Tabulated) -> Tabulated:
    """A table whose values are raised where they would decrease."""
    x, y = np.array(law.arguments), np.array(law.values)
    with np.errstate(invalid="ignore"):  # of 0/0 at rest
        rise = _LEAST_SLOPE * np.nan_to_num(y / x)[1:] * np.diff(x)
    rise = np.append(0.0, np.cumsum(np.abs(rise)))
    return replace(law, values=tuple(np.maximum.accumulate(y - rise) + rise))


def _tabulated(part: str, specimens: Iterable[SpecimenLaw], end: float) -> list[Any]:
    """Laws of specimens, polynomials as tables at the same points."""
    laws = [one.law for one in specimens]
    if any(type(law) is not type(laws[0]) for law in laws):
        kinds = ", ".join(dict.fromkeys(type(law).__name__ for law in laws))
        raise ValueError(f"the specimens have different {part} laws: {kinds}")
    if not isinstance(laws[0], Polynomial):
        return laws
    x = np.arange(1, np.ceil(max(end, _END) / _SPACING - 1e-9) + 1) * _SPACING
    rises = [np.minimum.accumulate(law.tangent(x) > 0) for law in laws]
    within = np.all(rises, axis=0) | (x <= end)
    x = np.append(0.0, x[within])
    return [Tabulated(x, law.value(x), "linear", odd=True) for law in laws]


def _numbers(content: Any) -> list[float]:
    """Numbers of a law as JSON content, in their order."""
    if isinstance(content, Mapping):
        return [x for value in content.values() for x in _numbers(value)]
    if isinstance(content, list):
        return [x for value in content for x in _numbers(value)]
    return [float(content)] if isinstance(content, float) else []


def _with_numbers(content: Any, numbers: Any) -> Any:
    """JSON content of a law with other numbers."""
    if isinstance(content, Mapping):
        return {key: _with_numbers(value, numbers) for key, value in content.items()}
    if isinstance(content, list):
        return [_with_numbers(value, numbers) for value in content]
    return next(numbers) if isinstance(content, float) else content
