"""Polylines of drawings in DXF and SVG files."""

import os
import re
from xml.etree import ElementTree

import numpy as np
from numpy import ndarray

from ..mesh.user_input import error_text, excerpt, printable

# Layer of a DXF file that gives no name.
_NO_NAME = "0"

# Units of a DXF file ($INSUNITS) in mm.
_DXF_UNITS = {1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1000.0}

# Units of lengths in an SVG file in mm, as in CSS.
_SVG_UNITS = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "px": 25.4 / 96}

# Segments of a curve for an estimate of its bend, and the most.
_PROBES, _MOST = 32, 10_000

#: Polyline of shape (2, n), and its name.
NamedLine = tuple[ndarray, str]


def lines_of_dxf(path: str | os.PathLike[str], tolerance: float) -> list[NamedLine]:
    """Lines, polylines, arcs and splines in mm, each with the name of its layer.

    Parameters
    ----------
    path
        The file; without units, coordinates are in mm.
    tolerance
        Largest distance in mm between a curve and its chords.

    Raises
    ------
    ModuleNotFoundError
        If ezdxf is not installed.
    ValueError
        If the file cannot be read.
    """
    try:
        import ezdxf
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "reading a .dxf file requires ezdxf: pip install 'skfem-textile[dxf]'",
            name=error.name,
        ) from None
    _refuse_tolerance(tolerance)
    try:
        drawing = ezdxf.readfile(path)
    except (ezdxf.DXFError, UnicodeDecodeError) as error:
        raise ValueError(f"{printable(path)}: {error_text(error)}") from None
    except OSError as error:
        if error.errno is not None:
            raise
        raise ValueError(f"{printable(path)} is not a DXF file") from None
    scale = _DXF_UNITS.get(drawing.header.get("$INSUNITS", 4), 1.0)
    lines = []
    for entity in drawing.modelspace():
        name = entity.dxf.layer if entity.dxf.layer != _NO_NAME else ""
        polyline = entity.dxftype() in ("LWPOLYLINE", "POLYLINE")
        for part in entity.virtual_entities() if polyline else [entity]:
            if part.dxftype() == "LINE":
                corners = [part.dxf.start, part.dxf.end]
            elif part.dxftype() in ("ARC", "CIRCLE", "ELLIPSE", "SPLINE"):
                corners = list(part.flattening(tolerance / scale))
            else:
                continue  # text, dimensions, points
            lines.append((scale * np.array([(v.x, v.y) for v in corners]).T, name))
    return lines


def lines_of_svg(path: str | os.PathLike[str], tolerance: float) -> list[NamedLine]:
    """Shapes and paths in mm, y upwards, each with its ``id`` as name.

    Parameters
    ----------
    path
        The file.
    tolerance
        Largest distance in mm between a curve and its chords.

    Raises
    ------
    ValueError
        If the file is not an SVG file, or a path is not valid.
    """
    _refuse_tolerance(tolerance)
    what = printable(path)
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ValueError(f"{what}: {error_text(error)}") from None
    if _tag(root) != "svg":
        raise ValueError(f"{what} is not an SVG file")
    scale = _scale(root)
    lines: list[NamedLine] = []

    def visit(element: ElementTree.Element, M: ndarray) -> None:
        if _tag(element) in ("defs", "clipPath", "mask", "symbol"):
            return
        M = M @ _transform(what, element.get("transform", ""))
        stretch = max(float(np.linalg.norm(M[:, :2], 2)), 1e-300)
        for points in _shape(what, element, tolerance / stretch):
            lines.append((M[:2, :2] @ points + M[:2, 2:], element.get("id", "")))
        for child in element:
            visit(child, M)

    visit(root, np.diag([scale, -scale, 1.0]))
    return lines


def _refuse_tolerance(tolerance: float) -> None:
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"the tolerance must be positive and finite, got {tolerance}")


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2]


_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def _numbers(text: str) -> list[float]:
    return [float(number) for number in _NUMBER.findall(text)]


def _scale(root: ElementTree.Element) -> float:
    """Length in mm of a unit of the drawing."""
    width, box = root.get("width", ""), _numbers(root.get("viewBox", ""))
    number = _NUMBER.match(width.strip())
    unit = width.strip()[number.end() :] if number else ""
    if unit not in _SVG_UNITS or not number:
        return 1.0
    mm = float(number.group()) * _SVG_UNITS[unit]
    return mm / box[2] if len(box) == 4 and box[2] > 0 else _SVG_UNITS[unit]


