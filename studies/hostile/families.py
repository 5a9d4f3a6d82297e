"""The families of trials."""

from .trial import Family

FAMILIES: tuple[Family, ...] = ()
