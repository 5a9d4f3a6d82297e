"""Runs without the error estimate, which takes about as long as a run."""

from dataclasses import replace

import pytest

from skfem_textile import Result
from skfem_textile.solve.states import ErrorEstimate

OMITTED = ErrorEstimate(reason="omitted")


def without_estimate(result):
    return replace(result, estimate=lambda _: OMITTED)


@pytest.fixture
def no_estimate(monkeypatch):
    monkeypatch.setattr(Result, "estimated_error", OMITTED)
