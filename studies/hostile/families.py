"""The families of trials."""

from . import option_trials
from .trial import Family

FAMILIES: tuple[Family, ...] = (option_trials.FAMILY,)
