"""Slack fibres that shorten to a fraction of their length."""

import logging

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    Fabric,
    Linear,
    LoadStepper,
    Ply,
    StepError,
    TensionOnly,
)
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY


def pushed(travel, size=(2, 4), **options):
    """A strip of 50 mm by 100 mm whose fibres, along its sides, are pushed together."""
    fabric = Fabric(TensionOnly(Linear(1e4)), 0.1)
    ply = Ply(rectangle(50, 100, size, "irregular"), fabric)
    conditions = {"clamp": Condition("bottom"), "push": Condition("top", (0, -travel))}
    return LoadStepper(ply, conditions, steps=4, **options)


def test_slack_fibres_that_fold_up_are_reported(caplog):
    """exp(-1) of 100 mm is left at a travel of 63 mm."""
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        result = pushed(60.0, size=(1, 2)).run()
        assert "slack" not in caplog.text
        assert result.ply.law_strain(result.u).min() == pytest.approx(np.log(0.4), 0.02)
        result = pushed(90.0, size=(1, 2)).run()
    assert result.states[-1].verdict.max_fibre_strain > 2.2
    assert "slack fibres shorten to 0.32 of their length in 8 element(s)" in (
        caplog.text
    )


def test_slack_fibres_that_fold_up_can_be_refused():
    others = [name for name in DEFAULT_WARN_ONLY if name != "slack"]
    with pytest.raises(StepError, match=r"slack fibres shorten to .* compression"):
        pushed(90.0, warn_only=others, max_halvings=0).run()
