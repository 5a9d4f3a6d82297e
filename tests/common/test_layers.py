"""The layers of the package and the imports allowed between them.

An import from a package counts as an import from the modules that define the names.
The names that a package imports on first use are in its stub.  `import_module` with a
literal name counts.  Imports by a name that is put together at run time are not found:
`SolverEntry` imports the linear solvers that way, and `cli.main` the commands.
"""

import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import skfem_textile

PACKAGE = Path(skfem_textile.__file__).parent

#: Each layer, and the layers that it may import from.
LAYERS = {
    "cli.interruption": (),
    "cli.output": (),
    "mesh": (),
    "declarations": ("mesh",),
    "surfaces": ("declarations", "mesh"),
    "fabric": ("declarations", "mesh"),
    "forms.kernels": ("fabric", "mesh"),
    "forms": ("forms.kernels", "fabric", "mesh"),
    "ply": ("forms", "forms.kernels", "fabric", "declarations", "mesh"),
    "solve": ("surfaces", "ply", "fabric", "mesh"),
    "sweep": ("solve", "mesh"),
    "outlines": ("solve", "ply", "fabric", "declarations", "mesh"),
    "nets": ("surfaces", "ply", "fabric", "mesh"),
    "contact": ("surfaces", "solve", "ply", "fabric", "declarations", "mesh"),
    "drape": ("contact", "nets", "surfaces"),
    "declarations.scenes": ("surfaces", "nets", "declarations"),
    "scenes": (
        *("declarations.scenes", "contact", "nets", "surfaces", "outlines", "sweep"),
        *("solve", "ply", "fabric", "declarations", "mesh"),
    ),
    "io": (
        *("contact", "nets", "surfaces", "outlines", "solve", "ply", "forms"),
        *("fabric", "mesh"),
    ),
    "cases": (
        *("io", "scenes", "declarations.scenes", "contact", "nets", "surfaces"),
        *("outlines", "sweep", "solve", "ply", "fabric", "declarations", "mesh"),
    ),
    "plot": (
        *("io", "contact", "nets", "surfaces", "outlines", "solve", "ply"),
        *("forms", "fabric", "mesh"),
    ),
    "calibration": (
        *("plot", "scenes", "solve", "ply", "fabric", "declarations", "mesh"),
    ),
    "cli": (
        *("calibration", "plot", "cases", "io", "scenes", "solve", "declarations"),
        *("declarations.scenes", "drape", "contact", "nets", "surfaces", "outlines"),
        *("sweep", "ply", "fabric", "mesh", "cli.interruption", "cli.output"),
    ),
    "__main__": ("cli",),
}


def modules():
    """Modules of the package by their dotted names."""
    names = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        *parts, name = file.relative_to(PACKAGE).with_suffix("").parts
        dotted = parts if name == "__init__" else [*parts, name]
        names[".".join(dotted)] = file
    return names


MODULES = modules()


#: Relative imports: dots, the module and the names.
IMPORT = re.compile(r"^\s*from (\.+)([\w.]*) import (\([^)]*\)|.*)", re.M)


#: Imports by a literal name, with its dots.
BY_NAME = re.compile(r"\bimport_module\(\s*\"(\.*)([\w.]+)\"")


@cache
def code(module):
    """Code of a module, or of its stub if there is one."""
    stub = MODULES[module].with_suffix(".pyi")
    return (stub if stub.exists() else MODULES[module]).read_text()


@cache
def only_reexports(module):
    """True for a package that defines nothing and only re-exports names."""
    is_package = MODULES[module].name == "__init__.py"
    return is_package and not re.search(r"^(def|class) ", code(module), re.M)


@cache
def imported_names(module):
    """Names that a module imports from the package, with the modules they come from."""
    parts = module.split(".") if module else []
    base = parts if MODULES[module].name == "__init__.py" else parts[:-1]
    pairs = []
    for dots, inner, names in IMPORT.findall(code(module)):
        package = base[: len(base) - len(dots) + 1]
        origin = ".".join([*package, *inner.split(".")]).strip(".")
        plain = re.sub(r"#.*|[()]", "", names)
        pairs += [(origin, one.split()[0]) for one in plain.split(",") if one.strip()]
    for dots, inner in BY_NAME.findall(code(module)):
        package = base[: len(base) - len(dots) + 1] if dots else []
        parts = [*package, *inner.split(".")]
        *outer, name = parts if dots else parts[parts[0] == PACKAGE.name :]
        pairs += (
            [(".".join(outer), name)] if ".".join([*outer, name]) in MODULES else []
        )
    return pairs


@cache
def origins(origin, name):
    """Modules that define a name, also if packages re-export it.

    A package stands for its names and has several.
    """
    inside = f"{origin}.{name}" if origin else name
    if inside in MODULES:
        return imports(inside) if only_reexports(inside) else {inside}
    if not only_reexports(origin):
        return {origin}
    for other, handed in imported_names(origin):
        if handed == name and (other, handed) != (origin, name):
            return origins(other, handed)
    return frozenset()


@cache
def imports(module):
    """Modules from which a module imports, type annotations included."""
    pairs = imported_names(module)
    return frozenset(set().union(*(origins(*pair) for pair in pairs)) - {module})


def test_imports_of_the_package_are_relative():
    """Only relative imports are followed here."""
    absolute = re.compile(rf"^\s*(?:from|import) {PACKAGE.name}\b", re.M)
    assert [
        file for file in MODULES.values() if absolute.search(file.read_text())
    ] == []


WORKING = [module for module in MODULES if not only_reexports(module)]


def layer(module):
    """The innermost layer of `LAYERS` that contains a module."""
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
    lower = set()
    for layer, below in LAYERS.items():
        assert set(below) <= lower
        lower.add(layer)


def test_imports_by_a_literal_name_count():
    assert "plot.pyvista_drawing" in imports("plot.drawing")


def test_no_files_import_each_other_in_a_circle():
    """The error lists the files of a circle."""
    TopologicalSorter({module: imports(module) for module in WORKING}).prepare()
