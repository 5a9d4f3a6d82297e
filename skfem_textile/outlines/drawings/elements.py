"""Elements of SVG files: attributes, styles, transforms, and their polylines."""

import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from operator import itemgetter
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy import ndarray

from ...mesh.user_input import excerpt
from ..rings import sampled

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
    M, rest = np.eye(3), text if text != "none" else ""
    for call in re.finditer(r"(\w+)\s*\(([^()]*)\)", rest):
        words = re.findall(r"[^\s,]+", re.sub(r"(?<=[\d.])(?=[-+])", " ", call[2]))
        step = _step(call[1].lower(), [_argument(word, mm) for word in words])
        if step is None:
            break
        M, rest = M @ step, rest.replace(call[0], "", 1)
    if rest.strip(" \t\r\n,"):
        raise ValueError(f"{what}: the transform {excerpt(text)!r} is not supported")
    return M


def _argument(word: str, mm: float) -> tuple[float, str]:
    """Number of an argument, and its kind: a number, a length, an angle, or ''."""
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
    return value, ""


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


# Most segments of an arc.
_MOST = 10_000

#: Names of shapes.
SHAPES = "path", "polygon", "polyline", "line", "rect", "circle", "ellipse"

# Lengths of the attributes of shapes, and the direction in which they are measured.
_LENGTHS = {
    "line": {"x1": "x", "y1": "y", "x2": "x", "y2": "y"},
    "rect": {"x": "x", "y": "y", "width": "x", "height": "y", "rx": "x", "ry": "y"},
    "circle": {"cx": "x", "cy": "y", "r": "both"},
    "ellipse": {"cx": "x", "cy": "y", "rx": "x", "ry": "y"},
}


def polylines(
    what: str,
    kind: str,
    value: Callable[[str], str],
    length: Callable[[str, str], float | None],
    tolerance: float,
) -> list[ndarray]:
    """Polylines of a shape in its own units, each of shape (2, n).

    Parameters
    ----------
    what
        The element, for messages.
    kind
        One of `SHAPES`.
    value
        Value of an attribute as text.
    length
        Length of an attribute that is measured along ``x``, ``y`` or ``both``; None if
        it is not given.
    tolerance
        Largest distance between a curve and its chords.

    Raises
    ------
    ValueError
        If an attribute is not valid.
    """
    if kind == "path":
        d = value("d").strip()
        return [] if d == "none" else _Path(what, d, tolerance).lines
    if kind in ("polygon", "polyline"):
        n = numbers(what, value("points"))
        if len(n) % 2:
            raise ValueError(f"{what}: points has an odd number of coordinates")
        points = np.reshape(n, (-1, 2)).T
        closed = kind == "polygon" and points.size
        return [np.hstack([points, points[:, :1]]) if closed else points]
    given = {name: length(name, axis) for name, axis in _LENGTHS[kind].items()}
    a = {name: x or 0.0 for name, x in given.items()}
    if min(a.get(name, 0.0) for name in ("width", "height", "r", "rx", "ry")) < 0:
        raise ValueError(f"{what}: a length is negative")
    if kind == "line":
        return [np.array([[a["x1"], a["x2"]], [a["y1"], a["y2"]]])]
    if given.get("rx", 0) is None or given.get("ry", 0) is None:
        a["rx"] = a["ry"] = max(a["rx"], a["ry"])  # each is by default as the other
    if kind == "rect":
        return _rectangle(what, a, tolerance)
    rx, ry = (a["r"], a["r"]) if kind == "circle" else (a["rx"], a["ry"])
    if not (rx and ry):
        return []
    t = np.linspace(0, 2 * np.pi, _arc_points(2 * np.pi, max(rx, ry), tolerance))
    ring = np.stack([a["cx"] + rx * np.cos(t), a["cy"] + ry * np.sin(t)])
    ring[:, -1] = ring[:, 0]
    return [ring]


def _rectangle(what: str, a: dict[str, float], tolerance: float) -> list[ndarray]:
    """A rectangle, which may have round corners."""
    x, y, w, h = (a[name] for name in ("x", "y", "width", "height"))
    if not (w and h):
        return []
    rx, ry = min(a["rx"], w / 2), min(a["ry"], h / 2)
    if not (rx and ry):
        return [np.array([[x, x + w, x + w, x, x], [y, y, y + h, y + h, y]])]
    corner = f"a{rx!r} {ry!r} 0 0 1 "
    d = (
        f"M{x + rx!r} {y!r}H{x + w - rx!r}{corner}{rx!r} {ry!r}V{y + h - ry!r}"
        f"{corner}{-rx!r} {ry!r}H{x + rx!r}{corner}{-rx!r} {-ry!r}V{y + ry!r}"
        f"{corner}{rx!r} {-ry!r}Z"
    )
    return _Path(what, d, tolerance).lines


