"""A law from a JSON file, as calibration writes it."""

from typing import Any

from ...mesh.user_input import printable
from ...registration import LawRegistration, Resistance
from ..law import BiaxialLaw


def _from_file(path: str, of: Resistance) -> Any:
    from ..files import read_law

    law = read_law(path)
    if getattr(law, "of", None) not in (None, of) or (
        of == "shear" and isinstance(law, BiaxialLaw)
    ):
        raise ValueError(f"{printable(path)}: {type(law).__name__} is no law of {of}")
    return law


REGISTRATION = LawRegistration(
    name="FILE.json",
    description="a law as `fit` or write_law writes it",
    build=_from_file,
    suffix=".json",
    rank=2,
)
