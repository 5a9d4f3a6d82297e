"""What stands where on a picture, in mm."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import ndarray

if TYPE_CHECKING:
    from ..sheet import Panel, Scale
    from .text import Writing


class Box(NamedTuple):
    """A rectangle in mm, of which (x, y) is the lower left corner."""

    x: float
    y: float
    width: float
    height: float


class Bar(NamedTuple):
    """The coloured rectangle of a scale."""

    scale: "Scale"
    box: Box

    @property
    def tips(self) -> tuple[ndarray, ndarray]:
        """Corners of the arrows at its ends, empty where no values lie beyond."""
        x, y, width, height = self.box
        ends = ((self.scale.below, x, -height), (self.scale.above, x + width, height))
        low, high = (
            np.array([(at, y), (at + tip, y + height / 2), (at, y + height)])[: 3 * out]
            for out, at, tip in ends
        )
        return low, high


class Stroke(NamedTuple):
    """The horizontal line of a key, from (x, y) on."""

    colour: str
    x: float
    y: float


class Place(NamedTuple):
    """A panel: its box, and within it that of the ply, and its title."""

    panel: "Panel"
    box: Box
    ply: Box
    title: list["Writing"]

    @property
    def middle(self) -> ndarray:
        """The middle of the ply's box."""
        x, y, width, height = self.ply
        return np.array([x + width / 2, y + height / 2])

    def scale_of(self, extent: tuple[ndarray, ndarray]) -> float:
        """Mm on the picture over mm of what is seen, so that all of it is."""
        span = np.maximum(extent[1] - extent[0], 1e-12)
        return float(min(self.ply.width / span[0], self.ply.height / span[1]))


class Below(NamedTuple):
    """A legend: its box and what is in it."""

    box: Box
    bars: list[Bar]
    strokes: list[Stroke]
    writings: list["Writing"]


class Layout(NamedTuple):
    """A picture of a size in mm: its panels, row by row, and what is below them."""

    width: float
    height: float
    places: list[list[Place]]
    below: list[Below]
