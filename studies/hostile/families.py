"""The families of trials."""

from .decks.trials import FAMILIES as DECKS
from .disk import disk_trials, kill_trials
from .meshes.trials import family as mesh_files
from .options import trials as option_trials
from .options.cases import trials as case_trials
from .restarts import checkpoint_trials, sweep_trials
from .semantics import argument_trials, mesh_trials
from .trial import Family

FAMILIES: tuple[Family, ...] = (
    mesh_files("msh 2.2", 2500),
    mesh_files("msh 4.1", 2500),
    mesh_files("inp", 2500),
    mesh_files("vtu", 1500),
    mesh_files("vtk", 1500),
    *DECKS,
    option_trials.FAMILY,
    case_trials.FAMILY,
    mesh_trials.FAMILY,
    argument_trials.FAMILY,
    checkpoint_trials.FAMILY,
    sweep_trials.FAMILY,
    kill_trials.FAMILY,
    disk_trials.FULL,
    disk_trials.READ_ONLY,
)
