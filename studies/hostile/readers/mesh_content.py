"""What a mesh file holds, and words and numbers of text files."""

import re
from collections import Counter, deque
from dataclasses import dataclass, field

_WHOLE = re.compile(rb"[+-]?\d+")
_NUMBER = re.compile(rb"[+-]?((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|(?i:nan|inf|infinity))")


class MalformedError(Exception):
    """A file that departs from its format, or holds what cannot be read."""


@dataclass
class MeshContent:
    """Positions of nodes, cells as their nodes, and what has names.

    Attributes
    ----------
    edges, regions, nodes
        By name: edges as their two nodes, numbers of cells, numbers of nodes.
    node_sets
        Sets of nodes by name; the outer edges among them become boundaries.
    """

    points: list[tuple[float, ...]]
    cells: list[tuple[int, ...]]
    edges: dict[str, set[frozenset[int]]] = field(default_factory=dict)
    regions: dict[str, set[int]] = field(default_factory=dict)
    nodes: dict[str, set[int]] = field(default_factory=dict)
    node_sets: dict[str, set[int]] = field(default_factory=dict)

    def outer_edges(self) -> set[frozenset[int]]:
        """Edges of one cell only."""
        times = Counter(
            frozenset(ends)
            for cell in self.cells
            for ends in zip(cell, cell[1:] + cell[:1], strict=True)
        )
        return {edge for edge, count in times.items() if count == 1}


def demand(holds: object, what: str = "") -> None:
    """Raise `MalformedError` if a condition does not hold."""
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


class Words:
    """Words of a text, taken from its start."""

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
        return [whole(word) for word in self._next(count)]

    def numbers(self, count: int) -> list[float]:
        """The next words, numbers."""
        return [number(word) for word in self._next(count)]

    def _next(self, count: int) -> list[bytes]:
        demand(0 <= count <= len(self._words), "words are missing")
        return [self._words.popleft() for _ in range(count)]

    def end(self) -> None:
        """Refuse words that are left."""
        demand(not self._words, "words are left")
