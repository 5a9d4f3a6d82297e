"""What a plain reader finds in a mesh file, apart from the library and from meshio."""

import re
from collections import deque
from dataclasses import dataclass, field

_WHOLE = re.compile(rb"[+-]?\d+")
_NUMBER = re.compile(rb"[+-]?((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|(?i:nan|inf|infinity))")


class MalformedError(Exception):
    """A file that departs from its format, or holds what cannot be read."""


@dataclass
class Plain:
    """Nodes, cells as their nodes, and by name: edges, cells and nodes.

    Attributes
    ----------
    node_sets
        Nodes of sets, by name, of which the outer edges become boundaries.
    """

    points: list[tuple[float, ...]]
    cells: list[tuple[int, ...]]
    edges: dict[str, set[frozenset[int]]] = field(default_factory=dict)
    regions: dict[str, set[int]] = field(default_factory=dict)
    nodes: dict[str, set[int]] = field(default_factory=dict)
    node_sets: dict[str, set[int]] = field(default_factory=dict)

    def outer_edges(self) -> set[frozenset[int]]:
        """Edges of one cell only."""
        seen: dict[frozenset[int], int] = {}
        for cell in self.cells:
            for edge in sides(cell):
                seen[edge] = seen.get(edge, 0) + 1
        return {edge for edge, times in seen.items() if times == 1}


def sides(cell: tuple[int, ...]) -> list[frozenset[int]]:
    """The edges of a cell."""
    return [frozenset(pair) for pair in zip(cell, cell[1:] + cell[:1], strict=True)]


def demand(holds: object, what: str = "") -> None:
    """Call the file malformed if this does not hold."""
    if not holds:
        raise MalformedError(what)


def whole(word: bytes) -> int:
    """A whole number in decimal digits."""
    demand(_WHOLE.fullmatch(word), f"{word!r} is no whole number")
    return int(word)


def number(word: bytes) -> float:
    """A number in decimal digits."""
    demand(_NUMBER.fullmatch(word), f"{word!r} is no number")
    return float(word)


class Queue:
    """Words that are taken one by one."""

    def __init__(self, text: bytes) -> None:
        self._words = deque(text.split())

    def word(self) -> bytes:
        """The next word."""
        demand(self._words, "words are missing")
        return self._words.popleft()

    def whole(self) -> int:
        """The next word, a whole number."""
        return whole(self.word())

    def wholes(self, count: int) -> list[int]:
        """The next words, whole numbers."""
        demand(0 <= count <= len(self._words), "words are missing")
        return [self.whole() for _ in range(count)]

    def numbers(self, count: int) -> list[float]:
        """The next words, numbers."""
        demand(0 <= count <= len(self._words), "words are missing")
        return [number(self.word()) for _ in range(count)]

    def end(self) -> None:
        """Nothing may be left."""
        demand(not self._words, "words are left")
