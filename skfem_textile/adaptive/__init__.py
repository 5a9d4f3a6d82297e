"""Loads on a mesh that is refined until a tolerance is met."""

from .stepper import AdaptiveResult, AdaptiveStepper, Round

__all__ = ["AdaptiveResult", "AdaptiveStepper", "Round"]
