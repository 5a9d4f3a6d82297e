"""A scene computes and imports only what it needs."""

import subprocess
import sys
from collections import Counter
from subprocess import run

import pytest
from skfem import MeshQuad

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply
from skfem_textile.mesh.pattern import Pattern
from skfem_textile.ply.kernels import kernel as kernels
from skfem_textile.scenes import picture_frame, strip
from skfem_textile.solve.linear import superlu

# A scene computes only what it needs: by counting calls


KERNELS = {
    "tension": kernels.TensionKernel,
    "shear": kernels.ShearKernel,
    "stabilisation": kernels.HourglassKernel,
}


@pytest.fixture
def calls(monkeypatch):
    """Number of stress evaluations by kernel, and counts of other work."""
    counts = Counter()

    def count(cls, method, name):
        function = getattr(cls, method)

        def counted(*args, **kwargs):
            counts[name] += 1
            return function(*args, **kwargs)

        monkeypatch.setattr(cls, method, counted)

    for name, kernel in KERNELS.items():
        count(kernel, "stresses", name)
    count(Pattern, "__init__", "patterns")
    count(superlu.SuperLU, "__init__", "analyses")
    return counts


def loaded_modules(fabric, formulation, steps=3):
    scene = strip(size=(4, 6))
    ply = Ply(scene.mesh, fabric, formulation)
    return LoadStepper(ply, scene.conditions, steps, solver="superlu").run()


def test_a_scene_without_shear_and_stabilisation_evaluates_neither(calls):
    loaded_modules(Fabric(1e4), Full())
    assert calls["tension"] > 0
    assert calls["shear"] == calls["stabilisation"] == 0
    calls.clear()
    loaded_modules(Fabric(1e4), OnePoint(10.0))
    assert calls["stabilisation"] > 0
    assert calls["shear"] == 0
    calls.clear()
    scene = picture_frame(size=(2, 2))
    ply = Ply(scene.mesh, Fabric(0.0, 1.0, scene.warp, scene.weft), Full())
    ply.tangent(ply.basis.zeros())
    assert calls["shear"] == 1
    assert calls["tension"] == 0


def test_a_run_builds_and_analyses_its_sparsity_pattern_once(calls):
    result = loaded_modules(Fabric(1e4, 0.5), OnePoint(10.0))
    assert result.factorisations > 10
    assert calls["patterns"] == calls["analyses"] == 1


def test_a_residual_needs_no_pattern(calls):
    ply = Ply(MeshQuad().refined(2), Fabric(1e4, 0.5), Full())
    ply.residual(ply.basis.zeros()), ply.energy(ply.basis.zeros())
    assert calls["patterns"] == 0


def test_a_run_of_few_elements_loads_no_package_that_is_not_needed():
    script = (
        "import sys; from skfem_textile import *; "
        "from skfem_textile.scenes import strip; scene = strip(size=(4, 6)); "
        "ply = Ply(scene.mesh, Fabric(1e4), OnePoint()); "
        "LoadStepper(ply, scene.conditions, 1).run(); "
        "heavy = 'cvxopt pypardiso pyvista matplotlib meshio'.split(); "
        "print([name for name in heavy if name in sys.modules])"
    )
    child = run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert child.stdout.strip() == "[]"


HEAVY = (
    "pyvista",
    "vtk",
    "vtkmodules",
    "matplotlib",
    "meshio",
    "PIL",
    "dask",
    "threadpoolctl",
    "msgspec",
    "tomli_w",
    "jinja2",
    "shapely",
)
OPTIONAL_SOLVERS = ("cvxopt", "pypardiso")


def test_importing_the_package_loads_nothing_that_is_only_used_later():
    script = (
        "import sys, skfem_textile, skfem_textile.scenes;"
        f"print([m for m in {HEAVY + OPTIONAL_SOLVERS!r} if m in sys.modules]);"
        "import skfem_textile.cli.main; sys.modules.pop('msgspec');"
        f"print([m for m in {HEAVY + OPTIONAL_SOLVERS!r} if m in sys.modules])"
    )
    child = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert child.stdout.split() == ["[]", "[]"]
