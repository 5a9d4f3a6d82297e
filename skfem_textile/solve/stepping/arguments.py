"""What the load stepper does not take."""

from collections.abc import Callable, Collection
from typing import Any

from ..linear import check_solver
from ..verdict import CHECKS

# More equal steps than this are taken for a slip.
_MOST_STEPS = 1_000_000

# A load factor near 1 has 53 binary digits, and 20 of them are for the steps.
_MOST_HALVINGS = 30


def check_arguments(
    ply: Any,
    steps: Any,
    max_halvings: Any,
    warn_only: Any,
    solver: str,
    callbacks: dict[str, Callable | None],
) -> None:
    """Refuse arguments that `LoadStepper` cannot use.

    Parameters
    ----------
    ply, steps, max_halvings, warn_only, solver
        As of `LoadStepper`.
    callbacks
        Functions by the names of their arguments.

    Raises
    ------
    ValueError
        With the name of the argument, and what is wrong with it.
    """
    if isinstance(ply, type) or not hasattr(ply, "stiffness"):
        raise ValueError(f"ply must be a Ply, not {type(ply).__name__}")
    _check_numbers(steps, max_halvings)
    _check_list("checks in warn_only", warn_only, CHECKS)
    for name in warn_only:
        if name not in [*CHECKS]:  # which a list may be asked, that is no name
            known = ", ".join(CHECKS)
            raise ValueError(f"unknown check {name!r}: choose of {known}")
    for name, function in callbacks.items():
        if function is not None and not callable(function):
            raise ValueError(f"{name} must be a function, not {function!r}")
    check_solver(solver)


def _check_numbers(steps: Any, max_halvings: Any) -> None:
    if not _is_whole(steps, 1, _MOST_STEPS):
        raise ValueError(
            "steps must be at least 1, and whole, and no more than "
            f"{_MOST_STEPS}; got {steps!r}"
        )
    if not _is_whole(max_halvings, 0, _MOST_HALVINGS):
        raise ValueError(
            f"max_halvings must be a whole number from 0 to {_MOST_HALVINGS}, got "
            f"{max_halvings!r}"
        )


def _is_whole(number: Any, least: int, most: int) -> bool:
    try:
        return least <= int(number) == number <= most
    except (TypeError, ValueError, OverflowError):
        return False


def _check_list(what: str, given: Any, known: Collection[str]) -> None:
    """Refuse what is no list, above all a bare name, which is one of its letters."""
    if isinstance(given, str) or not isinstance(given, Collection):
        raise ValueError(
            f"{what} must be given as a list, of {', '.join(known)}; got {given!r}"
        )
