"""A scene computes and imports only what it needs."""

import subprocess
import sys
from collections import Counter
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from skfem import MeshQuad

import skfem_textile
from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply
from skfem_textile.cli.main import COMMANDS
from skfem_textile.forms.kernels import kernel as kernels
from skfem_textile.mesh.pattern import Pattern
from skfem_textile.scenes import picture_frame, strip
from skfem_textile.solve.linear import superlu

PACKAGE = Path(skfem_textile.__file__).parent

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


def loaded_by(script):
    """Modules that a program loads in a new process."""
    script += "\nimport sys; print(*sys.modules, file=sys.stderr)"
    child = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(child.stderr.split())


# Environments without a package

EXTRAS = ("jinja2", "matplotlib", "msgspec", "shapely", "threadpoolctl", "tomli_w")

PLAIN_SCRIPT = """
from skfem import MeshQuad, asm
from skfem_textile import *
mesh = MeshQuad().refined(2).with_defaults()
fabric = Fabric(1e3, 1.0, (1, 1), (-1, 1))
basis = quad_basis(mesh, CENTRE)
for form in tension(fabric):
    asm(form, basis, u=basis.zeros())
ply = Ply(mesh, fabric, OnePoint(10.0))
conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 0.01))}
assert LoadStepper(ply, conditions, 1).run().converged
"""


MODULES = "import sys; print(*(name for name, x in sys.modules.items() if x))"


def without(packages, script):
    """A process in which these packages cannot be found."""
    blocked = f"import sys; sys.modules |= dict.fromkeys({packages!r})\n"
    command = [sys.executable, "-c", blocked + script]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.dear("it imports the library in another process")
def test_forms_plies_and_load_steppers_need_no_extra():
    """They load no package that is not needed either."""
    ended = without((*EXTRAS, "meshio", "pyvista", "PIL"), PLAIN_SCRIPT + MODULES)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert not {*ended.stdout.split()} & {*HEAVY, *OPTIONAL_SOLVERS}


@pytest.mark.dear("it imports the library in another process")
def test_without_rslab_a_load_stepper_runs_with_one_line():
    found = without(["rslab", *OPTIONAL_SOLVERS], PLAIN_SCRIPT)
    assert found.returncode == 0
    assert found.stderr.splitlines() == [
        "solver rslab is not installed (pip install rslab): superlu takes over, which "
        "is slower"
    ]


#: Statements that need a package, and the message without it.
ABILITIES = {
    "from skfem_textile import Outline": (
        "a mesh of an outline requires shapely: pip install 'skfem-textile[outlines]'"
    ),
    "from skfem_textile.contact import outline; outline.crossing_edges(None)": (
        "the outline of a tool requires shapely: pip install 'skfem-textile[outlines]'"
    ),
    "from skfem_textile.cases import case_from_file": (
        "a case file requires tomli_w: pip install 'skfem-textile[cli]'"
    ),
    "from skfem_textile.sweep import sweep; next(sweep(abs, [1], None))": (
        "a sweep requires threadpoolctl: pip install 'skfem-textile[sweep]'"
    ),
    "from skfem_textile import plot; plot.curves": (
        "a picture requires matplotlib: pip install 'skfem-textile[plot]'"
    ),
}


@pytest.mark.dear("it imports the whole package in another process")
def test_abilities_without_their_packages_name_the_extra():
    """Names of the package that need one are left out of the help."""
    script = f"""
import inspect, skfem_textile
for ability in {[*ABILITIES]}:
    try:
        exec(ability)
    except ModuleNotFoundError as error:
        print(error)
names = dict(inspect.getmembers(skfem_textile))
assert "Ply" in names and "mesh_outline" not in names
"""
    found = without(["shapely", "tomli_w", "threadpoolctl", "matplotlib"], script)
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.splitlines() == [*ABILITIES.values()]


@pytest.mark.parametrize("package", ["jinja2", "msgspec", "shapely", "tomli_w"])
def test_the_command_line_without_a_package_says_so_in_one_line(package):
    script = "from skfem_textile.cli.main import main; sys.exit(main(['list']))"
    found = without([package], script)
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == (
        f"skfem-textile: error: the command line requires {package}: pip install "
        "'skfem-textile[cli]'\n"
    )


