"""Runs without error intervals, for tests that do not need them."""

from dataclasses import replace

import pytest

from skfem_textile import ErrorInterval
from skfem_textile.solve import interval

OMITTED = ErrorInterval(reason="omitted")


def without_interval(result):
    return replace(result, interval=lambda _: OMITTED)


@pytest.fixture
def no_interval(monkeypatch):
    monkeypatch.setattr(interval, "error_interval", lambda *_: OMITTED)
