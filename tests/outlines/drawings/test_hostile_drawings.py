"""Drawings composed at random are read as drawn; defects are in the other modules."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import shapely
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from skfem_textile import Outline
from tests.helpers.hostile import (
    RIGHT,
    Family,
    WrongAnswerError,
    expect,
    expect_close,
    expect_equal,
    seeds,
)

ezdxf = pytest.importorskip("ezdxf")

# Largest distance of chords in mm, and points that stand for an exact curve.
TOLERANCE, DENSE = 0.01, 4001

# Units of $INSUNITS in mm.
INCH = 25.4
UNITS = {0: 1.0, 1: INCH, 4: 1.0, 5: 10.0, 6: 1e3, 7: 1e6, 8: INCH / 1e6, 13: 1e-3}
PAGE_UNITS = {"mm": 1.0, "cm": 10.0, "in": INCH, "pt": INCH / 72, "pc": INCH / 6}
PAGE_UNITS |= {"Q": 0.25, "px": INCH / 96}
NAMED = {"mm": 1.0, "cm": 10.0, "m": 1e3, "in": INCH}

CELLS = [(x, y) for x in (-18, 18) for y in (-13, 13)]
KINDS = "rectangle", "polygon", "circle", "ellipse", "spline"


class Shape(NamedTuple):
    """A closed curve about the origin: its kind, numbers, and points along it."""

    kind: str
    numbers: tuple
    points: np.ndarray


def shape(rng, extent, kind=None):
    """A closed curve within a radius; it contains three quarters of the radius."""
    kind = kind or str(rng.choice(KINDS))
    t = np.linspace(0, 2 * np.pi, DENSE)[:-1]
    turn = np.stack([np.cos(t), np.sin(t)])
    if kind == "rectangle":
        a, b = extent * np.array([0.8, 0.6]) if rng.integers(2) else (0.7 * extent,) * 2
        return Shape(kind, (a, b), np.array([[-a, a, a, -a], [-b, -b, b, b]]))
    if kind in ("polygon", "spline"):
        angles = 2 * np.pi * (np.arange(8) + rng.uniform(-0.1, 0.1, 8)) / 8
        corners = rng.uniform(0.9, 1, 8) * extent * [np.cos(angles), np.sin(angles)]
        if kind == "polygon":
            return Shape(kind, (corners,), corners)
        around = np.hstack([corners, corners[:, :3]])
        curve = BSpline(np.arange(-3, 12.0), around.T, 3)
        return Shape(kind, (corners,), curve(np.linspace(0, 8, DENSE)[:-1]).T)
    radii = (extent,) * 2 if kind == "circle" else (extent, 0.8 * extent)
    return Shape(kind, radii, np.array(radii)[:, None] * turn)


def placed(rng, size=0.3):
    """Shift, turn in degrees and scales, which may mirror."""
    scale = np.exp(rng.uniform(-size, size)) * np.ones(2)
    if rng.integers(2):
        scale[1] *= rng.uniform(0.8, 1.0)
    return rng.uniform(-5, 5, 2), rng.uniform(0, 360), scale * rng.choice([-1, 1], 2)


def matrix(shift, degrees, scale):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    M = np.eye(3)
    M[:2, :2] = np.array([[c, -s], [s, c]]) * scale
    M[:2, 2] = shift
    return M


def moved(M, points):
    return M[:2, :2] @ points + M[:2, 2:]


class Ply(NamedTuple):
    """An outline and holes with their matrices, in a chain of frames."""

    outer: Shape
    holes: list
    around: list

    def truth(self, mm):
        """Polygon in mm."""
        M = np.eye(3)
        for place in self.around:
            M = M @ matrix(*place)
        rings = [moved(M, self.outer.points)]
        rings += [moved(M @ matrix(*at), hole.points) for hole, at in self.holes]
        return shapely.Polygon(mm * rings[0].T, [mm * ring.T for ring in rings[1:]])


def ply(rng, mm):
    """A ply of some 50 to 200 mm, drawn in units of a length."""
    holes = []
    for cell in rng.permutation(CELLS)[: rng.integers(0, 5)]:
        at = (
            cell.astype(float),
            rng.uniform(0, 360),
            np.array([1.0, rng.choice([1, -1])]),
        )
        holes.append((shape(rng, rng.uniform(1, 8)), at))
    if rng.random() < 0.2:  # an array
        one = shape(rng, rng.uniform(1, 8))
        holes = [(one, (np.array(at, float), 0.0, np.ones(2))) for at in CELLS]
    outer = shape(rng, 75.0)
    around = [placed(rng) for _ in range(rng.integers(0, 3))]
    shift, turn, scale = np.zeros(2), 0.0, np.full(2, rng.uniform(0.5, 2) / mm)
    return Ply(outer, holes, [(shift, turn, scale), *around])


# ----------------------------------------------------------------------------- DXF


class Dxf:
    """Writer of shapes as entities of random types."""

    def __init__(self, rng, mm):
        self.rng, self.mm = rng, mm
        self.file = ezdxf.new("R2010")
        self.blocks = 0

    def choice(self, *functions):
        functions[self.rng.integers(len(functions))]()

    def draw(self, space, shape, **layer):
        getattr(self, shape.kind)(space, *shape.numbers, layer)

    def polygon(self, space, corners, layer):
        x = [tuple(map(float, corner)) for corner in corners.T]

        def lines():
            pairs = list(zip(x, x[1:] + x[:1], strict=True))
            for i in self.rng.permutation(len(x)):
                a, b = pairs[i][:: self.rng.choice([1, -1])]
                space.add_line(a, b, layer)

        self.choice(
            lambda: space.add_lwpolyline(x, close=True, dxfattribs=layer),
            lambda: space.add_lwpolyline([*x, x[0]], dxfattribs=layer),
            lambda: space.add_polyline2d(x, close=True, dxfattribs=layer),
            lambda: space.add_polyline3d(x, close=True, dxfattribs=layer),
            lines,
        )

    def rectangle(self, space, a, b, layer):
        self.polygon(space, np.array([[-a, a, a, -a], [-b, -b, b, b]]), layer)

    def circle(self, space, r, _, layer):
        def arcs():
            first = self.rng.uniform(0, 360)
            space.add_arc((0, 0), r, first, first + 150, dxfattribs=layer)
            space.add_arc((0, 0), r, first + 150, first, dxfattribs=layer)

        bulges = [(r, 0, 1), (-r, 0, 1)]
        self.choice(
            lambda: space.add_circle((0, 0), r, layer),
            lambda: space.add_ellipse((0, 0), (0, r), 1.0, dxfattribs=layer),
            lambda: space.add_lwpolyline(
                bulges, format="xyb", close=True, dxfattribs=layer
            ),
            arcs,
        )

    def ellipse(self, space, a, b, layer):
        def parts():
            for ends in ((0.3, 2.5), (2.5, 0.3 + 2 * np.pi)):
                space.add_ellipse((0, 0), (a, 0), b / a, *ends, dxfattribs=layer)

        whole = {"dxfattribs": layer}
        self.choice(lambda: space.add_ellipse((0, 0), (a, 0), b / a, **whole), parts)

    def spline(self, space, corners, layer):
        around = np.hstack([corners, corners[:, :3]])
        spline = space.add_open_spline(around.T.tolist(), 3, dxfattribs=layer)
        spline.knots = np.arange(-3, 12.0).tolist()

    def block(self):
        self.blocks += 1
        return self.file.blocks.new(f"B{self.blocks}")

    def insert(self, space, block, place, **attributes):
        shift, turn, (sx, sy) = place
        scales = {"xscale": sx, "yscale": sy, "rotation": turn}
        space.add_blockref(block.name, tuple(shift), {**scales, **attributes})

    def draw_ply(self, space, ply, layer):
        """Draw a ply in nested blocks, each hole in one or two further ones."""
        attributes = {"layer": layer}
        for place in ply.around:
            block = self.block()
            self.insert(space, block, place, **attributes)
            space, attributes = block, {}  # layer 0 is the layer of the block
        self.draw(space, ply.outer, **attributes)
        if len({id(hole) for hole, _ in ply.holes}) < len(ply.holes):
            block = self.block()
            self.draw(block, ply.holes[0][0])
            (x, y), (dx, dy) = CELLS[0], np.subtract(CELLS[-1], CELLS[0])
            array = {"row_count": 2, "column_count": 2, "row_spacing": dy}
            place = (x, y), 0.0, (1.0, 1.0)
            self.insert(space, block, place, **array, column_spacing=dx, **attributes)
            return
        for hole, place in ply.holes:
            for _ in range(1 + int(self.rng.random() < 0.15)):  # duplicates
                block = self.block()
                self.draw(block, hole)
                self.insert(space, block, place, **attributes)


def dxf(rng):
    """Write a drawing; returns the reader and its arguments, and the truth."""
    code = int(rng.choice(list(UNITS)))
    mm, given = UNITS[code], {}
    if rng.random() < 0.25:
        given["unit"] = str(rng.choice(list(NAMED)))
        mm, code = NAMED[given["unit"]], int(rng.choice([code, 77]))
    writer, drawn = Dxf(rng, mm), ply(rng, mm)
    writer.file.header["$INSUNITS"] = code
    model = writer.file.modelspace()
    layer = str(rng.choice(["0", "CUT", "Zuschnitt"]))
    writer.draw_ply(model, drawn, layer)
    size = 1e3 / mm
    if rng.random() < 0.3:
        frame = Shape("rectangle", (size, size), None)
        writer.draw(model, frame, layer="FRAME")
        given["layer"] = layer.lower() if rng.integers(2) else [layer]
    writer.file.saveas("drawing.dxf")
    return Outline.from_dxf, "drawing.dxf", given, drawn.truth(mm)


# ----------------------------------------------------------------------------- SVG


class Svg:
    """Writer of shapes as elements of random types."""

    def __init__(self, rng):
        self.rng, self.defs, self.number = rng, [], 0

    def pick(self, *texts):
        return texts[self.rng.integers(len(texts))]

    def draw(self, shape):
        return getattr(self, shape.kind)(*shape.numbers)

    def polygon(self, corners):
        points = " ".join(f"{float(x)!r},{float(y)!r}" for x, y in corners.T)
        around = np.hstack([corners, corners[:, :1]])
        steps = np.diff(around).T
        relative = "".join(f"l{float(x)!r} {float(y)!r}" for x, y in steps)
        lines = "".join(
            f'<line x1="{a!r}" y1="{b!r}" x2="{c!r}" y2="{d!r}" stroke="red"/>'
            for (a, b), (c, d) in zip(
                around.T[:-1].tolist(), around.T[1:].tolist(), strict=True
            )
        )
        return self.pick(
            f'<polygon points="{points}"/>',
            f'<polyline points="{points} {points.split()[0]}"/>',
            f'<path d="M{points}z"/>',
            f'<path d="M {points.split()[0]} {relative}Z"/>',
            lines,
        )

    def rectangle(self, a, b):
        rect = f'x="{-a}" y="{-b}" width="{2 * a}" height="{2 * b}"'
        return self.pick(
            f"<rect {rect}/>",
            f'<path d="M{-a} {-b}H{a}V{b}H{-a}Z"/>',
            self.polygon(np.array([[-a, a, a, -a], [-b, -b, b, b]])),
        )

    def circle(self, r, _):
        return self.pick(
            f'<circle r="{r}"/>',
            f'<ellipse rx="{r}"/>',
            f'<circle style="r: {r}px"/>',
            self.ellipse(r, r),
        )

    def ellipse(self, a, b):
        return self.pick(
            f'<ellipse rx="{a}" ry="{b}"/>',
            f'<path d="M{a} 0A{a} {b} 0 0 1{-a} 0A{a} {b} 0 01{a} 0z"/>',
        )

    def spline(self, corners):
        p = np.hstack([corners, corners[:, :3]]).T
        start = (p[0] + 4 * p[1] + p[2]) / 6
        d = f"M{start[0]} {start[1]}"
        for a, b, c in zip(p[1:-2], p[2:-1], p[3:], strict=True):
            points = (2 * a + b) / 3, (a + 2 * b) / 3, (a + 4 * b + c) / 6
            d += "C" + " ".join(f"{x} {y}" for x, y in points)
        return f'<path d="{d}Z"/>'

    def placed(self, content, place):
        """Content moved by a transform, in an attribute or a style, or as a clone."""
        shift, turn, (sx, sy) = place
        x, y = shift
        self.number += 1
        name = f"n{self.number}"
        m = matrix(*place)[:2].T.ravel()
        attribute = self.pick(
            f"translate({x},{y}) rotate({turn}) scale({sx} {sy})",
            f"matrix({' '.join(map(str, m.tolist()))})",
        )
        way = self.rng.integers(4)
        if way == 0:
            return f'<g transform="{attribute}">{content}</g>'
        if way == 1:
            css = f"translate({x}px, {y}px) rotate({turn}deg) scale({sx}, {sy})"
            return f'<g style="fill:#123; transform: {css}">{content}</g>'
        self.defs.append(
            f'<g id="{name}">{content}</g>'
            if way == 2
            else f'<symbol id="{name}" style="overflow:visible">{content}</symbol>'
        )
        href = self.pick("href", "xlink:href")
        by_transform = f'<use {href}="#{name}" transform="{attribute}"/>'
        turned = f"translate({x} {y}) rotate({turn}) scale({sx} {sy}) translate(-3 4)"
        by_shift = f'<use x="3" y="-4" {href}="#{name}" transform="{turned}"/>'
        return self.pick(by_transform, by_shift)


def svg(rng):
    """Write a drawing; returns the reader and its arguments, and the truth."""
    unit, given = str(rng.choice(list(PAGE_UNITS))), {}
    mm = PAGE_UNITS[unit] * rng.uniform(0.2, 3)  # of a unit of the drawing
    way = rng.integers(4)
    w, h = rng.uniform(50, 300, 2).tolist()
    head = f'width="{w * mm / PAGE_UNITS[unit]}{unit}" viewBox="0 0 {w} {h}"'
    if way == 0:
        height = h * mm / PAGE_UNITS[unit] * rng.uniform(1, 2)  # meet
        head += f' height="{height}{unit}"'
    elif way == 1:  # no unit
        mm, head = 1.0, head.replace(unit + '"', '"')
    elif way == 2:
        given["unit"] = str(rng.choice(list(NAMED)))
        mm = NAMED[given["unit"]]
    writer, drawn = Svg(rng), ply(rng, mm)
    content = writer.draw(drawn.outer)
    for hole, place in drawn.holes:
        for _ in range(1 + int(rng.random() < 0.15)):  # duplicates
            content += writer.placed(writer.draw(hole), place)
    for place in drawn.around[::-1]:
        content = writer.placed(content, place)
    if rng.random() < 0.2:  # a nested page of half the scale
        size = f'width="{2e4 / mm}" height="{2e4 / mm}"'
        box = f'viewBox="{-2e4 / mm} {-2e4 / mm} {4e4 / mm} {4e4 / mm}"'
        content = f'<svg {size} {box}><g transform="scale(2)">{content}</g></svg>'
    size = 1e3 / mm
    extra = ""
    if rng.random() < 0.3:
        extra = f'<circle id="frame" r="{10 * size}"/>'
        given["layer"] = "ply"
    text = (
        '<svg xmlns="http://www.w3.org/2000/svg" '
        f'xmlns:xlink="http://www.w3.org/1999/xlink" {head}>'
        f"{extra}<defs>{''.join(writer.defs)}</defs>"
        f'<g id="ply">{content}</g></svg>'
    )
    Path("drawing.svg").write_text(text)
    return Outline.from_svg, "drawing.svg", given, drawn.truth(mm)


# ------------------------------------------------------------------------- attempts

WRITERS = {"dxf": dxf, "svg": svg}


def attempt(drawing):
    kind, seed = drawing
    read, file, given, truth = WRITERS[kind](np.random.default_rng(seed))
    try:
        outline = read(file, TOLERANCE, **given)
    except ValueError as error:
        raise WrongAnswerError(f"refused though valid: {error}") from None
    expect_equal("holes", len(outline.holes), len(truth.interiors))
    # Bounding boxes at one place: a page may be shifted, and y points upwards.
    found = outline.shape()
    if kind == "svg":
        truth = shapely.affinity.scale(truth, 1, -1, origin=(0, 0))
    sizes = (extent(found), extent(truth))
    expect_close("width, height and root of area", *sizes, 2 * TOLERANCE)
    shift = np.subtract(found.bounds[:2], truth.bounds[:2])
    truth = shapely.affinity.translate(truth, *shift)
    difference = found.symmetric_difference(truth).area
    expect(
        difference < 2 * TOLERANCE * truth.length, f"area differs by {difference} mm²"
    )
    return RIGHT


def extent(polygon):
    low_x, low_y, high_x, high_y = polygon.bounds
    return np.array([high_x - low_x, high_y - low_y, polygon.area**0.5])


FAMILY = Family(
    "drawings",
    {kind: st.tuples(st.just(kind), seeds) for kind in WRITERS},
    attempt,
    trials=160,
    short=16,
)


def test_drawings_are_read_as_drawn():
    FAMILY.check(examples=8)
