"""Cases shared out among processes."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Case = TypeVar("Case")
Found = TypeVar("Found")


def shared_out(
    examined: Callable[[Case], Found], cases: Iterable[Case], workers: int
) -> Iterator[Found]:
    """What is found of each case, in their order.

    Cases that have not begun when the caller stops are dropped.
    """
    pool = ProcessPoolExecutor(workers)
    try:
        yield from pool.map(examined, cases)
    finally:
        pool.shutdown(cancel_futures=True)
