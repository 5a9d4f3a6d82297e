"""Laws that are not physical, and the choice among laws by cross-validation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric.law import domain_of
from .bands import Fit
from .bending import CantileverTest
from .choice import (
    AUTO,
    Choice,
    Test,
    asks_for_law,
    in_bending,
    largest_argument,
    models_of,
    of_kind,
    tests_of,
)
from .measured import FAMILIES
from .models import Model
from .regression import fit, laws_and_zeros
from .residuals import samples_of
from .solving import Sample, Unknowns

#: Laws compared by ``auto`` by name: the law, and the degree of a polynomial.
_SHEAR_CANDIDATES = {
    **{law: (law, 1) for law in ("linear", "sin2", "locking")},
    **{f"polynomial of degree {n}": ("polynomial", n) for n in (3, 5, 7)},
    "tabulated": ("tabulated", 1),
}
_TENSION_CANDIDATES = "linear", "crimp-toe", "tabulated"

# The same of bending laws; tabulated only for measured moments.
_BENDING_CANDIDATES = {
    **{law: (law, 1) for law in ("linear", "bilinear")},
    **{f"polynomial of degree {n}": ("polynomial", n) for n in (3, 5)},
    "tabulated": ("tabulated", 1),
}

# Those that are compared for cantilevers: a polynomial of softening fibres has a
# maximum, beyond which cantilevers fold.
_OF_CANTILEVERS = "linear", "bilinear"

# Fewest readings of a family among which bending laws are compared: two for each of
# the parameters of the longest law.
_FEWEST = 6

# Parts of the bending laws.
_BENDING_PARTS = tuple(f"bending {family}" for family in FAMILIES)

# Number of folds of a curve: each contains every fifth point.
_FOLDS = 5

# Number of arguments at which a law is checked.
_CHECKED = 201


@dataclass(frozen=True)
class Candidate:
    """A law that was compared.

    Attributes
    ----------
    name
        Name of the law; of a polynomial with its degree.
    parameters
        Number of parameters.
    error
        Root mean square of the cross-validated differences, relative to the largest
        measured value; nan if the law does not suit.
    standard_error
        Standard error of this number, over specimens or folds.
    reason
        Reason why the law does not suit; empty if it does.
    zeros
        Number of kinds of zeros of the machine that are fitted with the law.
    """

    name: str
    parameters: int
    error: float
    standard_error: float
    reason: str = ""
    zeros: int = 0


def reason_against(fit: Fit, largest: float) -> str:
    """Reason why a law of one argument is not physical within the data, or nothing.

    A law that decreases by more than half the width of its band is not physical.

    Parameters
    ----------
    fit
        The fit of the law.
    largest
        Largest argument of the data: an angle in radians, or a strain.
    """
    law, part = fit.law, fit.samples[0].part
    scale, unit = (np.degrees(1.0), "degrees") if part == "shear" else (1.0, "strain")
    if part.startswith("bending"):
        unit = "1/mm"
    end = float(np.max(domain_of(law)[1]))
    pole = fit.model.name == "locking" and bool(fit.values[-1] <= fit.model.low[-1])
    if pole or end < largest * (1 - 1e-9):
        return f"its pole is at the end of the data, {scale * end:.3g} {unit}"
    x = np.linspace(0.0, largest * (1 - 1e-9), _CHECKED)
    value = law.value(x)
    low_band, high_band = fit.band(lambda other: other.value(x))
    fall = np.maximum.accumulate(value) - value
    if not np.any(fall > 0.5 * (high_band - low_band)):
        return ""
    falls = x[law.tangent(x) < 0]
    low, high = scale * falls[0], scale * falls[-1]
    return f"it decreases between {low:.3g} and {high:.3g} {unit}, within the data"


def cross_validated(
    name: str,
    model: Model,
    samples: Sequence[Sample],
    against: Callable[[Fit], str],
) -> Candidate:
    """A law compared by the points that a fit leaves out.

    With several curves each is left out in turn, and its zeros are fitted with the law
    of the others; of a single curve every fifth point is left out.

    Parameters
    ----------
    name
        Name of the law.
    model
        The law.
    samples
        Curves that determine it alone.
    against
        Function that returns the reason why a fit is not physical, or nothing.
    """
    p, part = len(model.parameters), samples[0].part
    try:
        of_all = fit({part: model}, samples).parts[part]
        reason = against(of_all)
        errors = [] if reason else [*_left_out(model, samples, of_all.free)]
    except ValueError as error:
        errors, reason = [], str(error)
    if reason:
        return Candidate(name, p, np.nan, np.nan, reason)
    squares = np.array([np.mean(r**2) for r in errors])
    root = float(np.sqrt(squares.mean()))
    spread = float(squares.std(ddof=1) / np.sqrt(squares.size))
    standard_error = spread / (2 * root) if root else 0.0
    return Candidate(name, p, root, standard_error, zeros=len(of_all.free))


def best_of(candidates: Sequence[Candidate]) -> Candidate:
    """The law with the fewest parameters within one standard error of the best.

    Of several, the one with the fewest zeros of the machine: a force at rest and a
    slack together may turn one law into another.

    Raises
    ------
    ValueError
        If no law suits.
    """
    suiting = [one for one in candidates if not one.reason]
    if not suiting:
        first = candidates[0]
        raise ValueError(
            f"no law suits these data, such as {first.name}: {first.reason}: name a "
            "law, or check the data"
        )
    best = min(suiting, key=lambda one: one.error)
    enough = [x for x in suiting if x.error <= best.error + best.standard_error]
    return min(enough, key=lambda one: (one.parameters, one.zeros, one.error))


def _left_out(
    model: Model, samples: Sequence[Sample], free: frozenset[str]
) -> Iterator[ndarray]:
    """Differences at the points of each fold, relative to the largest value."""
    part = samples[0].part
    most = max(float(np.abs(one.measured).max()) for one in samples)
    if len(samples) > 1:
        for i, one in enumerate(samples):
            others = [*samples[:i], *samples[i + 1 :]]
            laws, _ = laws_and_zeros({part: model}, others, free)
            zeros = Unknowns({}, [one], free, laws)
            x, _ = zeros.solve(np.ones(one.measured.size), zeros.start(np.zeros(0)))
            yield (one.measured - zeros.predict(x)) / most
        return
    (one,) = samples
    for k in range(_FOLDS):
        out = np.arange(one.measured.size) % _FOLDS == k
        kept = [_restricted(one, ~out)]
        laws, (offsets,) = laws_and_zeros({part: model}, kept, free)
        predicted = one.predict(laws, *offsets)
        yield (one.measured - predicted)[out] / most


def _restricted(sample: Sample, kept: ndarray) -> Sample:
    """A curve without some of its points."""

    def predict(laws: Any, *offsets: float) -> ndarray:
        return sample.predict(laws, *offsets)[kept]

    return sample._replace(measured=sample.measured[kept], predict=predict)


def compared(tests: Sequence[Test], choice: Choice) -> dict[str, list[Candidate]]:
    """Laws compared in the place of ``auto``, by part.

    Parameters
    ----------
    tests
        Shear tests with one range, and tests in tension with one slack, for all laws.
    choice
        The choice that contains ``auto``.
    """
    parts = {part for test in tests for part in test.parts}
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


def compared_in_bending(
    tests: Sequence[Test], choice: Choice
) -> dict[str, list[Candidate]]:
    """Bending laws compared in the place of ``auto``, by part, see `Choice.bending`."""
    found = {}
    for part in _BENDING_PARTS if choice.bending == AUTO else ():
        own = in_bending(tests_of(tests, part))
        n = sum(one.curvature.size for one in own)
        if not own or n < _FEWEST or not asks_for_law(own):
            continue
        table = not of_kind(own, CantileverTest)
        options = {
            name: replace(choice, bending=law, bending_degree=degree)
            for name, (law, degree) in _BENDING_CANDIDATES.items()
            if table or law in _OF_CANTILEVERS
        }
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
    bending = {
        part: _BENDING_CANDIDATES[best_of(candidates[part]).name]
        for part in _BENDING_PARTS
        if part in candidates
    }
    return replace(choice, bending=bending) if bending else choice


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
        if part in _BENDING_PARTS:
            bent = chosen.bending_of(part)
            names = {name for name, of in _BENDING_CANDIDATES.items() if of == bent}
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
        own = tests_of(tests, part)
        model = models_of(own, replace(choice, bounds=None, extrapolation=None))[part]
        samples = [x for x in samples_of(own, choice, {}, ()) if x.part == part]
        largest = largest_argument(own, part, choice.up_to)
        against = partial(reason_against, largest=largest)
        found.append(cross_validated(name, model, samples, against))
    return found
