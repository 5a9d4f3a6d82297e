"""Curves of SVG files."""

import logging
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from numpy import ndarray

from ...mesh.user_input import IN_MM, excerpt, printable, refuse_unit
from ..rings import Curve, refuse_tolerance, refuse_too_many, selected
from .elements import (
    CSS_IN_MM,
    NUMBER,
    SHAPES,
    TRANSPARENT,
    Styles,
    number_and_unit,
    numbers,
    polylines,
    tag_of,
    transform,
)

log = logging.getLogger(__name__)

_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_XLINK = "{http://www.w3.org/1999/xlink}"

_GROUPS = "svg", "g", "a", "switch"

# Elements that are not drawn where they stand, or describe others.
_NOT_DRAWN = {
    *("defs", "symbol", "clipPath", "mask", "pattern", "marker", "filter", "style"),
    *("linearGradient", "radialGradient", "title", "desc", "metadata", "script"),
    *("view", "cursor", "font", "color-profile", ""),
}

# Properties that move elements or cut them off, with the values that do not.
_UNSUPPORTED = {
    "clip-path": ("", "none"),
    "mask": ("", "none"),
    "transform-origin": ("", "0", "0 0", "0px 0px"),
    "transform-box": ("", "view-box"),
    "refX": ("", "0"),
    "refY": ("", "0"),
}
_UNSUPPORTED_STYLES = (
    *("translate", "rotate", "scale", "zoom", "offset", "offset-path", "d", "all"),
)

_LABEL = f"{_INKSCAPE}label"

# Inherited properties of the drawing.
_INHERITED = {
    "visibility": "visible",
    "fill": "black",
    "fill-opacity": "1",
    "stroke": "none",
    "stroke-opacity": "1",
}

# Depth of nested elements, a guard against Python's own limit of recursion.
_DEEPEST = 150

# Width and height that are not stated.
_UNKNOWN = np.full(2, np.nan)

# Rounding, relative to its size, by which elements may leave a viewport.
_OUTSIDE = 1e-6


class _View(NamedTuple):
    """Properties that an element takes from the elements around it.

    Parameters
    ----------
    M
        Matrix to the drawing in mm, shape (3, 3).
    size
        Width and height of the viewport in its own units, for percentages; NaN if
        unknown.
    layers
        Names of the elements around it.
    inherited
        Inherited properties by name.
    clones
        Elements whose clone it is.
    depth
        Number of elements around it.
    flaw
        Property around it that is not supported, or ''.
    """

    M: ndarray
    size: ndarray
    layers: tuple[str, ...] = ()
    inherited: Mapping[str, str] = MappingProxyType(_INHERITED)
    clones: tuple[str, ...] = ()
    depth: int = 0
    flaw: str = ""


def curves_of_svg(
    path: str | os.PathLike[str],
    tolerance: float,
    unit: str | None = None,
    layer: str | Sequence[str] | None = None,
) -> list[Curve]:
    """Visible shapes and paths in mm, y upwards, each with its ``id`` as name.

    Parameters
    ----------
    path, tolerance, unit, layer
        See `Outline.from_svg`.

    Raises
    ------
    ValueError
        If the file is not an SVG file, or a visible element is not valid or not
        supported, or no curve is visible on a layer.
    """
    refuse_tolerance(tolerance)
    refuse_unit(unit)
    what = printable(path)
    content = Path(path).read_bytes()
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ValueError(
            f"{what}: the file is not valid XML: {excerpt(str(error))}"
        ) from None
    if tag_of(root) != "svg":
        raise ValueError(f"{what} is not an SVG file")
    if b"<?xml-stylesheet" in content:
        raise ValueError(f"{what}: style sheets of other files are not supported")
    reader = _Reader(what, root, tolerance)
    with np.errstate(all="ignore"):  # positions that are not finite are refused
        reader.read(unit)
    return selected(what, reader.curves, reader.ignored, layer)


def _is_visible(inherited: Mapping[str, str]) -> bool:
    """True if an element with these properties is painted."""
    kinds = [kind for kind in ("fill", "stroke") if inherited[kind] not in TRANSPARENT]
    painted = not all(_is_zero(inherited[f"{kind}-opacity"]) for kind in kinds)
    return painted and inherited["visibility"] not in ("hidden", "collapse")


def _is_zero(opacity: str) -> bool:
    number = NUMBER.match(opacity)
    return number is not None and float(number.group()) == 0