@pytest.mark.dear("it imports the library in another process")
def test_importing_the_package_loads_nothing_that_is_only_used_later():
    loaded = loaded_by("import skfem_textile.scenes, skfem_textile.cli.run_options")
    assert loaded & {*HEAVY, *OPTIONAL_SOLVERS} == {"msgspec"}


PICTURE = """
from skfem import MeshQuad
from skfem_textile import plot
from skfem_textile.fabric.directions import FibreDirections
import skfem_textile.cli.run
plot.mesh_and_fibres(MeshQuad(), FibreDirections.of_angles([0], [90]), {file!r})
"""


@pytest.mark.dear("it draws in another process")
def test_a_run_loads_no_decks_and_its_pictures_in_the_plane_no_vtk(tmp_path):
    pytest.importorskip("matplotlib")
    file = tmp_path / "mesh.png"
    loaded = loaded_by(PICTURE.format(file=str(file)))
    assert not loaded & {"pyvista", "vtkmodules", "skfem_textile.io.part_decks"}
    assert file.exists()


def own(modules):
    """Layers of the package, and modules outside the layers, among loaded modules."""
    parts = (module.split(".") for module in modules)
    return {one[1] for one in parts if one[0] == "skfem_textile" and one[1:]}


def test_the_package_imports_its_names_on_first_use():
    loaded = loaded_by("import skfem_textile")
    assert own(loaded) == {"solve"}  # where the package sets how a result is viewed
    assert not loaded & {"numpy", "scipy", "skfem"}
    loaded = loaded_by("from skfem_textile import Fabric")
    assert own(loaded) == {"fabric", "mesh", "solve"}
    assert not loaded & {"scipy", "skfem"}


FORMING = """
from skfem_textile import Fabric
from skfem_textile.scenes import Case, hemisphere_forming
scene = hemisphere_forming(size=(2, 2), travel=1.0)
Case(scene=scene, fabric=Fabric(10.0, 0.5, scene.warp, scene.weft), steps=1).run()
"""

#: Modules that this run does not use.
NOT_FORMING = "scenes.shear_test surfaces.triangle_mesh surfaces.repair solve.interval"
NOT_FORMING += " solve.checkpoint solve.conditioning nets.sheet contact.figures"
NOT_FORMING += " contact.phases scenes.processes"


@pytest.mark.dear("it forms a hemisphere in another process")
def test_forming_a_hemisphere_loads_only_modules_that_it_uses():
    modules = {x for x in loaded_by(FORMING) if x.startswith("skfem_textile")}
    assert not modules & {f"skfem_textile.{name}" for name in NOT_FORMING.split()}
    assert len(modules) <= 75


HELP = """
import contextlib
from skfem_textile.cli.main import main
for words in {lines}:
    with contextlib.suppress(SystemExit):
        main(words.split())
"""


@pytest.mark.parametrize(
    ("lines", "parts", "unused"),
    [
        (["--help", "--version"], {"cli"}, {"msgspec"}),
        (
            [
                *("list", *(f"{command} --help" for command in COMMANDS)),
                *("run strip --help", "run strip --help all", "run drape --help"),
                "fit joint --help",
            ],
            {"cli", "cases", "declarations", "fabric", "mesh"},  # names of fabrics
            set(),
        ),
    ],
)
def test_help_loads_declarations_only(lines, parts, unused):
    loaded = loaded_by(HELP.format(lines=lines))
    assert own(loaded) == {*parts, "solve"}
    assert not loaded & {"numpy", "scipy", "skfem", *unused}


STUBS = [*PACKAGE.rglob("__init__.pyi")]


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.parent.name)
def test_no_module_hides_a_name_that_is_imported_on_first_use(stub):
    """The import of a module makes it an attribute of its package."""
    folder = stub.parent
    try:
        package = import_module(".".join(folder.relative_to(PACKAGE.parent).parts))
    except ModuleNotFoundError as error:
        pytest.skip(str(error))
    modules = [x for x in folder.glob("*.py") if not x.with_suffix(".pyi").exists()]
    shared = {*package.__all__} & {file.stem for file in modules}
    for name in shared:
        import_module(f"{package.__name__}.{name}")
    assert not [x for x in shared if isinstance(getattr(package, x), ModuleType)]
