"""Stub of stacks of plies."""

from collections.abc import Iterable, Sequence
from typing import Any

from ..ply import Ply
from ..ply.terms import Load, Term


class Stack(Ply):
    """Plies that lie on each other, from the lowest."""

    def __init__(
        self,
        plies: Sequence[Ply],
        *,
        friction: Any = 0.0,
        thickness: float | Sequence[float] = 0.0,
        terms: Iterable[Term | Load] = (),
    ) -> None:
        self.plies, self.user_terms = tuple(plies), tuple(terms)
        self.friction, self.thickness = friction, thickness