class _Reader:
    """Curves of the elements of a file, and what is ignored."""

    def __init__(self, what: str, root: Element, tolerance: float) -> None:
        self._what, self._root, self._tolerance = what, root, tolerance
        self._styles = Styles(what, root)
        elements = reversed([e for e in root.iter() if e.get("id")])
        self._by_href = {f"#{e.get('id')}": e for e in elements}
        self._mm = 1.0
        self._visited = 0
        self.curves: list[Curve] = []
        self.ignored: Counter[str] = Counter()

    def read(self, unit: str | None) -> None:
        """Read the drawing, one unit of which may have a given length."""
        root = self._root
        if self._styles.value(root, "transform") not in ("", "none"):
            raise ValueError(f"{self._what}: a transform of all is not supported")
        extents = (self._styles.value(root, name) for name in ("width", "height"))
        given = [x for x in extents if x not in ("", "auto")]
        units = [number_and_unit(self._what, x)[1] for x in given]
        stated = any(x in CSS_IN_MM for x in units)
        if unit is not None:
            self._mm = IN_MM[unit]
        elif stated:
            self._mm = CSS_IN_MM["px"]
        else:
            log.warning("%s states no unit: one unit of it is read as 1 mm", self._what)
        window = self._window(root, self._what, _UNKNOWN, ("", ""))
        M, size = self._viewport(root, self._what, *window)
        if unit is not None or not stated:
            M[:2] /= M[0, 0]
        M[:2, 2] = 0.0  # as in the drawing
        if not self._is_hidden(root):
            up = np.diag([self._mm, -self._mm, 1.0])
            self._visit_content(root, _View(up @ M, size))

    def _visit(self, element: Element, view: _View) -> None:
        """Read an element, unless it is hidden."""
        tag = tag_of(element)
        if tag in _NOT_DRAWN:
            return
        self._visited += 1
        refuse_too_many(self._what, self._visited)
        if view.depth > _DEEPEST:
            raise ValueError(f"{self._what}: elements are nested too deeply")
        M = view.M @ self._transform(element)
        if self._is_hidden(element) or np.linalg.det(M) == 0:
            self.ignored[f"hidden {tag}"] += 1
            return
        view = view._replace(M=M, depth=view.depth + 1)
        if tag == "svg":
            self._visit_page(element, view, ("", ""))
        elif tag in _GROUPS:
            self._visit_content(element, view)
        elif tag == "use":
            self._visit_clone(element, self._inside(element, view))
        elif tag in SHAPES:
            self._add(element, tag, self._inside(element, view))
        else:
            self.ignored[tag] += 1

    def _is_hidden(self, element: Element) -> bool:
        value = self._styles.value
        return value(element, "display") == "none" or _is_zero(
            value(element, "opacity")
        )

    def _transform(self, element: Element) -> ndarray:
        text, what = self._styles.value(element, "transform"), self._named(element)
        M = transform(what, text, self._mm)
        if not np.isfinite(M).all():
            raise ValueError(f"{what}: the transform is not finite")
        return M

    def _inside(self, element: Element, view: _View) -> _View:
        """Properties inherited by the children of an element."""
        own = {name: self._styles.value(element, name) for name in _INHERITED}
        given = {n: value for n, value in own.items() if value not in ("", "inherit")}
        names = filter(None, (element.get("id"), element.get(_LABEL)))
        layers = tuple(dict.fromkeys([*view.layers, *names]))
        flaw = view.flaw or self._flaw(element)
        return view._replace(
            inherited={**view.inherited, **given}, layers=layers, flaw=flaw
        )

    def _flaw(self, element: Element) -> str:
        """Property of an element that is not supported, or ''."""
        for name, harmless in _UNSUPPORTED.items():
            value = self._styles.value(element, name)
            if value not in harmless:
                return (
                    f"{self._named(element)} has {name} {excerpt(value)!r}, which is "
                    "not supported: remove it, or draw the result"
                )
        for name in _UNSUPPORTED_STYLES:
            if self._styles.styled(element, name) not in ("", "none"):
                return (
                    f"{self._named(element)} has the style {name}, which is not "
                    "supported: use attributes"
                )
        return ""

    def _visit_content(self, element: Element, view: _View) -> None:
        view = self._inside(element, view)
        children = list(element)
        if tag_of(element) == "switch":  # draws the first that applies
            conditions = ("requiredExtensions", "systemLanguage")
            children = [c for c in children if not any(map(c.get, conditions))][:1]
        for child in children:
            self._visit(child, view)

    def _visit_clone(self, use: Element, view: _View) -> None:
        """Read the element to which another one refers."""
        href = use.get("href") or use.get(f"{_XLINK}href") or ""
        if (target := self._by_href.get(href)) is None:
            raise ValueError(
                f"{self._named(use)} refers to {excerpt(href)!r}, which is not an "
                "element of the file"
            )
        if href in view.clones:
            raise ValueError(f"{self._named(use)} refers to itself")
        step = np.eye(3)
        step[:2, 2] = [self._length(use, view, n, n) or 0.0 for n in "xy"]
        view = view._replace(M=view.M @ step, clones=(*view.clones, href))
        size = self._styles.value(use, "width"), self._styles.value(use, "height")
        if tag_of(target) == "symbol":
            M = view.M @ self._transform(target)
            self._visit_page(target, view._replace(M=M), size)
        elif tag_of(target) == "svg":
            self._visit_page(target, view, size)
        else:
            self._visit(target, view)

    def _visit_page(
        self, element: Element, view: _View, given: tuple[str, str]
    ) -> None:
        """Read a nested drawing, which hides what is outside of its viewport."""
        what, first = self._named(element), len(self.curves)
        low, high = self._window(element, what, view.size, given)
        M, size = self._viewport(element, what, low, high)
        self._visit_content(element, view._replace(M=view.M @ M, size=size))
        overflow = self._styles.value(element, "overflow")
        cuts = overflow not in ("visible", "auto") and np.isfinite(size).all()
        if not cuts or first == len(self.curves):
            return
        p = np.hstack([curve.points for curve in self.curves[first:]])
        x = np.linalg.lstsq(view.M, np.vstack([p, np.ones(p.shape[1])]))[0][:2].T
        margin = _OUTSIDE * np.abs(high - low).max()
        if (x < low - margin).any() or (x > high + margin).any():
            raise ValueError(
                f"{what} cuts off what is outside of its width and height, which is "
                "not supported: set overflow visible, or draw the result"
            )

    def _window(
        self, element: Element, what: str, around: ndarray, given: tuple[str, str]
    ) -> tuple[ndarray, ndarray]:
        """Two corners of the viewport in the units around it; NaN if unknown."""
        value = self._styles.value
        low, size = [], []
        for i, (name, extent) in enumerate((("x", "width"), ("y", "height"))):
            text = value(element, name) if element is not self._root else ""
            low.append(self._units(what, text or "0", around[i]))
            text = given[i] or value(element, extent)
            text = "100%" if text in ("", "auto") else text
            unknown = np.isnan(around[i]) and text.endswith("%")
            size.append(np.nan if unknown else self._units(what, text, around[i]))
        return np.array(low), np.array(low) + size

    def _viewport(
        self, element: Element, what: str, low: ndarray, high: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Matrix of a viewport, and its width and height in its own units."""
        box = numbers(what, self._styles.value(element, "viewBox"))
        size = high - low
        if (size <= 0).any() or (box and (len(box) != 4 or min(box[2:]) <= 0)):
            raise ValueError(f"{what}: width, height or viewBox is not valid")
        M = np.eye(3)
        M[:2, 2] = low
        if not box:
            return M, (size if np.isfinite(size).all() else _UNKNOWN)
        extent = np.array(box[2:])
        if np.isnan(size).any():  # one of them follows from the other, or is as drawn
            ratio = size / extent
            size = extent * (1.0 if np.isnan(ratio).all() else np.nanmax(ratio))
        scale, shift = self._aspect(element, what, size / extent)
        M[[0, 1], [0, 1]] = scale
        M[:2, 2] += shift * (size - scale * extent) - scale * box[:2]
        return M, extent

    def _aspect(
        self, element: Element, what: str, scale: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Scales of both axes by ``preserveAspectRatio``, and the alignment."""
        text = element.get("preserveAspectRatio", "xMidYMid")
        align, *how = text.split() or ["xMidYMid"]
        shares = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
        if align == "none":
            return scale, np.zeros(2)
        x, y = align[1:4], align[5:]
        known = align == f"x{x}Y{y}" and x in shares and y in shares
        if not known or how not in ([], ["meet"], ["slice"]):
            raise ValueError(
                f"{what}: preserveAspectRatio {excerpt(text)!r} is unknown"
            )
        uniform = scale.max() if how == ["slice"] else scale.min()
        return np.full(2, uniform), np.array([shares[x], shares[y]])

    def _add(self, element: Element, tag: str, view: _View) -> None:
        """Read a shape, unless it is hidden."""
        if not _is_visible(view.inherited):
            self.ignored[f"hidden {tag}"] += 1
            return
        M = view.M
        tolerance = self._tolerance / max(float(np.linalg.norm(M[:2, :2], 2)), 1e-300)
        value = partial(self._styles.value, element)
        length = partial(self._length, element, view)
        own = element.get("id", "")
        around = "".join(f" of {excerpt(name)!r}" for name in view.layers[-1:])
        where = f"{tag} {excerpt(own)!r}" if own else f"{tag}{around}"
        for points in polylines(self._named(element), tag, value, length, tolerance):
            moved = M[:2, :2] @ points + M[:2, 2:]
            self.curves.append(Curve(moved, own, where, view.layers, view.flaw))

    def _length(
        self, element: Element, view: _View, name: str, axis: str
    ) -> float | None:
        """Length of an attribute in units of the element; None if not given."""
        text = self._styles.value(element, name)
        if text in ("", "auto"):
            return None
        width, height = view.size
        whole = {"x": width, "y": height, "both": np.hypot(width, height) / np.sqrt(2)}
        return self._units(self._named(element), text, whole[axis])

    def _units(self, what: str, text: str, whole: float) -> float:
        """Length in units of the element; per cent are of a whole."""
        number, unit = number_and_unit(what, text)
        if unit == "%" and np.isnan(whole):
            raise ValueError(
                f"{what}: {excerpt(text)} of a drawing without width and height"
            )
        if unit == "%":
            return number * whole / 100
        return number if unit in ("", "px") else number * CSS_IN_MM[unit] / self._mm

    def _named(self, element: Element) -> str:
        name = element.get("id", "")
        named = f" {excerpt(name)!r}" if name else ""
        return f"{self._what}: {tag_of(element)}{named}"
