"""Cases: declaration of a problem, and its construction."""

from ..lazy import on_first_use

__getattr__, __dir__ = on_first_use(__name__, __file__)
