"""What every test leaves as it was, and which doctests are skipped.

Those of modules that draw are, where what they draw with is missing.
"""

import logging
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parent
MODULES_THAT_DRAW = (
    "skfem_textile/plot/*.py",
    "skfem_textile/plot/*/*.py",
    "skfem_textile/*/figure.py",
)
# No test times: a machine may be busy with other work.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

MISSING = [name for name in ("pyvista", "matplotlib") if find_spec(name) is None]


class Undrawable(pytest.File):
    """A module that cannot be imported here."""

    def collect(self):
        pytest.skip(f"without {', '.join(MISSING)}", allow_module_level=True)


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path, parent):
    collected = yield
    if MISSING and collected and file_path.is_relative_to(ROOT):
        module = file_path.relative_to(ROOT)
        if any(module.match(pattern) for pattern in MODULES_THAT_DRAW):
            return [Undrawable.from_parent(parent, path=file_path)]
    return collected


@pytest.fixture(autouse=True)
def _log_as_before():
    """A run of the command line sets up the log of its whole process."""
    log = logging.getLogger("skfem_textile")
    handlers, level = log.handlers[:], log.level
    yield
    log.handlers[:] = handlers
    log.setLevel(level)
