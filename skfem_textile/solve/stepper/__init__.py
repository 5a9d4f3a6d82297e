"""The load stepper, its runs, and the record of a run."""

from .load_stepper import DEFAULT_WARN_ONLY, LoadStepper

__all__ = ["DEFAULT_WARN_ONLY", "LoadStepper"]
