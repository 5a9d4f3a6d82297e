"""Values of SVG elements: attributes, styles, style sheets, lengths, transforms."""

import re
from collections.abc import Iterator
from functools import lru_cache
from operator import itemgetter
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy import ndarray

from ...mesh.user_input import excerpt

#: Pattern of a number.
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")

#: Absolute units of lengths in mm, as in CSS.
CSS_IN_MM = {
    "mm": 1.0,
    "cm": 10.0,
    "q": 0.25,
    "in": 25.4,
    "pc": 25.4 / 6,
    "pt": 25.4 / 72,
    "px": 25.4 / 96,
}

#: Colours that are not drawn.
TRANSPARENT = {"none", "transparent"}

# Angles in degrees.
_ANGLES = {"deg": 1.0, "rad": 180 / np.pi, "grad": 0.9, "turn": 360.0}

# Properties in a style sheet that hide, move or shape elements, or cut them off.
_USED = {
    *("display", "visibility", "opacity", "fill-opacity", "stroke-opacity", "all"),
    "overflow",
    *("clip", "clip-path", "mask", "transform", "transform-origin", "transform-box"),
    *("translate", "rotate", "scale", "zoom", "offset", "offset-path", "d"),
    *("x", "y", "cx", "cy", "r", "rx", "ry", "width", "height"),
}

# A selector of one element: a name, classes and an id.
_SELECTOR = re.compile(r"(\*|[\w-]+)?((?:[.#][\w-]+)*)")


class _Rule(NamedTuple):
    """Declarations for elements with a tag, an id and classes."""

    tag: str
    names: tuple[str, ...]
    declarations: dict[str, tuple[str, bool]]

    def applies(self, element: Element) -> bool:
        """True if the selector selects an element."""
        own = {f".{name}" for name in element.get("class", "").split()}
        own.add(f"#{element.get('id', '')}")
        return self.tag in ("", "*", tag_of(element)) and own.issuperset(self.names)

    @property
    def specificity(self) -> tuple[int, int, int]:
        """Numbers of ids, classes and tags."""
        ids = sum(name.startswith("#") for name in self.names)
        return ids, len(self.names) - ids, int(self.tag not in ("", "*"))


class Styles:
    """Values of elements by attribute, style and style sheet.

    Parameters
    ----------
    what
        The file, for messages.
    root
        Element with all style sheets.

    Raises
    ------
    ValueError
        If a rule that matters has a selector that is not supported.
    """

    def __init__(self, what: str, root: Element) -> None:
        self._what = what
        sheets = (e for e in root.iter() if tag_of(e) == "style")
        rules = (r for e in sheets for r in self._read("".join(e.itertext())))
        self._rules = sorted(rules, key=lambda rule: rule.specificity)

    def value(self, element: Element, name: str) -> str:
        """Value of a property, '' if it is not given."""
        return self.styled(element, name) or element.get(name, "").strip()

    def styled(self, element: Element, name: str) -> str:
        """Value of a property in the style or in a style sheet, else ''."""
        of_rules = (r.declarations for r in self._rules if r.applies(element))
        found = [*of_rules, _declarations(element.get("style", ""))]
        values = [declared[name] for declared in found if name in declared]
        # The last important one counts, else the last.
        return max(values[::-1], key=itemgetter(1))[0] if values else ""

    def _read(self, sheet: str) -> Iterator[_Rule]:
        """Rules of a style sheet."""
        sheet = re.sub(r"/\*.*?\*/|<!--|-->", " ", sheet, flags=re.DOTALL)
        sheet = re.sub(r"@(charset|namespace)[^;]*;|@font-face\s*{[^}]*}", " ", sheet)
        if "@" in sheet.replace("\\@", ""):
            rule = excerpt(sheet[sheet.index("@") :].strip().partition("{")[0].strip())
            raise ValueError(f"{self._what}: the style rule {rule!r} is not supported")
        for selectors, block in re.findall(r"([^{}]*){([^{}]*)}", sheet):
            declarations = _declarations(block)
            for selector in selectors.split(","):
                found = _SELECTOR.fullmatch(selector.strip())
                if found:
                    names = re.findall(r"[.#][\w-]+", found[2])
                    yield _Rule(found[1] or "", tuple(names), declarations)
                elif _matters(declarations):
                    raise ValueError(
                        f"{self._what}: the selector {excerpt(selector.strip())!r} of "
                        "a style sheet is not supported"
                    )


def _matters(declarations: dict[str, tuple[str, bool]]) -> bool:
    """True if declarations hide, move or shape elements; other colours do not."""
    colours = (declarations.get(name, ("", False))[0] for name in ("fill", "stroke"))
    return bool(_USED & declarations.keys() or TRANSPARENT.intersection(colours))


