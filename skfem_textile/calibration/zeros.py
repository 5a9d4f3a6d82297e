"""Which zeros of machines the data require: tests and probabilities of models."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy import special

from .bands import CONFIDENCE

# Smallest probability of an alternative that is kept: its share of a tail of 2.5 % is
# negligible.
_NEGLIGIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class Evidence:
    """Fits of the same curves with different free zeros, such as a slack.

    Attributes
    ----------
    squares
        Mean square of the residuals of each curve, (n,), by the names of free zeros.
    freedom
        Number of independent residuals of each curve, shape (n,).
    curves
        Number of curves with each zero.
    priors
        Probability of each zero, before the data, not to be 0.
    """

    squares: Mapping[frozenset[str], ndarray]
    freedom: ndarray
    curves: Mapping[str, int]
    priors: Mapping[str, float]

    @cached_property
    def probabilities(self) -> ndarray:
        """Probability of each fit; 0 if it is negligible, shape (fits,)."""
        criterion = np.array([self._criterion(free) for free in self.squares])
        weights = np.exp(-0.5 * (criterion - criterion.min()))
        weights /= weights.sum()
        weights[weights <= _NEGLIGIBLE] = 0.0
        return weights / weights.sum()

    @property
    def best(self) -> int:
        """The most probable fit of which each free zero differs from 0."""
        needed = [all(self._rejects(f, name) for name in f) for f in self.squares]
        return int(np.where(needed, self.probabilities, -1.0).argmax())

    def _rejects(self, free: frozenset[str], name: str) -> bool:
        """True if an F-test with the other free zeros rejects that a zero is 0."""
        without = self.squares.get(free - {name})
        if without is None:
            return True
        k, freedom = self.curves[name], float(self.freedom.sum())
        more = self.freedom @ (without / self.squares[free] - 1)
        return bool(special.fdtrc(k, freedom, max(more / k, 0.0)) < 1 - CONFIDENCE)

    def _criterion(self, free: frozenset[str]) -> float:
        """−2 ln of the marginal likelihood, and of the prior odds."""
        odds = sum(2 * np.log(1 / self.priors[name] - 1) for name in free)
        penalty = sum(self._penalty(free, name) for name in free)
        return float(self.freedom @ np.log(self.squares[free]) + penalty + odds)

    def _penalty(self, free: frozenset[str], name: str) -> float:
        """What a zero adds to −2 ln of the likelihood, with a prior from the data.

        The prior is normal, and its variance has the largest marginal likelihood
        (George and Foster 2000, Biometrika 87:731): with the likelihood ratio χ² of k
        zeros, this adds k (1 + ln χ²/k), or χ² if χ² < k.
        """
        k, without = self.curves[name], self.squares.get(free - {name})
        if without is None:
            return float(k)
        ratio = float(self.freedom @ np.log(without / self.squares[free]))
        return k * (1 + np.log(ratio / k)) if ratio > k else ratio