def _transform(what: str, text: str) -> ndarray:
    """Matrix of the attribute ``transform``, shape (3, 3)."""
    M = np.eye(3)
    for kind, arguments in re.findall(r"(\w+)\s*\(([^)]*)\)", text):
        a = _numbers(arguments)
        step = np.eye(3)
        if kind == "matrix" and len(a) == 6:
            step[:2] = np.reshape(a, (3, 2)).T
        elif kind == "translate" and a:
            step[:2, 2] = a[0], (a[1] if len(a) > 1 else 0.0)
        elif kind == "scale" and a:
            step[[0, 1], [0, 1]] = a[0], a[-1]
        elif kind == "rotate" and len(a) in (1, 3):
            c, s = np.cos(np.radians(a[0])), np.sin(np.radians(a[0]))
            step[:2, :2] = [[c, -s], [s, c]]
            centre = np.array(a[1:] or [0.0, 0.0])
            step[:2, 2] = centre - step[:2, :2] @ centre
        else:
            raise ValueError(
                f"{what}: the transform {excerpt(text)!r} is not supported"
            )
        M = M @ step
    return M


def _shape(what: str, element: ElementTree.Element, tolerance: float) -> list[ndarray]:
    """Polylines of an element, in its own units."""
    kind = _tag(element)
    if kind == "path":
        return _Path(what, element.get("d", ""), tolerance).lines
    if kind in ("polygon", "polyline"):
        n = _numbers(element.get("points", ""))
        points = np.reshape(n[: len(n) // 2 * 2], (-1, 2)).T
        closed = kind == "polygon" and points.size
        return [np.hstack([points, points[:, :1]]) if closed else points]

    def of(*names: str) -> list[float]:
        return [(_numbers(element.get(name, "")) or [0.0])[0] for name in names]

    if kind == "line":
        return [np.reshape(of("x1", "y1", "x2", "y2"), (2, 2)).T]
    if kind == "rect":
        x, y, w, h = of("x", "y", "width", "height")
        if any(of("rx", "ry")):
            raise ValueError(f"{what}: round corners of a rect are not supported")
        return [np.array([[x, x + w, x + w, x, x], [y, y, y + h, y + h, y]])]
    if kind in ("circle", "ellipse"):
        x, y = of("cx", "cy")
        rx, ry = of("r", "r") if kind == "circle" else of("rx", "ry")
        centre = np.array([[x], [y]])
        t = np.linspace(0, 2 * np.pi, _arc_points(2 * np.pi, max(rx, ry), tolerance))
        ring = centre + np.stack([rx * np.cos(t), ry * np.sin(t)])
        ring[:, -1] = ring[:, 0]
        return [ring]
    return []


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
        self._read(d)
        self._end()
        self.lines = [line for line in self.lines if line.shape[1] > 1]

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
                found = re.match(r"[01]", rest) if flag else _NUMBER.match(rest)
                if not found:
                    break
                numbers.append(float(found.group()))
                rest = rest[found.end() :].lstrip(" \t\r\n,")
            if len(numbers) < n or n < 0 or (n == 0 and rest[:1].strip("Mm")):
                raise ValueError(
                    f"{self._what}: the path is not valid near "
                    f"{excerpt((command + rest)[:20])!r}"
                )
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
        elif command in "HV":
            x = self._at.copy()
            axis = "HV".index(command)
            x[axis] = origin[axis] + a[0]
            self._line(x)
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
        if self._points:
            self.lines.append(np.stack(self._points, axis=1))
        self._points = []

    def _bezier(self, controls: ndarray) -> None:
        """Bézier curve with control points of shape (n, 2)."""

        def at(t: ndarray) -> ndarray:
            p = controls[:, :, None]
            while len(p) > 1:
                p = p[:-1] + t * (p[1:] - p[:-1])
            return p[0]

        probe = at(np.linspace(0, 1, _PROBES + 1))
        bend = np.hypot(*(probe[:, 2:] - 2 * probe[:, 1:-1] + probe[:, :-2])).max()
        # The sagitta of a chord is an eighth of the second difference.
        n = _PROBES * np.sqrt(bend / (8 * self._tolerance))
        for x in at(np.linspace(0, 1, 1 + int(np.clip(np.ceil(n), 1, _MOST)))).T[1:]:
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
        radii = radii * max(1.0, float(np.hypot(*half)))
        half /= max(1.0, float(np.hypot(*half)))
        square = max(0.0, 1 / float(half @ half) - 1)
        sign = 1.0 if large != sweep else -1.0
        centre = sign * np.sqrt(square) * np.array([half[1], -half[0]])
        first, last = (np.arctan2(*(v - centre)[::-1]) for v in (half, -half))
        turn = (last - first) % (2 * np.pi) - (0 if sweep else 2 * np.pi)
        n = _arc_points(turn, float(radii.max()), self._tolerance)
        t = first + turn * np.linspace(0, 1, n)
        ring = R @ (
            radii[:, None] * (centre[:, None] + np.stack([np.cos(t), np.sin(t)]))
        )
        points = ring + ((start + end) / 2)[:, None]
        for x in [*points.T[1:-1], end]:
            self._line(x)
        return None