def _arc_points(angle: float, radius: float, tolerance: float) -> int:
    """Points along an arc so that chords stay within the tolerance."""
    side = 2 * np.arccos(np.clip(1 - tolerance / max(radius, tolerance), -1, 1))
    return 1 + int(np.clip(np.ceil(abs(angle) / min(side, np.pi / 4)), 1, _MOST))


# Number of arguments of each command of a path.
_SIZES = dict(zip("MLHVCSQTAZ", (2, 2, 1, 1, 6, 4, 4, 2, 7, 0), strict=True))


class _Path:
    """Polylines of the attribute ``d`` of a path."""

    def __init__(self, what: str, d: str, tolerance: float) -> None:
        self._what, self._tolerance = what, tolerance
        self.lines: list[ndarray] = []
        self._points: list[ndarray] = []
        self._at = self._first = np.zeros(2)
        self._control: tuple[str, ndarray] | None = None
        self._begun = False
        self._read(d)
        self._end()

    def _read(self, d: str) -> None:
        rest = d.strip()
        command = ""
        while rest:
            if rest[0].isalpha():
                command, rest = rest[0], rest[1:].lstrip(" \t\r\n,")
            elif command.upper() == "M":
                command = "L" if command == "M" else "l"  # more points are lines
            n = _SIZES.get(command.upper(), -1)
            numbers = []
            for i in range(n):
                flag = command in "aA" and i in (3, 4)  # may be joined to the next
                found = re.match(r"[01]", rest) if flag else NUMBER.match(rest)
                if not found:
                    break
                numbers.append(float(found.group()))
                rest = rest[found.end() :].lstrip(" \t\r\n,")
            misplaced = (n == 0 and rest and not rest[0].isalpha()) or not (
                self._begun or command in "Mm"
            )
            if len(numbers) < n or n < 0 or misplaced:
                raise ValueError(
                    f"{self._what}: the path is not valid near "
                    f"{excerpt((command + rest)[:20])!r}"
                )
            self._begun = True
            self._add(command.upper(), np.array(numbers), command.islower())

    def _add(self, command: str, a: ndarray, relative: bool) -> None:
        origin = self._at if relative else np.zeros(2)
        control, self._control = self._control, None
        if command == "M":
            self._end()
            self._at = self._first = origin + a
        elif command == "Z":
            self._line(self._first)
            self._end()
        elif command == "L":
            self._line(origin + a)
        elif command == "H":
            self._line(np.array([origin[0] + a[0], self._at[1]]))
        elif command == "V":
            self._line(np.array([self._at[0], origin[1] + a[0]]))
        elif command == "A":
            self._arc(a[:2], a[2], bool(a[3]), bool(a[4]), origin + a[5:])
        else:
            points = list(origin + a.reshape(-1, 2))
            kind = "C" if command in "CS" else "Q"
            if command in "ST":
                mirrored = self._at
                if control and control[0] == kind:
                    mirrored = 2 * self._at - control[1]
                points.insert(0, mirrored)
            self._control = kind, points[-2]
            self._bezier(np.array([self._at, *points]))

    def _line(self, x: ndarray) -> None:
        if not self._points:
            self._points.append(self._at)
        if (x != self._points[-1]).any():
            self._points.append(x)
        self._at = x

    def _end(self) -> None:
        if len(self._points) > 1:
            self.lines.append(np.stack(self._points, axis=1))
        self._points = []

    def _bezier(self, controls: ndarray) -> None:
        """Bézier curve with control points of shape (n, 2)."""

        def at(t: ndarray) -> ndarray:
            p = controls[:, :, None]
            while len(p) > 1:
                p = p[:-1] + t * (p[1:] - p[:-1])
            return p[0]

        for x in sampled(at, self._tolerance).T[1:]:
            self._line(x)

    def _arc(
        self, radii: ndarray, tilt: float, large: bool, sweep: bool, end: ndarray
    ) -> None:
        """Elliptical arc, by the implementation notes of SVG 1.1, F.6."""
        start = self._at
        if not radii.all() or (start == end).all():
            return self._line(end)
        c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
        R, radii = np.array([[c, -s], [s, c]]), np.abs(radii)
        half = R.T @ (start - end) / 2 / radii
        larger = max(1.0, float(np.hypot(*half)))  # so that the arc reaches its end
        radii, half = radii * larger, half / larger
        square = max(0.0, 1 / float(half @ half) - 1)
        sign = 1.0 if large != sweep else -1.0
        centre = sign * np.sqrt(square) * np.array([half[1], -half[0]])
        first, last = (np.arctan2(*(v - centre)[::-1]) for v in (half, -half))
        turn = (last - first) % (2 * np.pi) - (0 if sweep else 2 * np.pi)
        n = _arc_points(turn, float(radii.max()), self._tolerance)
        t = first + turn * np.linspace(0, 1, n)
        around = centre[:, None] + np.stack([np.cos(t), np.sin(t)])
        points = R @ (radii[:, None] * around) + ((start + end) / 2)[:, None]
        for x in [*points.T[1:-1], end]:
            self._line(x)
        return None
