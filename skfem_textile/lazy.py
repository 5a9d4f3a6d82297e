"""Names of a package that are imported on first use.

Importing such a package takes no time, and a program loads only what it uses.  The stub
``__init__.pyi`` of the package imports the names: type checkers read it, and so does
Python when a name is first used.
"""

import ast
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any


def on_first_use(
    package: str, file: str, needs: Mapping[str, str] = MappingProxyType({})
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Import the names of a package on first use.

    Parameters
    ----------
    package, file
        ``__name__`` and ``__file__`` of the package.  The stub beside the file consists
        of imports ``from .module import name as name``.  No module of the package may
        have the name of another object: its import would hide that object.
    needs
        Modules of the stub that require another package, with its name.  Without it,
        ``from package import *``, `dir` and `help` omit their names.

    Returns
    -------
    tuple
        ``__getattr__`` and ``__dir__`` of the package.
    """

    @cache
    def origins() -> dict[str, str]:
        stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
        return {
            alias.name: node.module or ""
            for node in stub.body
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }

    def attribute(name: str) -> Any:
        if name == "__all__":
            from .mesh.requirements import is_installed

            missing = {x for x, required in needs.items() if not is_installed(required)}
            return [name for name, module in origins().items() if module not in missing]
        if name not in origins():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if module := origins()[name]:
            found = getattr(import_module(f"{package}.{module}"), name)
        else:
            found = import_module(f"{package}.{name}")
        setattr(sys.modules[package], name, found)
        return found

    def names() -> list[str]:
        return sorted({*attribute("__all__"), *vars(sys.modules[package])})

    return attribute, names
