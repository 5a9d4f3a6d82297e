"""The layers of the package: what may import what.

What a package hands on counts as an import from the modules that define the names.  Not
seen are modules that are imported by a name which is put together in a running program:
the linear solvers, by `Offer`.
"""

import ast
from functools import cache
from pathlib import Path

import skfem_textile

PACKAGE = Path(skfem_textile.__file__).parent

#: Each layer, and those that it may import from.
LAYERS = {
    "cli.interruption": (),
    "cli.output": (),
    "mesh": (),
    "fabric": ("mesh",),
    "forms": ("fabric", "mesh"),
    "ply.kernels": ("forms", "fabric", "mesh"),
    "ply": ("ply.kernels", "forms", "fabric", "mesh"),
    "solve": ("ply", "fabric", "mesh"),
    "solve.adaptive": ("solve", "ply"),
    "solve.sweep": ("solve",),
    "drape": ("solve", "ply", "fabric", "mesh"),
    "scenes": ("drape", "solve", "ply", "fabric", "mesh"),
    "io": ("drape", "solve", "ply", "fabric", "mesh"),
    "cases": ("io", "scenes", "solve", "ply", "fabric", "mesh"),
    "plot": ("io", "drape", "solve", "ply", "fabric", "mesh"),
    "calibration": ("plot", "scenes", "solve", "ply", "fabric", "mesh"),
    "cli": (
        *("calibration", "plot", "cases", "io", "scenes", "solve.adaptive", "solve"),
        *("drape", "ply", "fabric", "mesh"),
        *("cli.interruption", "cli.output"),
    ),
    "__main__": ("cli",),
}


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


def named(module):
    """Names that a module imports from others of the package, and from where."""
    parts = module.split(".") if module else []
    base = parts if MODULES[module].name == "__init__.py" else parts[:-1]
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom) and node.level:
            there = base[: len(base) - node.level + 1]
            place = [*there, *(node.module.split(".") if node.module else [])]
            for alias in node.names:
                yield ".".join(place), alias.name


def origins(place, name):
    """Modules that define a name, which packages may have handed on.

    Of a package, which stands for its names, these are several.
    """
    inside = f"{place}.{name}" if place else name
    if inside in MODULES:
        return imports(inside) if hands_on(inside) else {inside}
    if not hands_on(place):
        return {place}
    for other, handed in named(place):
        if handed == name and (other, handed) != (place, name):
            return origins(other, handed)
    return set()


@cache
def imports(module):
    """Modules from which a module imports something, if only for its types."""
    pairs = named(module)
    return frozenset(set().union(*(origins(*pair) for pair in pairs)) - {module})


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
        for other in imports(module)
        if layer(module) != layer(other) and layer(other) not in LAYERS[layer(module)]
    ]
    assert wrong == []


def test_layers_are_listed_from_the_ground_up():
    seen = set()
    for layer, below in LAYERS.items():
        assert set(below) <= seen
        seen.add(layer)
