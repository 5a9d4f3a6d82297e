"""Cases: declaration of a problem, and its construction."""

import lazy_loader

from ..mesh.requirements import require

require("a case file", "cli", "msgspec", "tomli_w")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
