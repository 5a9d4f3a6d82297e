"""Names of the package that are imported on first use.

Shapely is slow, and few scenes have tools that move.
"""

from importlib import import_module
from typing import Any

# Modules of the names.
_MODULES = dict.fromkeys(
    (
        "Outline",
        "along_edges",
        "fit_to_fibres",
        "mesh_along_fibres",
        "mesh_outline",
        "singular_fibres",
    ),
    "singular",
) | dict.fromkeys(("Holder", "Tool"), "forming")


def __getattr__(name: str) -> Any:
    """Object of the package by name."""
    if name not in _MODULES:
        raise AttributeError(f"module 'skfem_textile' has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __package__), name)
