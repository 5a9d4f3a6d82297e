"""What makes runs quick whose subject is something else."""

import pytest

from skfem_textile import Result
from skfem_textile.solve.states import ErrorEstimate


@pytest.fixture
def no_estimate(monkeypatch):
    """The estimate of the error takes as long as a run."""
    found = ErrorEstimate(reason="not asked for")
    monkeypatch.setattr(Result, "estimated_error", found)
