"""Comparison of laws in the place of ``auto``."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from .choice import Choice, Test, largest_argument, laws_of_test, models_of
from .measured import FAMILIES
from .residuals import samples_of
from .selection import AUTO, Candidate, best_of, cross_validated, reason_against

#: Laws compared by ``auto`` by name: the law, and the degree of a polynomial.
_SHEAR_CANDIDATES = {
    **{law: (law, 1) for law in ("linear", "sin2", "locking")},
    **{f"polynomial of degree {n}": ("polynomial", n) for n in (3, 5, 7)},
    "tabulated": ("tabulated", 1),
}
_TENSION_CANDIDATES = "linear", "crimp-toe", "tabulated"


def compared(tests: Sequence[Test], choice: Choice) -> dict[str, list[Candidate]]:
    """Laws compared in the place of ``auto``, by part.

    Parameters
    ----------
    tests
        Shear tests with one range, and tests in tension with one slack, for all laws.
    choice
        The choice that contains ``auto``.
    """
    parts = {part for test in tests for part in laws_of_test(test)}
    found: dict[str, list[Candidate]] = {}
    if choice.shear == AUTO and "shear" in parts:
        options = {
            name: replace(choice, shear=law, degree=degree)
            for name, (law, degree) in _SHEAR_CANDIDATES.items()
        }
        found["shear"] = _candidates(tests, options, "shear")
    if choice.tension == AUTO:
        options = {law: replace(choice, tension=law) for law in _TENSION_CANDIDATES}
        for part in FAMILIES:
            if part in parts:
                found[part] = _candidates(tests, options, part)
    return found


def with_best(choice: Choice, candidates: Mapping[str, list[Candidate]]) -> Choice:
    """The choice with the best laws in the place of ``auto``.

    Both families have the tension law that suits the data of both better.
    """
    if "shear" in candidates:
        law, degree = _SHEAR_CANDIDATES[best_of(candidates["shear"]).name]
        choice = replace(choice, shear=law, degree=degree)
    of_each = [candidates[part] for part in FAMILIES if part in candidates]
    if of_each:
        reasons = {x.name: x.reason for each in of_each for x in each if x.reason}
        suiting = [
            [replace(x, reason=reasons.get(x.name, "")) for x in each]
            for each in of_each
        ]
        best = [best_of(each).name for each in suiting]
        choice = replace(choice, tension=max(best, key=_TENSION_CANDIDATES.index))
    return choice


def without(
    candidates: Mapping[str, list[Candidate]],
    chosen: Choice,
    reasons: Mapping[str, str],
) -> dict[str, list[Candidate]]:
    """Candidates with the reasons, by part, why the chosen ones do not suit."""
    law = chosen.shear, chosen.degree
    shear = {name for name, of in _SHEAR_CANDIDATES.items() if of == law}
    found = {}
    for part, each in candidates.items():
        names = shear if part == "shear" else {chosen.tension}
        found[part] = [
            replace(x, error=np.nan, standard_error=np.nan, reason=reasons[part])
            if part in reasons and x.name in names
            else x
            for x in each
        ]
    return found


def _candidates(
    tests: Sequence[Test], options: Mapping[str, Choice], part: str
) -> list[Candidate]:
    """Laws of a part by name, compared by cross-validation."""
    found = []
    for name, choice in options.items():
        own = [test for test in tests if part in laws_of_test(test)]
        model = models_of(own, replace(choice, bounds=None, extrapolation=None))[part]
        samples = [x for x in samples_of(own, choice, {}, ()) if x.part == part]
        largest = largest_argument(own, part, choice.up_to)
        unit = "degrees" if part == "shear" else "strain"
        found.append(
            cross_validated(
                *(name, model, samples),
                partial(reason_against, largest=largest, unit=unit),
            )
        )
    return found
