"""Preparation of recordings: branches, outliers and origin."""

from .branches import Branch
from .prepare import BRANCHES, Preparation, Prepared, prepare

__all__ = ["BRANCHES", "Branch", "Preparation", "Prepared", "prepare"]