@lru_cache(maxsize=1024)
def _declarations(text: str) -> dict[str, tuple[str, bool]]:
    """Values by property, and whether they are important."""
    declared = {}
    for line in re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL).split(";"):
        name, colon, value = line.partition(":")
        value, important, _ = value.partition("!important")
        if colon:
            declared[name.strip().lower()] = value.strip(), bool(important)
    return declared


def tag_of(element: Element) -> str:
    """Name of an element of SVG, '' for elements of other vocabularies."""
    namespace, _, name = str(element.tag).rpartition("}")
    return name if namespace in ("", "{http://www.w3.org/2000/svg") else ""


def numbers(what: str, text: str) -> list[float]:
    """Numbers between blanks and commas."""
    if NUMBER.sub("", text).strip(" \t\r\n,"):
        raise ValueError(f"{what}: {excerpt(text)!r} are not numbers")
    return [float(number) for number in NUMBER.findall(text)]


def number_and_unit(what: str, text: str) -> tuple[float, str]:
    """Number and unit of a length, in lower case."""
    number = NUMBER.match(text)
    unit = text[number.end() :].strip().lower() if number else ""
    if not number or unit not in ("", "%", *CSS_IN_MM):
        raise ValueError(f"{what}: the length {excerpt(text)!r} is not supported")
    return float(number.group()), unit


def transform(what: str, text: str, mm: float) -> ndarray:
    """Matrix of the attribute or property ``transform``, shape (3, 3).

    Parameters
    ----------
    what
        The element, for messages.
    text
        The value.
    mm
        Length in mm of a unit px.
    """
    M = np.eye(3)
    if text == "none":
        return M
    calls = re.findall(r"(\w+)\s*\(([^()]*)\)", text)
    if re.sub(r"\w+\s*\([^()]*\)", "", text).strip(" \t\r\n,"):
        raise _unsupported(what, text)
    for kind, arguments in calls:
        words = re.findall(r"[^\s,]+", re.sub(r"(?<=[\d.])(?=[-+])", " ", arguments))
        step = _step(kind.lower(), [_argument(what, word, mm) for word in words])
        if step is None:
            raise _unsupported(what, text)
        M = M @ step
    return M


def _unsupported(what: str, text: str) -> ValueError:
    return ValueError(f"{what}: the transform {excerpt(text)!r} is not supported")


def _argument(what: str, word: str, mm: float) -> tuple[float, str]:
    """Number of an argument, and its kind: a number, a length or an angle."""
    number = NUMBER.match(word)
    unit = word[number.end() :].lower() if number else "?"
    value = float(number.group()) if number else 0.0
    if unit == "":
        return value, "number"
    if unit in CSS_IN_MM:
        px = 1.0 if unit == "px" else CSS_IN_MM[unit] / mm
        return value * px, "length"
    if unit in _ANGLES:
        return value * _ANGLES[unit], "angle"
    raise _unsupported(what, word)


def _step(kind: str, arguments: list[tuple[float, str]]) -> ndarray | None:
    """Matrix of one function of a transform; None if it is not supported."""
    a, kinds = [value for value, _ in arguments], {unit for _, unit in arguments}
    n, step = len(a), np.eye(3)
    k = "xy".find(kind[-1])  # the axis, if the name has one
    name = kind[:-1] if k >= 0 else kind
    units = {"translate": "length", "rotate": "angle", "skew": "angle"}
    allowed = {"number", units.get(name, "number")}
    if not kinds <= allowed or not a:
        return None
    if kind == "matrix" and n == 6:
        step[:2] = np.reshape(a, (3, 2)).T
    elif kind == "translate" and n < 3:
        step[:2, 2] = a[0], (a[1] if n > 1 else 0.0)
    elif kind == "scale" and n < 3:
        step[[0, 1], [0, 1]] = a[0], a[-1]
    elif name in ("translate", "scale", "skew") and k >= 0 and n == 1:
        column = {"translate": 2, "scale": k, "skew": 1 - k}[name]
        step[k, column] = np.tan(np.radians(a[0])) if name == "skew" else a[0]
    elif kind == "rotate" and n in (1, 3):
        c, s = np.cos(np.radians(a[0])), np.sin(np.radians(a[0]))
        step[:2, :2] = [[c, -s], [s, c]]
        centre = np.array(a[1:] or [0.0, 0.0])
        step[:2, 2] = centre - step[:2, :2] @ centre
    else:
        return None
    return step
