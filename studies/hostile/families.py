"""The families of hostile inputs, which are tests beside their subjects."""

from tests.cli import test_disturbed_runs as disturbed_runs
from tests.cli import test_hostile_runs as runs
from tests.fabric import test_hostile_tables as tables
from tests.helpers.hostile import Family
from tests.io import test_hostile_decks as decks
from tests.io import test_hostile_mesh_files as mesh_files
from tests.mesh import test_hostile_meshes as meshes
from tests.solve import test_hostile_arguments as arguments
from tests.solve.checkpoint import test_hostile_checkpoints as checkpoints
from tests.sweep import test_hostile_files as sweeps

FAMILIES: tuple[Family, ...] = (
    *mesh_files.FAMILIES,
    *decks.FAMILIES,
    tables.FAMILY,
    *runs.FAMILIES,
    meshes.FAMILY,
    arguments.FAMILY,
    checkpoints.FAMILY,
    sweeps.FAMILY,
    *disturbed_runs.FAMILIES,
)
