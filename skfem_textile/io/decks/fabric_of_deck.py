"""What decks of all programs give: a fabric, sentences on the rest, and units."""

from typing import NamedTuple

from ...fabric import Fabric
from ...mesh.checks import MeshError

# How many N or mm a unit is.
_FORCES = {"N": 1.0, "kN": 1e3}
_LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1e3}


class FabricOfFile(NamedTuple):
    """A fabric that was read, and what could not be taken over.

    ``fabric`` has laws in N/mm, and directions if the file states them.  ``not_taken``
    has a sentence for each thing that the file has and the fabric has not.
    """

    fabric: Fabric
    not_taken: tuple[str, ...]


class Units(NamedTuple):
    """Units of a deck: how many N its force is, and how many mm its length."""

    force: float
    length: float

    @classmethod
    def of(cls, words: str) -> "Units":
        """Units by their names, such as ``"N mm"``.

        Raises
        ------
        MeshError
            If they are not a force and a length that are known.
        """
        force, _, length = words.strip().partition(" ")
        if force not in _FORCES or length.strip() not in _LENGTHS:
            raise MeshError(
                f"units {words!r} are not a force of {', '.join(_FORCES)} and a length "
                f"of {', '.join(_LENGTHS)}, such as 'N mm'"
            )
        return cls(_FORCES[force], _LENGTHS[length.strip()])

    @property
    def stress(self) -> float:
        """How many N/mm² the deck's stress is."""
        return self.force / self.length**2
