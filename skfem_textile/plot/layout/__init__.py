"""Where things stand on a picture, in mm."""

from .layout import PAGE, PRINTED, default_width, lay_out
from .legend import KEY
from .placed import Bar, Below, Box, Layout, Place
from .text import POINT, TITLE, Writing, font_file, text_width

__all__ = [
    "KEY",
    "PAGE",
    "POINT",
    "PRINTED",
    "TITLE",
    "Bar",
    "Below",
    "Box",
    "Layout",
    "Place",
    "Writing",
    "default_width",
    "font_file",
    "lay_out",
    "text_width",
]
