"""Problems with a known answer, by name."""

from collections.abc import Callable

from .scene import Scene
from .strip import strip

SCENES: dict[str, Callable[..., Scene]] = {"strip": strip}

__all__ = ["SCENES", "Scene", "strip"]
