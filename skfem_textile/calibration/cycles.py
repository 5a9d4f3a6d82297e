"""Friction elements of a law from tests with loading and unloading.

The force of a test is linear in the elastic law and in the limits of friction elements
with given onsets: the history of the test determines the force of each for a limit of 1
(`WithFriction`).  The limits follow by bounded least squares (Stark & Parker 1995) with
an elastic law that is linear between knots, one for each test.  Any law is then fitted
to the forces without friction, as to an elastic test.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from scipy.linalg import block_diag

from ..fabric import WithFriction
from .bending import BendingCurve
from .choice import Test, of_kind, tests_of
from .measured import FAMILIES
from .preparing import REVERSAL
from .solving import optimize
from .specimens import Specimen
from .tensile import Strip

#: Tests whose loading and unloading may determine friction.
Cyclic: TypeAlias = Specimen | Strip | BendingCurve

# Laws that may have friction.
_PARTS = ("shear", *FAMILIES, *(f"bending {family}" for family in FAMILIES))

# Onsets: their number, and the smallest one over the largest reversal; the largest one
# is half a reversal, within which an element slips backwards.
_ONSETS, _SMALLEST = 18, 0.005

# Knots of the elastic law that is fitted with the friction.
_KNOTS = 20

# Share of the friction below which an element is left out.
_LEAST = 0.01

# Distance of the logarithm of an onset from its bounds at the start.
_INSIDE = 1e-6

# Squared round-off of measured forces, relative to their squares.
_ROUND_OFF = 1e-18


@dataclass(frozen=True)
class FrictionElements:
    """Friction elements found in tests.

    Attributes
    ----------
    limits, onsets
        See `WithFriction`.
    """

    limits: tuple[float, ...]
    onsets: tuple[float, ...]

    def added_to(self, law: Any) -> WithFriction:
        """A law with these elements."""
        return WithFriction(law, self.limits, self.onsets)

    def force(self, test: Cyclic) -> ndarray:
        """Part of the force or moment of a test that friction carries, shape (n,).

        NaN where the argument of the law is.
        """
        return np.asarray(self.limits) @ _of_elements(test, self.onsets)


def friction_of(
    tests: Sequence[Test], up_to: float | None
) -> dict[str, FrictionElements]:
    """Friction by part of the laws whose tests have cycles.

    Parameters
    ----------
    tests
        Tests of any kind.
    up_to
        See `Choice`.

    Raises
    ------
    ValueError
        If a test with cycles has no unloading, or its unloading does not differ from
        its loading.
    """
    found = {}
    for part in _PARTS:
        cyclic = in_cycles(tests_of(tests, part))
        if cyclic:
            found[part] = _found(cyclic, up_to)
    return found


def without_friction(one: Test, friction: dict[str, FrictionElements]) -> Test:
    """The test with the forces of the elastic law alone."""
    if not isinstance(one, Cyclic) or one.parts[0] not in friction:
        return one
    rest = force_of(one) - np.nan_to_num(friction[one.parts[0]].force(one))
    if isinstance(one, BendingCurve):
        return replace(one, moment=rest)
    return replace(one, force=rest)


def force_of(test: Cyclic) -> ndarray:
    """Measured force in N, or moment per width in N, shape (n,)."""
    return test.moment if isinstance(test, BendingCurve) else test.force


def displacement(test: Cyclic) -> ndarray:
    """Displacement of the machine in mm, of the measured angle if it is missing.

    For bending the curvature in 1/mm.
    """
    if isinstance(test, BendingCurve):
        return test.curvature
    if test.displacement is not None:
        return test.displacement
    assert isinstance(test, Specimen)
    return test.test.displacement(test.angle)


def work(test: Cyclic, force: ndarray) -> float:
    """Work of the machine in N·mm with a force along the history of a test.

    For bending the work per area in N/mm.
    """
    moved = displacement(test)
    known = np.isfinite(force) & np.isfinite(moved)
    return float(np.trapezoid(force[known], moved[known]))


def predicted(test: Cyclic, law: Any) -> ndarray:
    """Force or moment of an elastic law in a test, shape (n,)."""
    with np.errstate(invalid="ignore"):
        return sum(arm * law.value(x) for x, arm in _arms(test)) + 0.0


def in_cycles(tests: Sequence[Test]) -> list[Cyclic]:
    """Tests whose loading and unloading determine friction."""
    kinds = Specimen, Strip, BendingCurve
    curves: list[Any] = [one for kind in kinds for one in of_kind(tests, kind)]
    return [one for one in curves if one.cyclic]


def _arms(test: Cyclic) -> Iterator[tuple[ndarray, ndarray]]:
    """Pairs of arguments x of the law and factors a: the force is Σ a law(x)."""
    if isinstance(test, Strip):
        along = test.along(FAMILIES.index(test.family))
        assert along is not None
        yield along.strain, test.width * np.exp(-along.strain)
        return
    if isinstance(test, BendingCurve):
        yield test.curvature, np.ones(test.curvature.size)
        return
    for share, arm in test.test.arms(test.angle):
        yield share * test.angle, np.broadcast_to(arm, test.angle.shape)


def _of_elements(test: Cyclic, onsets: Any) -> ndarray:
    """Forces of friction elements with limits of 1 N/mm in N, shape (n_onsets, n)."""
    onset, force = np.asarray(onsets), np.zeros(())
    for x, arm in _arms(test):
        slip, carried = np.zeros(onset.shape), np.full((x.size, onset.size), np.nan)
        for i in np.flatnonzero(np.isfinite(x)):
            held = np.clip(x[i] - slip, -onset, onset)
            slip, carried[i] = x[i] - held, held / onset
        force = force + arm * carried.T
    return force


def _found(tests: Sequence[Cyclic], up_to: float | None) -> FrictionElements:
    """Friction of one law from its tests with cycles.

    Elements at neighbouring onsets of a grid are joined in pairs, and their onsets
    improved by nonlinear least squares.
    """
    reversal = max(map(_reversal, tests))
    problem = _Problem(tests, up_to)
    grid = np.geomspace(_SMALLEST * reversal, 0.5 * reversal, _ONSETS)
    limits, _ = problem.solved(grid)
    kept = np.flatnonzero(limits > _LEAST * limits.sum())
    starts = []
    while kept.size:
        pair = kept[: 1 + (kept.size > 1 and kept[1] == kept[0] + 1)]
        starts.append(np.average(grid[pair], weights=limits[pair]))
        kept = kept[pair.size :]
    if not starts or not problem.supports(np.array(starts)):
        raise ValueError(
            f"{tests[0].name}: unloading does not differ from loading as by friction: "
            "fit it without --cycles"
        )
    low, high = np.log(grid[[0, -1]])
    start = np.clip(np.log(starts), low + _INSIDE, high - _INSIDE)
    better = optimize().least_squares(
        lambda x: problem.solved(np.exp(x))[1], start, bounds=(low, high)
    )
    onsets = np.sort(np.exp(better.x))
    limits, _ = problem.solved(onsets)
    kept = np.flatnonzero(limits > _LEAST * limits.sum())
    limits, _ = problem.solved(onsets[kept])
    return FrictionElements(tuple(limits.tolist()), tuple(onsets[kept].tolist()))


def _reversal(test: Cyclic) -> float:
    """Largest decrease of the argument of the law along a test."""
    x = max((x for x, _ in _arms(test)), key=lambda x: float(np.nanmax(x)))
    x = x[np.isfinite(x)]
    falls = np.maximum.accumulate(x) - x
    if not falls.max(initial=0.0) > REVERSAL * np.ptp(x):
        raise ValueError(
            f"{test.name}: --cycles requires rows of loading and unloading, and the "
            "test has loading only: omit --cycles"
        )
    return float(falls.max())


class _Problem:
    """Bounded least-squares problem for the limits, and for one elastic law per test.

    Parameters
    ----------
    tests
        Tests of one law with cycles.
    up_to
        See `Choice`.
    """

    def __init__(self, tests: Sequence[Cyclic], up_to: float | None) -> None:
        self._tests, self._used = tests, []
        for test in tests:
            used = np.isfinite(_of_elements(test, [1.0])[0])
            if isinstance(test, Specimen):
                used &= test.used(up_to)
            self._used.append(used)
        pairs = [*zip(tests, self._used, strict=True)]
        self._scales = [np.abs(force_of(test)[used]).max() for test, used in pairs]
        self._measured = self._joined([*map(force_of, tests)])
        blocks = [_elastic(test)[used] for test, used in pairs]
        parts = zip(blocks, self._scales, strict=True)
        self._elastic = block_diag(*(block / scale for block, scale in parts))

    def solved(self, onsets: ndarray) -> tuple[ndarray, ndarray]:
        """Limits of elements with given onsets in N/mm, and the remaining forces."""
        friction = [_of_elements(test, onsets) for test in self._tests]
        A = np.hstack([self._elastic, self._joined(friction).T])
        low = np.zeros(A.shape[1])
        low[: self._elastic.shape[1]] = -np.inf
        found = optimize().lsq_linear(A, self._measured, (low, np.inf), method="bvls")
        return found.x[self._elastic.shape[1] :], found.fun

    def supports(self, onsets: ndarray) -> bool:
        """True if the Bayesian information criterion is better with friction."""
        b, n = self._measured, self._measured.size
        elastic = b - self._elastic @ np.linalg.lstsq(self._elastic, b)[0]
        least = _ROUND_OFF * float(b @ b)
        before, after = (
            max(float(x @ x), least) for x in (elastic, self.solved(onsets)[1])
        )
        return bool(n * np.log(before / after) > 2 * onsets.size * np.log(n))

    def _joined(self, forces: Sequence[ndarray]) -> ndarray:
        """Used forces of all tests, relative to their largest."""
        triples = zip(forces, self._used, self._scales, strict=True)
        return np.hstack([force[..., used] / scale for force, used, scale in triples])


def _elastic(test: Cyclic) -> ndarray:
    """Forces of an elastic law by its values at the knots, and of a force at rest."""
    arms = [*_arms(test)]
    most = max(float(np.nanmax(np.abs(x))) for x, _ in arms)
    least = min(float(np.nanmin(x)) for x, _ in arms)
    knots = np.linspace(0.0, most, _KNOTS + 1)
    if least < -REVERSAL * most:
        knots = np.concatenate([-knots[:0:-1], knots])
    knots_but_0 = np.flatnonzero(knots)
    columns = [
        sum(arm * np.interp(x, knots, np.eye(len(knots))[k]) for x, arm in arms)
        for k in knots_but_0
    ]
    at_rest = isinstance(test, Specimen) and test.zeros.force is None
    columns += [np.ones(force_of(test).size)] * at_rest
    return np.transpose(columns)
