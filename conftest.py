"""Marks the tests of pages and of the core, restores the package log after every test,
hides progress, skips doctests that need missing packages and, with ``--dear``, checks
processor times.

Modules that draw need pyvista and Matplotlib, samples the extra of sweeps.
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
MODULES_WITH_EXTRAS = (
    "skfem_textile/plot/*.py",
    "skfem_textile/plot/*/*.py",
    "skfem_textile/*/figure.py",
    "skfem_textile/scenes/samples.py",  # sweeps need another of the extras
    "skfem_textile/cases/sweep.py",
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

# Tests of the marker ``core``: claims that define the library, by module.
CORE = {
    "tests/forms/test_kernels.py": "kernels_and_the_ply_equal_the_forms",
    "tests/forms/test_everywhere.py": "forms_equal_a_ply_and_are_zero_for_other_fields",
    "tests/forms/test_forms.py": "residual_and_tangent_are_derivatives",
    "tests/ply/test_derivatives.py": (
        "residual_and_tangent_are_derivatives_in_space_with_bending"
    ),
    "tests/ply/test_space.py": (
        "a_rotation_in_space_rotates_forces_and_preserves_energy "
        "a_free_flat_patch_has_known_zero_modes"
    ),
    "tests/ply/test_macro.py": "macro_elements_of_triangles_do_not_lock",
    "tests/mesh/test_splitting.py": "a_strip_of_triangles_does_not_lock",
    "tests/scenes/test_strip.py": (
        "meshes_along_the_warp_do_not_lock one_point_and_stabilisation_unlock "
        "the_exact_motion_stretches_no_fibre"
    ),
    "tests/scenes/test_trellis.py": (
        "a_picture_frame_is_exact a_straight_trellis_is_exact_at_any_fibre_angles"
    ),
    "tests/scenes/test_bias_extension.py": (
        "the_exact_motion_stretches_no_fibre_and_has_uniform_shear_zones"
    ),
    "tests/fabric/test_laws.py": "value_and_tangent_are_the_exact_derivatives",
    "tests/fabric/test_kinematics.py": "derivatives_are_exact",
    "tests/fabric/test_law_check.py": "an_inconsistent_law_is_rejected_in_one_line",
    "tests/solve/test_result.py": (
        "a_uniform_pull_is_exact reactions_do_the_work_of_the_energy"
    ),
    "tests/solve/test_interval.py": "the_interval_contains_the_converged_load",
    "tests/solve/checkpoint/test_resumed.py": (
        "a_resumed_run_gives_the_same_result_to_the_last_bit"
    ),
    "tests/nets/test_net.py": "a_net_on_the_sphere_converges_to_the_chebyshev_net",
    "tests/scenes/drape/test_exact_answers.py": (
        "the_chebyshev_net_is_found_in_a_few_solves "
        "a_cylinder_causes_no_shear_and_a_pressure_of_tension_over_radius"
    ),
    "tests/contact/test_tools.py": "contact_is_a_constraint",
}

# Examples of docstrings in the lane ``slow``; tests of its folder are about the same.
SLOW_EXAMPLES = {"skfem_textile.nets.start_search.best_start"}

# Longest test that need not be marked ``dear``, in processor seconds.
DEAR = 0.5

MISSING = [name for name in ("pyvista", "matplotlib") if find_spec(name) is None]


class WithoutExtras(pytest.File):
    """A module that cannot be imported here."""

    def collect(self):
        pytest.skip(f"without {', '.join(MISSING)}", allow_module_level=True)


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path, parent):
    collected = yield
    if MISSING and collected and file_path.is_relative_to(ROOT):
        module = file_path.relative_to(ROOT)
        if any(module.match(pattern) for pattern in MODULES_WITH_EXTRAS):
            return [WithoutExtras.from_parent(parent, path=file_path)]
    return collected


def pytest_ignore_collect(collection_path, config):
    """``-m core`` imports the modules of `CORE` only."""
    if config.option.markexpr == "core" and collection_path.is_file():
        name = collection_path.relative_to(ROOT).as_posix()
        return True if name not in CORE else None
    return None


def pytest_itemcollected(item):
    module = item.path.relative_to(ROOT).as_posix()
    name = getattr(item, "originalname", item.name).removeprefix("test_")
    if name in CORE.get(module, "").split() and not item.get_closest_marker("slow"):
        item.add_marker("core")
    if item.name in SLOW_EXAMPLES:
        item.add_marker("slow")
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


@pytest.fixture(autouse=True)
def _doctests_write_elsewhere(request, monkeypatch):
    """Examples of docstrings write files as users do: here to an empty folder."""
    if isinstance(request.node, pytest.DoctestItem):
        monkeypatch.chdir(request.getfixturevalue("tmp_path"))


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
