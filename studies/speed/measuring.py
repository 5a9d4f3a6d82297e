"""Settings, a clock, and the strip of any size, for all benchmarks."""

from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

from skfem_textile.scenes import Scene, strip


class Settings(NamedTuple):
    """Settings that a user may choose.

    Parameters
    ----------
    most
        No mesh has more elements.
    solver
        The linear solver of `scaling` and `whole_strip`.
    before, after
        Two checkouts of this project, for `by_turns`.
    """

    most: int = 1_000_000
    solver: str = "auto"
    before: str = ""
    after: str = ""


def seconds(function: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """The result of a function, and the seconds that it took."""
    start = perf_counter()
    result = function(*arguments)
    return result, perf_counter() - start


def strip_of(elements: int, **more: Any) -> Scene:
    """The strip on about this number of elements."""
    across = (elements / 1.5) ** 0.5
    return strip(size=(round(across), round(1.5 * across)), **more)


def spread(times: Sequence[float]) -> dict[str, float]:
    """Median, least and most."""
    return {"median": median(times), "least": min(times), "most": max(times)}
