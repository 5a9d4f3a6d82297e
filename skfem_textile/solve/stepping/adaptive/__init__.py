"""Loads on a mesh that is refined until a tolerance is met."""

from .rounds import AdaptiveResult, Round
from .stepper import AdaptiveStepper

__all__ = ["AdaptiveResult", "AdaptiveStepper", "Round"]
