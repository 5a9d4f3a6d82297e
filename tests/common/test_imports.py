import subprocess
import sys

HEAVY = (
    "pyvista",
    "vtk",
    "vtkmodules",
    "matplotlib",
    "meshio",
    "rich",
    "PIL",
    "dask",
    "threadpoolctl",
    "msgspec",
    "tomli_w",
    "jinja2",
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
