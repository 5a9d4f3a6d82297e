"""The layers of the package: what may import what, and how high they stand.

A floor is a module that imports from the one below.  A package that only hands names on
is no floor: what imports from it stands on the modules that define the names, and on
those that `registered` finds in its folder.  What is imported for its type alone, under
``TYPE_CHECKING``, keeps to the layers but is no floor.  Not seen are modules that are
imported by a name which is put together in a running program, of which `registered`
has the only one.

As a script it prints the longest chain of imports and the files of a Newton iteration.
"""

import ast
import sys
from functools import cache
from pathlib import Path

import pytest

import skfem_textile
from skfem_textile import Fabric, Macro, OnePoint, Ply, split
from skfem_textile.scenes import strip
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear.solvers.superlu import SuperLU
from skfem_textile.solve.problem import Problem
from skfem_textile.solve.strategies import Mixed

PACKAGE = Path(skfem_textile.__file__).parent

#: Each layer, and those that it may import from.
LAYERS = {
    "registration": (),
    "cli.interruption": (),
    "cli.output": (),
    "mesh": (),
    "fabric": ("mesh", "registration"),
    "forms": ("fabric", "mesh"),
    "ply.kernels": ("forms", "fabric", "mesh"),
    "ply": ("ply.kernels", "forms", "fabric", "mesh", "registration"),
    "ply.refinement": ("ply", "fabric", "mesh"),
    "solve": ("fabric", "mesh", "registration"),
    "solve.stepping.adaptive": ("solve", "ply.refinement", "ply"),
    "solve.sweep": ("solve", "cli.output"),
    "drape": ("solve", "fabric", "mesh"),
    "scenes": ("drape", "solve", "ply", "fabric", "mesh", "registration"),
    "io": ("drape", "solve", "fabric", "mesh"),
    "plot": ("io", "drape", "solve", "fabric", "mesh"),
    "calibration": ("plot", "scenes", "solve", "ply", "fabric", "mesh"),
    "cli": (
        *("calibration", "plot", "io", "scenes", "solve.stepping.adaptive", "solve"),
        *("drape", "ply", "fabric", "mesh"),
        "registration",
        *("cli.interruption", "cli.output"),
    ),
    "__main__": ("cli",),
}

#: Longest chain of imports.
FLOORS = 10


def modules():
    """Modules of the package by their dotted names."""
    found = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        *parts, name = file.relative_to(PACKAGE).with_suffix("").parts
        dotted = parts if name == "__init__" else [*parts, name]
        found[".".join(dotted)] = file
    return found


MODULES = modules()


@cache
def tree(module):
    return ast.parse(MODULES[module].read_text())


def hands_on(module):
    """Whether a module is a package that defines nothing and only hands names on."""
    defined = (ast.FunctionDef, ast.ClassDef)
    return MODULES[module].name == "__init__.py" and not any(
        isinstance(node, defined) for node in tree(module).body
    )


def is_for_types(node):
    """Whether a node is ``if TYPE_CHECKING:``."""
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def named(module, types):
    """Names that a module imports from others of the package, and from where.

    With or without those that it imports for their types alone.
    """
    parts = module.split(".") if module else []
    base = parts if MODULES[module].name == "__init__.py" else parts[:-1]
    unseen = {
        inner
        for node in ast.walk(tree(module))
        if is_for_types(node) and not types
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom) and node.level and node not in unseen:
            there = base[: len(base) - node.level + 1]
            place = [*there, *(node.module.split(".") if node.module else [])]
            for alias in node.names:
                yield ".".join(place), alias.name


def origins(place, name):
    """Modules that define a name, which packages may have handed on.

    Of a package, which stands for its names, and of what `registered` finds in one
    these are several.
    """
    inside = f"{place}.{name}" if place else name
    if inside in MODULES:
        return imports(inside) if hands_on(inside) else {inside}
    if not hands_on(place):
        return {place}
    for other, handed in named(place, types=True):
        if handed == name and (other, handed) != (place, name):
            return origins(other, handed)
    return registering(place) if name in registries(place) else set()


