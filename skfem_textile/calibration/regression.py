"""Parameters of laws from measured curves, with confidence.

Curves are compared in the quantity that carries the noise: forces with forces.  Each
curve has its own noise level, estimated from its residuals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy import ndarray
from scipy import special

from .bands import CONFIDENCE, DIFFER, Component, Fit, independent_share
from .models import Model, joint
from .solving import PARTS, Laws, Sample, Unknowns, covariance_of, rows_of

# Number of iterations of the noise estimate.  Chosen: its change is then below 0.1 %.
_ROUNDS = 5

# Lower bound of the noise, relative to the largest value: rounding errors.
_LEAST_NOISE = 1e-9

# Probability of a zero that is not expected, before the data: most machines are tared.
_UNEXPECTED = 0.1

# Smallest probability of an alternative that is kept: its share of a tail of 2.5 % is
# negligible.
_NEGLIGIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class JointFit:
    """Laws fitted jointly to all curves.

    Attributes
    ----------
    joint
        Parameters of all laws; its law is a dictionary by part.
    parts
        Parameters of each law, with the curves that determine it.
    """

    joint: Fit
    parts: dict[str, Fit]


def fit(
    models: Mapping[str, Model],
    samples: Sequence[Sample],
    *,
    known: Laws | None = None,
    start: ndarray | None = None,
    keep_zeros: bool = False,
) -> JointFit:
    """Fit the parameters of laws to curves, in one least-squares problem.

    Least squares, weighted by the noise of each curve; in closed form if the
    predictions are linear in the parameters.

    Zeros that are not expected are fitted in each of their combinations.  The
    probability of each follows from the Bayesian information criterion (Schwarz 1978);
    bands refer to the mixture (Hoeting et al. 1999, Statist. Sci. 14:382).  The most
    probable one determines the law; expected zeros are 0 in it unless the data reject
    that, see `_without_zeros`.

    Parameters
    ----------
    models
        Laws with unknown parameters, by part, each with a curve that determines it.
    samples
        The curves.
    known
        Laws of other parts.
    start
        Initial parameters.
    keep_zeros
        True if expected zeros stay free, although the data do not reject 0.

    Raises
    ------
    ValueError
        If there are not more points than parameters, or the parameters are not
        identifiable.
    """
    offsets = [offset for sample in samples for offset in sample.offsets]
    always = frozenset(offset.name for offset in offsets if offset.expected)
    optional = dict.fromkeys(o.name for o in offsets if not o.expected)
    of_laws = models, samples, known or {}
    fits = [_compared(_solved(*of_laws, always, start))]
    for free in (always | some for some in _subsets(tuple(optional))):
        try:
            fits.append(_compared(_solved(*of_laws, free, start)))
        except ValueError:  # the data do not determine these zeros
            continue
    probabilities = _probabilities(fits, always)
    kept = np.flatnonzero(probabilities)
    likely = fits[int(probabilities.argmax())]
    best = likely if keep_zeros else _without_zeros(likely, always)

    def fit_of(part: str | None) -> Fit:
        if len(fits) == 1 and best is likely:
            return best.fit(part)
        mixed = tuple((float(probabilities[i]), fits[i].fit(part)) for i in kept)
        return replace(best.fit(part), alternatives=mixed)

    return JointFit(fit_of(None), {name: fit_of(name) for name in models})


def laws_and_zeros(
    models: Mapping[str, Model], samples: Sequence[Sample], free: frozenset[str]
) -> tuple[Laws, list[ndarray]]:
    """Laws fitted to curves with given free zeros, and all zeros of each curve."""
    solved = _solved(models, samples, {}, free)
    return solved.unknowns.laws(solved.x), solved.unknowns.offsets(solved.x)


def _probabilities(fits: Sequence["_Compared"], always: frozenset[str]) -> ndarray:
    """Probability of each fit; 0 if it is negligible."""
    if len(fits) == 1:
        return np.ones(1)
    alone = any(one.beyond_noise for one in fits)
    criterion = np.array([_criterion(one, alone) for one in fits])
    unexpected = np.array([len(one.solved.free - always) for one in fits])
    criterion += 2 * np.log(1 / _UNEXPECTED - 1) * unexpected
    weights = np.exp(-0.5 * (criterion - criterion.min()))
    weights /= weights.sum()
    weights[weights <= _NEGLIGIBLE] = 0.0
    return weights / weights.sum()


def _without_zeros(fit: "_Compared", names: frozenset[str]) -> "_Compared":
    """The fit in which zeros are 0 if the data do not reject that.

    An F-test removes one name after another.  The band of the fit contains the law
    without a zero that it does not reject.  A table of tension represents any slack:
    a slack of a toe, with which its fit begins, stays.
    """
    for name in sorted(names):
        full = fit.solved
        if any(
            offset.name == name and offset.start and sample.part != "shear"
            for sample in full.samples
            for offset in sample.offsets
            if full.unknowns.models[sample.part].name == "tabulated"
        ):
            continue
        laws, start = full.unknowns, full.x[: full.unknowns.parameters]
        less = full.free - {name}
        solved = _solved(
            *(laws.models, full.samples, laws.known, less, start, full.noise)
        )
        if not _rejects(fit, solved):
            fit = _compared(solved)
    return fit


def _rejects(fit: "_Compared", less: "_Solved") -> bool:
    """True if an F-test rejects a fit with fewer zeros.

    For the noise of the fit; correlated residuals count as fewer points.
    """
    full = fit.solved
    of_full, of_less = (_residuals(one, fit.beyond_noise) for one in (full, less))
    share = independent_share(of_full)
    weights = share / full.noise**2
    more = [b @ b - a @ a for a, b in zip(of_full, of_less, strict=True)]
    freedom = _freedom(full, _spread_out(full.samples, weights)).sum()
    zeros = full.unknowns.zeros - less.unknowns.zeros
    F = max(float(weights @ more), 0.0) / zeros
    return bool(special.fdtrc(zeros, freedom, F) < 1 - CONFIDENCE)


def _residuals(solved: "_Solved", alone: bool) -> tuple[ndarray, ...]:
    """Residuals of each curve, by a separate law if curves differ.

    Zeros would represent the difference.
    """
    if not alone:
        return solved.residuals
    return tuple(_alone(solved, i).residuals[0] for i in range(len(solved.samples)))


def _subsets(names: tuple[str, ...]) -> list[frozenset[str]]:
    """Subsets of one or more names."""
    sizes = range(1, len(names) + 1)
    return [frozenset(one) for n in sizes for one in combinations(names, n)]


@dataclass(frozen=True, eq=False)
class _Solved:
    """Best vector of unknowns with given free zeros."""

    unknowns: Unknowns
    free: frozenset[str]
    x: ndarray
    jacobian: ndarray
    residuals: tuple[ndarray, ...]
    noise: ndarray

    @property
    def samples(self) -> Sequence[Sample]:
        return self.unknowns.samples

    @property
    def determined(self) -> ndarray:
        """Mask of the unknowns that are not at a bound."""
        inside = (self.unknowns.low < self.x) & (self.x < self.unknowns.high)
        return inside | (np.arange(self.x.size) >= self.unknowns.parameters)


def _solved(
    models: Mapping[str, Model],
    samples: Sequence[Sample],
    known: Laws,
    free: frozenset[str] = frozenset(),
    start: ndarray | None = None,
    noise: ndarray | None = None,
) -> _Solved:
    """Joint fit of some curves and their free zeros, with given or estimated noise."""
    unknowns = Unknowns(models, samples, free, known)
    measured = np.concatenate([sample.measured for sample in samples])
    _refuse_few(unknowns)
    largest = _largest(samples)
    x = None if start is None else unknowns.start(start)

    def solved(noise: ndarray, x: ndarray | None) -> _Solved:
        x, J = unknowns.solve(_spread_out(samples, noise**-2.0), x)
        residuals = _split(samples, measured - unknowns.predict(x))
        return _Solved(unknowns, free, x, J, residuals, noise)

    if noise is not None:
        return solved(noise, x)
    noise = largest
    for _ in range(_ROUNDS):
        found = solved(noise, x)
        squares = np.array([r @ r for r in found.residuals])
        left = _freedom(found, _spread_out(samples, noise**-2.0))
        noise = np.maximum(np.sqrt(squares / left), _LEAST_NOISE * largest)
        x = found.x
    return replace(found, noise=noise)


def _largest(samples: Sequence[Sample]) -> ndarray:
    """Largest measured value of the part of each curve, or 1 if all are zero."""
    most = dict.fromkeys(PARTS, 0.0)
    for sample in samples:
        most[sample.part] = max(most[sample.part], float(np.abs(sample.measured).max()))
    return np.array([most[sample.part] or 1.0 for sample in samples])


def _refuse_few(unknowns: Unknowns) -> None:
    """An error if a law has as many parameters and zeros as points."""
    for name, model in unknowns.models.items():
        own = [sample for sample in unknowns.samples if sample.part == name]
        n = sum(sample.measured.size for sample in own)
        number = int(np.sum(unknowns.owners == name))
        if n <= number:
            raise ValueError(
                f"{n} points are too few for the {number} parameters of the law "
                f"{model.name}: use a law with fewer parameters"
            )


def _information(solved: _Solved, weights: ndarray) -> list[ndarray]:
    """JᵀWJ of each curve for the unknowns that are not at a bound."""
    J = solved.jacobian[:, solved.determined]
    return [
        (J[rows] * weights[rows, None]).T @ J[rows] for rows in rows_of(solved.samples)
    ]


def _freedom(solved: _Solved, weights: ndarray) -> ndarray:
    """Degrees of freedom of the noise: points less unknowns that a curve determines."""
    J = solved.jacobian[:, solved.determined]
    sizes = np.array([sample.measured.size for sample in solved.samples])
    covariance = covariance_of(J, weights)
    each = np.einsum("ni,ij,nj,n->n", J, covariance, J, weights)
    known = [block.sum() for block in _split(solved.samples, each)]
    return np.maximum(sizes - known, 1e-6)


@dataclass(frozen=True, eq=False)
class _Compared:
    """Solved fit whose curves of each part were fitted alone.

    ``singles`` are the parameters of each of them, ``alone`` their names, and
    ``differ`` the probability of their difference.
    """

    solved: _Solved
    singles: dict[str, ndarray]
    alone: dict[str, tuple[str, ...]]
    differ: dict[str, float]

    @property
    def beyond_noise(self) -> bool:
        return any(probability < DIFFER for probability in self.differ.values())

    def fit(self, part: str | None) -> Fit:
        """Parameters of a part, or of all."""
        solved, unknowns = self.solved, self.solved.unknowns
        own = [i for i, one in enumerate(solved.samples) if part in (None, one.part)]
        parts = list(unknowns.models) if part is None else [part]
        every = np.flatnonzero(np.isin(unknowns.owners, parts))
        columns = every[every < unknowns.parameters]
        offsets = unknowns.offsets(solved.x)
        rows = rows_of(solved.samples)
        J = np.vstack([solved.jacobian[rows[i]] for i in own])
        within = np.ix_(every, every)
        return Fit(
            model=joint(unknowns.models) if part is None else unknowns.models[part],
            samples=tuple(solved.samples[i] for i in own),
            values=solved.x[columns],
            offsets=tuple(offsets[i] for i in own),
            free=solved.free,
            jacobian=J[:, every],
            residuals=tuple(solved.residuals[i] for i in own),
            noise=solved.noise[own],
            at_bound=~solved.determined[columns],
            components=tuple(
                Component(one.covariance[within], one.freedom)
                for one in self._components
            ),
            singles=None if part is None else self.singles.get(part),
            alone=() if part is None else self.alone.get(part, ()),
            differ=np.nan if part is None else self.differ.get(part, np.nan),
        )

    @cached_property
    def _components(self) -> list[Component]:
        """Covariance due to each curve, and to differences between curves."""
        solved = self.solved
        free, size = solved.determined, solved.x.size
        within, components = np.ix_(free, free), []
        residuals = solved.residuals
        share = independent_share(residuals)
        weights = _spread_out(solved.samples, share / solved.noise**2)
        freedom = _freedom(solved, weights)
        total = covariance_of(solved.jacobian[:, free], weights)
        for own, nu in zip(_information(solved, weights), freedom, strict=True):
            more = own + 4 / nu * (own - own @ total @ own)
            covariance = np.zeros((size, size))
            covariance[within] = total @ more @ total
            components.append(Component(covariance, float(nu)))
        for name, probability in self.differ.items():
            if probability < DIFFER:
                components.append(self._between(name))
        return components

    def _between(self, name: str) -> Component:
        """Between-specimen covariance of the mean parameters."""
        solved, singles = self.solved, self.singles[name]
        block = np.arange(solved.x.size)[solved.unknowns.blocks[name]]
        law = solved.determined[block]
        spread = np.atleast_2d(np.cov(singles.T)) / len(singles)
        covariance = np.zeros((solved.x.size, solved.x.size))
        covariance[np.ix_(block[law], block[law])] = spread[np.ix_(law, law)]
        return Component(covariance, len(singles) - 1)


def _compared(solved: _Solved) -> _Compared:
    """Fit with tests for differences between the curves of each part."""
    singles, names, differ = {}, {}, {}
    for name, block in solved.unknowns.blocks.items():
        own = [i for i, one in enumerate(solved.samples) if one.part == name]
        if len(own) < 2 or name == "both":
            continue
        alone = {}
        for i in own:
            try:
                alone[i] = _alone(solved, i)
            except ValueError:  # this curve does not determine all parameters
                continue
        p = int(np.sum(solved.determined[block]))
        points = sum(solved.samples[i].measured.size for i in alone)
        zeros = sum(one.unknowns.zeros for one in alone.values())
        further, rest = p * (len(alone) - 1), points - p * len(alone) - zeros
        if further < 1 or rest < 1:
            continue
        of_all, of_each = (
            float(sum(r @ r / solved.noise[i] ** 2 for i, r in residuals))
            for residuals in (
                [(i, solved.residuals[i]) for i in alone],
                [(i, one.residuals[0]) for i, one in alone.items()],
            )
        )
        F = (of_all - of_each) / further / (of_each / rest) if of_each else 0.0
        number = block.stop - block.start
        singles[name] = np.array([one.x[:number] for one in alone.values()])
        names[name] = tuple(solved.samples[i].name for i in alone)
        differ[name] = float(special.fdtrc(further, rest, F))
    return _Compared(solved, singles, names, differ)


def _alone(joint: _Solved, i: int) -> _Solved:
    """Fit to curve i alone, keeping joint noise and other laws."""
    unknowns, sample = joint.unknowns, joint.samples[i]
    model, values = unknowns.models[sample.part], joint.x[unknowns.blocks[sample.part]]
    noise, laws = joint.noise[i : i + 1], unknowns.laws(joint.x)
    return _solved({sample.part: model}, [sample], laws, joint.free, values, noise)


def _criterion(fit: _Compared, alone: bool) -> float:
    """Bayesian information criterion, by the residuals of each curve."""
    total = 0.0
    samples, residuals = fit.solved.samples, _residuals(fit.solved, alone)
    rounding = _LEAST_NOISE * _largest(samples)
    for sample, r, least in zip(samples, residuals, rounding, strict=True):
        n = r.size
        zeros = sum(offset.name in fit.solved.free for offset in sample.offsets)
        total += n * np.log(max(float(r @ r) / n, least**2)) + zeros * np.log(n)
    return float(total)


def _spread_out(samples: Sequence[Sample], each: ndarray) -> ndarray:
    """A number per curve, repeated for each of its points."""
    return np.repeat(each, [sample.measured.size for sample in samples])


def _split(samples: Sequence[Sample], array: ndarray) -> tuple[ndarray, ...]:
    return tuple(array[rows] for rows in rows_of(samples))
