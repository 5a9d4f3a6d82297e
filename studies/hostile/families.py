"""The families of trials."""

from . import condition_trials, mesh_trials, option_trials
from .trial import Family

FAMILIES: tuple[Family, ...] = (
    option_trials.FAMILY,
    mesh_trials.FAMILY,
    condition_trials.FAMILY,
)
