"""Mechanics of woven reinforcements on scikit-fem, free of tension locking."""

from importlib.util import find_spec
from typing import Any

import lazy_loader

from . import solve

__version__ = "0.3.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

if find_spec("shapely") is None:  # names of `outlines`, for ``import *`` and `help`
    _MISSING = {"Outline", "along_edges", "fit_to_fibres", "fitted"}
    _MISSING |= {"mesh_along_fibres", "mesh_outline", "singular_fibres"}
    __all__ = [name for name in __all__ if name not in _MISSING]
    __dir__ = __all__.copy


def _view(result: Any, **options: Any) -> Any:
    """See `plot.view`, which is imported when it is called."""
    from .plot import view

    return view(result, **options)


solve.viewer = _view
