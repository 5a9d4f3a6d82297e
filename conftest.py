"""Marks the tests of pages, restores the package log after every test, hides progress,
skips doctests that need missing packages and, with ``--dear``, checks processor times.

Modules that draw need pyvista and Matplotlib.
"""

import logging
import os
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

# A slow machine would print progress on stderr, which tests compare.
os.environ["SKFEM_TEXTILE_PROGRESS"] = "0"

ROOT = Path(__file__).parent
MODULES_THAT_DRAW = (
    "skfem_textile/plot/*.py",
    "skfem_textile/plot/*/*.py",
    "skfem_textile/*/figure.py",
)
# No test times: a machine may be busy with other work.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

# Tests of the marker ``pages``: of scripts and texts outside the package.
PAGES = (
    "studies",
    "tests/studies",
    "tests/documentation",
    "tests/common/test_examples.py",
    "tests/common/test_packaging.py",
)

# Longest test that need not be marked ``dear``, in processor seconds.
DEAR = 0.5

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


def pytest_itemcollected(item):
    if not item.get_closest_marker("slow") and any(
        item.path.is_relative_to(ROOT / name) for name in PAGES
    ):
        item.add_marker("pages")


@pytest.fixture(autouse=True)
def _restore_log():
    """The command line configures the log of the whole process."""
    log = logging.getLogger("skfem_textile")
    handlers, level = log.handlers[:], log.level
    yield
    log.handlers[:] = handlers
    log.setLevel(level)


def pytest_addoption(parser):
    parser.addoption(
        "--dear",
        action="store_true",
        help=f"fail if a test not marked `dear` takes over {DEAR} processor seconds",
    )


def _processor_seconds():
    """Of this process and its children that ended."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    start = _processor_seconds()
    try:
        return (yield)
    finally:
        item.user_properties.append(("seconds", _processor_seconds() - start))


def pytest_sessionfinish(session):
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if not session.config.getoption("dear") or hasattr(session.config, "workerinput"):
        return
    dear = {
        report.nodeid: seconds
        for report in reporter.stats.get("passed", [])
        if "dear" not in report.keywords
        and (seconds := dict(report.user_properties)["seconds"]) > DEAR
    }
    for name, seconds in sorted(dear.items(), key=lambda one: -one[1]):
        reporter.write_line(f"{seconds:6.2f} processor seconds: {name}")
    if dear:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
