"""Cases: declaration of a problem, and its construction."""

from ..lazy import on_first_use
from ..mesh.requirements import require

require("a case file", "cli", "msgspec", "tomli_w")

__getattr__, __dir__ = on_first_use(__name__, __file__)
