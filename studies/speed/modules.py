"""Modules and packages that whole runs load, each in a new process."""

from collections.abc import Sequence
from pathlib import Path

import skfem_textile

from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings
from .needs import own_modules, run
from .one_ply import SCENES

TABLES = ("modules.md",)

#: Packages that take long to load.
HEAVY = (
    *("skfem", "scipy", "meshio", "pyvista", "vtkmodules", "matplotlib", "PIL"),
    *("rich", "msgspec", "cvxopt", "pypardiso"),
)


def measured(settings: Settings) -> Row:
    """Modules of this library, and heavy packages, of each scene."""
    package = Path(skfem_textile.__path__[0])
    return {
        "modules": len(list(package.rglob("*.py"))),
        "scenes": {name: loaded(name) for name in SCENES},
    }


def loaded(scene: str) -> Row:
    """Number of modules of this library that a scene loads, and heavy packages."""
    results = run("scene", scene, 0)
    return {"own": len(own_modules(results)), "heavy": heavy_of(results["modules"])}


def heavy_of(modules: Sequence[str]) -> list[str]:
    """Packages among `HEAVY`, of SciPy the public packages in it.

    Examples
    --------
    >>> heavy_of(["numpy", "scipy.sparse.linalg", "scipy._lib", "skfem.mesh"])
    ['scipy.sparse', 'skfem']
    """
    packages = set()
    for module in modules:
        first, *rest = module.split(".")
        if first == "scipy" and rest and rest[0][0] != "_" and rest[0] != "version":
            packages.add(f"scipy.{rest[0]}")
        elif first in HEAVY and first != "scipy":
            packages.add(first)
    return sorted(packages)


def tables(results: Row) -> dict[str, str]:
    """A line for each scene."""
    lines = [
        [name, f"{row['own']} of {results['modules']}", ", ".join(row["heavy"])]
        for name, row in results["scenes"].items()
    ]
    head = ["scene", "modules of this library", "heavy packages"]
    return {"modules.md": markdown_table(head, lines)}


def figures(results: Row) -> dict[str, str]:
    """Modules of this library that each scene loads."""
    return {
        f"{name.replace(' ', '_')}_modules": f"{row['own']} of {results['modules']}"
        for name, row in results["scenes"].items()
        if row["own"]
    }
