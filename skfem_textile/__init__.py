"""Mechanics of woven reinforcements on scikit-fem, free of tension locking."""

from .cli import interruption as interruption
from .lazy import on_first_use

__version__ = "0.3.0"

__getattr__, __dir__ = on_first_use(__name__, __file__, needs={"singular": "shapely"})