def registries(package):
    """Names that a package gives to what `registered` finds in its folder."""
    return {
        ast.unparse(node.targets)
        for node in tree(package).body
        if isinstance(node, ast.Assign)
        and ast.unparse(node.value).startswith("registered(")
    }


def registering(package):
    """Modules of a package's folder, and of those in it, that register something."""
    return {
        module
        for module in MODULES
        if module.startswith(f"{package}.")
        and any(
            isinstance(node, ast.Assign) and ast.unparse(node.targets) == "REGISTRATION"
            for node in tree(module).body
        )
    }


@cache
def imports(module, types=False):
    """Modules from which a module imports something."""
    pairs = named(module, types)
    return frozenset(set().union(*(origins(*pair) for pair in pairs)) - {module})


@cache
def chain(module):
    """The longest chain of imports down from a module."""
    below = (chain(other) for other in sorted(imports(module)))
    return (module, *max(below, key=len, default=()))


def test_imports_of_the_package_are_relative():
    """For only these are followed here."""
    absolute = [
        module
        for module in MODULES
        for node in ast.walk(tree(module))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom) and not node.level
            else []
        )
        if name.partition(".")[0] == PACKAGE.name
    ]
    assert absolute == []


WORKING = [module for module in MODULES if not hands_on(module)]


def layer(module):
    """The innermost of `LAYERS` that holds a module."""
    return max(
        (name for name in LAYERS if f"{module}.".startswith(f"{name}.")), key=len
    )


def test_every_layer_imports_only_those_below():
    wrong = [
        (module, other)
        for module in WORKING
        for other in imports(module, types=True)
        if layer(module) != layer(other) and layer(other) not in LAYERS[layer(module)]
    ]
    assert wrong == []


def test_layers_are_listed_from_the_ground_up():
    seen = set()
    for layer, below in LAYERS.items():
        assert set(below) <= seen
        seen.add(layer)


def test_no_chain_of_imports_is_long():
    longest = max(map(chain, WORKING), key=len)
    assert len(longest) <= FLOORS, " > ".join(longest)


def files_of_an_iteration(formulation, mesh):
    """Files of the package that one Newton iteration enters, corners all open."""
    scene = strip(size=(6, 9))
    ply = Ply(mesh(scene.mesh), Fabric(1e4, 0.5), formulation)
    constraints = Constraints(ply.basis, scene.conditions)
    problem = Problem(ply, constraints, SuperLU).at(0.1).without_corners()
    start, values = problem.start(ply.basis.zeros()), constraints.fixed_values(0.1)
    iterates, entered = Mixed().iterates(problem, start, values), set()
    for _ in range(3):  # once near the equilibrium, stiffnesses are found anew
        next(iterates)

    def enter(frame, event, _):
        file = Path(frame.f_code.co_filename)
        if event == "call" and file.is_relative_to(PACKAGE):
            entered.add(str(file.relative_to(PACKAGE)))

    sys.setprofile(enter)
    try:
        next(iterates)
    finally:
        sys.setprofile(None)
    return sorted(entered)


ITERATIONS = {"one point": (OnePoint(), lambda m: m), "macro": (Macro(), split)}


@pytest.mark.parametrize("iteration", ITERATIONS.values(), ids=ITERATIONS)
def test_a_newton_iteration_is_followed_through_few_files(iteration):
    assert len(files_of_an_iteration(*iteration)) <= 12


if __name__ == "__main__":
    longest = max(map(chain, WORKING), key=len)
    print(len(longest), "floors:", " > ".join(longest))
    for name, iteration in ITERATIONS.items():
        entered = files_of_an_iteration(*iteration)
        print(f"Newton iteration, {name}: {len(entered)} files:", *entered)
