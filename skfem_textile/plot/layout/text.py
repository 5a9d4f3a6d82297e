"""Text on a picture: its sizes and widths in mm, and its lines."""

from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.font_manager import findfont, get_font

#: Sizes of titles and of the numbers on a scale, in points.
TITLE, NUMBER = 8.0, 7.0

#: A point in mm.
POINT = 25.4 / 72

# Height of a line of text over its size.
_LINE = 1.3


class Writing(NamedTuple):
    """A line of text, centred at x unless ``align`` is left; y is its middle."""

    text: str
    x: float
    y: float
    size: float
    align: str = "center"


def font_file() -> str:
    """The file of the font of all pictures."""
    return str(findfont("DejaVu Sans"))


def text_width(text: str, size: float) -> float:
    """Width of a line of text in mm."""
    font = get_font(font_file())
    font.set_size(size, 72)
    font.set_text(text, 0.0)
    return float(font.get_width_height()[0] / 64 * POINT)


def wrapped(text: str, width: float, size: float) -> list[str]:
    """Lines of a text that are not wider than ``width`` in mm; long words are cut.

    Examples
    --------
    >>> wrapped("a title that is long", 20.0, 8.0)
    ['a title that', 'is long']
    """
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, size) <= width:
            lines[-1] = longer
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if lines[-1] and text_width(lines[-1] + letter, size) > width:
                lines.append("")
            lines[-1] += letter
    return [line for line in lines if line]


def number(x: float) -> str:
    """A number as it stands on a scale.

    Examples
    --------
    >>> number(-2.5), number(-1e-17), number(0.30000000000000004)
    ('−2.5', '0', '0.3')
    """
    shown = f"{x:.6g}" if abs(x) > 1e-15 else "0"
    return shown.replace("-", "−")


def text_height(lines: int, size: float) -> float:
    """Height of lines of text in mm."""
    return lines * _LINE * size * POINT


def text_lines(
    lines: Sequence[str], x: float, top: float, size: float
) -> list[Writing]:
    """Lines of text below one another."""
    step = text_height(1, size)
    return [
        Writing(line, x, top - (i + 0.5) * step, size) for i, line in enumerate(lines)
    ]
