"""Runs without the error estimate, which takes about as long as a run."""

from dataclasses import replace

import pytest

from skfem_textile import Result
from skfem_textile.solve.states import ErrorEstimate

OMITTED = ErrorEstimate(reason="omitted")


def unestimated(result):
    return replace(result, estimate=lambda _: OMITTED)


@pytest.fixture
def no_estimate(monkeypatch):
    monkeypatch.setattr(Result, "estimated_error", OMITTED)
