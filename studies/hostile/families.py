"""The families of trials."""

from . import (
    checkpoint_trials,
    condition_trials,
    mesh_trials,
    option_trials,
    sweep_trials,
)
from .mesh_files import family as mesh_files
from .trial import Family

FAMILIES: tuple[Family, ...] = (
    mesh_files("msh 2.2", 2500),
    mesh_files("msh 4.1", 2500),
    mesh_files("inp", 2500),
    mesh_files("vtu", 1500),
    mesh_files("vtk", 1500),
    option_trials.FAMILY,
    mesh_trials.FAMILY,
    condition_trials.FAMILY,
    checkpoint_trials.FAMILY,
    sweep_trials.FAMILY,
)
