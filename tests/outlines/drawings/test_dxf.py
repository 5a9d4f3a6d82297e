"""Outlines of DXF files: blocks, units, visibility, and what is refused."""

import io
import sys

import numpy as np
import pytest

from skfem_textile import Outline

ezdxf = pytest.importorskip("ezdxf")

ROUND = 100 * np.pi  # area of a circle of radius 10


@pytest.fixture
def read(tmp_path, caplog):
    """Reads a drawing of a square and more; returns the outline, and the log."""

    def outline(draw, units=4, square=True, version="R2010", **options):
        drawing = ezdxf.new(version)
        drawing.header["$INSUNITS"] = units
        model = drawing.modelspace()
        if square:
            add_square(model)
        draw(drawing, model)
        drawing.saveas(tmp_path / "a.dxf")
        caplog.clear()
        return Outline.from_dxf(tmp_path / "a.dxf", **options), caplog.text

    return outline


def add_square(space, side=100.0, at=(0.0, 0.0), **attributes):
    x, y = at
    corners = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]
    space.add_lwpolyline(corners, close=True, dxfattribs=attributes)


def hole(drawing, name="HOLE", **attributes):
    """A block with a circle of radius 1, which may be on a layer."""
    block = drawing.blocks.new(name)
    block.add_circle((0, 0), 1, attributes)
    return block


def nothing(drawing, model):
    pass


def test_lines_arcs_and_polylines(tmp_path):
    file = ezdxf.new("R2010", units=5)  # cm
    model = file.modelspace()
    model.add_line((0, 0), (10, 0), dxfattribs={"layer": "clamp"})
    model.add_lwpolyline([(10, 0), (10, 8), (0, 8, 0, 0, -0.5), (0, 0)])
    model.add_circle((5, 4), 2)
    model.add_text("not an outline")
    file.saveas(tmp_path / "a.dxf")
    outline = Outline.from_dxf(tmp_path / "a.dxf", 1e-3, points={"pin": (10, 10)})
    assert outline.edge_names[0][:4] == ["clamp", "right", "top", ""]
    bulge = 4 * np.arctan(0.5)  # angle of an arc over a chord of 80 mm
    cut = (40 / np.sin(bulge / 2)) ** 2 * (bulge - np.sin(bulge)) / 2
    area = 8000 - np.pi * 400 - cut  # the arc runs inside
    assert outline.shape().area == pytest.approx(area, abs=0.2)
    assert outline.points["pin"].tolist() == [10, 10]
    (tmp_path / "b.dxf").write_text("nothing")
    with pytest.raises(ValueError, match=r"b\.dxf"):
        Outline.from_dxf(tmp_path / "b.dxf")
    with pytest.raises(ValueError, match="tolerance must be positive"):
        Outline.from_dxf(tmp_path / "a.dxf", tolerance=0.0)


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(ModuleNotFoundError, match=r"a \.dxf file requires ezdxf: pip"):
        Outline.from_dxf(tmp_path / "a.dxf")


def scaled(drawing, model):
    hole(drawing)
    model.add_blockref("HOLE", (50, 50), {"xscale": 10, "yscale": -20, "rotation": 30})


def nested(drawing, model):
    """A turned reference in one with two scales: the circle becomes an ellipse."""
    hole(drawing)
    outer = drawing.blocks.new("OUTER")
    outer.add_blockref("HOLE", (0, 0), {"xscale": 2, "rotation": 30})
    model.add_blockref("OUTER", (50, 50), {"xscale": -10, "yscale": 10})


def array(drawing, model):
    hole(drawing)
    rows = {"row_count": 2, "column_count": 2, "row_spacing": 30, "column_spacing": 30}
    scales = {"xscale": 10, "yscale": 5, "rotation": 10}
    model.add_blockref("HOLE", (30, 30), {**rows, **scales})


def twice(drawing, model):
    model.add_circle((50, 50), 10)
    model.add_arc((50, 50), 10, 20, 170)
    model.add_arc((50, 50), 10, 170, 20)


def line_twice(drawing, model):
    for a, b in (((40, 40), (60, 40)), ((60, 40), (50, 60)), ((50, 60), (40, 40))):
        model.add_line(a, b)
        model.add_line(b, a)


def mirrored(drawing, model):
    model.add_circle((-50, 50), 10, {"extrusion": (0, 0, -1)})


def periodic(drawing, model):
    spline = model.add_spline()
    spline.set_closed([(40, 40, 0), (60, 40, 0), (60, 60, 0), (40, 60, 0)])


def spline_frame(drawing, model):
    """A fitted polyline also stores the control points, which are not on it."""
    polyline = model.add_polyline2d([(40, 40), (60, 40), (60, 60)], close=True)
    polyline.append_formatted_vertices(
        [(90, 90)], format="xy", dxfattribs={"flags": 16}
    )


def on_another_layer(drawing, model):
    """A layer that is off does not hide other layers of its blocks."""
    drawing.layers.add("GUIDES").off()
    hole(drawing, layer="CUT")
    model.add_blockref("HOLE", (50, 50), {"layer": "GUIDES"})


def cone(drawing, model):
    """The first part of the polyline is an arc that runs backwards."""
    model.add_lwpolyline([(40, 50, 0, 0, -1), (60, 50), (50, 30)], close=True)


@pytest.mark.parametrize(
    ("draw", "area", "holes"),
    [
        (cone, ROUND / 2 + 200, 1),
        (scaled, 2 * ROUND, 1),
        (nested, 2 * ROUND, 1),
        (array, 2 * ROUND, 4),
        (twice, ROUND, 1),
        (line_twice, 200, 1),
        (mirrored, ROUND, 1),
        (spline_frame, 200, 1),
        (on_another_layer, np.pi, 1),
        (lambda _, model: model.add_circle((50, 50, 30), 10), ROUND, 1),
        (lambda _, model: model.add_line((50, 50), (50, 50)), 0, 0),
        (lambda drawing, _: drawing.paperspace().add_circle((50, 50), 20), 0, 0),
    ],
)
def test_holes_are_read_wherever_they_are_stored(read, draw, area, holes):
    outline, _ = read(draw)
    assert len(outline.holes) == holes
    assert 1e4 - outline.shape().area == pytest.approx(area, abs=1.5)


def test_a_line_along_an_edge_counts_once_and_names_it(read):
    def draw(drawing, model):
        model.add_line((0, 0), (100, 0), {"layer": "CLAMP"})
        model.add_line((100, 10), (100, 90))

    outline, _ = read(draw)
    assert outline.shape().area == pytest.approx(1e4)
    assert outline.edge_names[0] == ["CLAMP", "right", "top", "left"]
    with pytest.raises(
        ValueError, match=r"1 line\(s\) end at \(0, 9\) of layer 'NAME'"
    ):
        read(lambda _, model: model.add_line((0, 9), (0, 50), {"layer": "NAME"}))


def test_a_periodic_spline_ends_where_it_begins(read):
    corners = np.array([[40, 60, 60, 40], [40, 40, 60, 60]], dtype=float)
    t = np.linspace(0, 1, 1001)[:-1]
    basis = [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 1 + 3 * t * (1 + t - t**2), t**3]
    ring = np.hstack(
        [np.roll(corners, -k, axis=1) @ np.array(basis) / 6 for k in range(4)]
    )
    outline, _ = read(periodic, tolerance=1e-4)
    x, y = ring - 50
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert 1e4 - outline.shape().area == pytest.approx(area, abs=0.01)


def test_chords_depend_on_the_size_in_mm_only(read):
    """A block in mm in a drawing in miles, whose z axis keeps its scale."""

    def draw(drawing, model):
        hole(drawing)
        scales = {"xscale": 10 / UNITS[3], "yscale": 10 / UNITS[3]}
        model.add_blockref("HOLE", (0, 0), scales)

    assert read(draw, 3, square=False)[0].polygon.shape[1] < 100


def test_a_huge_circle_has_a_limited_number_of_points(read):
    draw = lambda drawing, model: model.add_circle((0, 0), 1e9)  # noqa: E731
    assert read(draw, square=False)[0].polygon.shape[1] <= 10_000


def test_a_piece_stored_as_a_block(read):
    def piece(drawing, model):
        corners = [(0, 0), (100, 0), (100, 100), (0, 100)]
        drawing.blocks.new("PIECE").add_polyline2d(corners, close=True)
        model.add_blockref("PIECE", (7, 7), {"layer": "CUT"})

    outline, said = read(piece, square=False, version="R12")
    assert outline.shape().area == pytest.approx(1e4)
    assert "states no unit" in said
    assert set(outline.edge_names[0]) == {"CUT"}  # as on layer 0 in the block


KINDS = {
    "HATCH": lambda m: m.add_hatch().paths.add_polyline_path([(4, 4), (9, 4), (9, 9)]),
    "MLINE": lambda m: m.add_mline([(40, 40), (60, 40), (60, 60)], close=True),
    "DIMENSION": lambda m: m.add_linear_dim((0, -9), (0, 0), (100, 0)).render(),
    "TEXT": lambda m: m.add_text("ply"),
    "POLYLINE": lambda m: m.add_polymesh((3, 3)),
    "empty LWPOLYLINE": lambda m: m.add_lwpolyline([(50, 50)]),
}


@pytest.mark.parametrize("kind", KINDS)
def test_other_entities_are_ignored_and_named(read, kind):
    outline, said = read(lambda drawing, model: KINDS[kind](model))
    assert outline.shape().area == pytest.approx(1e4)
    assert f"a.dxf: ignored: 1 {kind}" in said


def test_entities_of_unknown_types_are_ignored_and_named(tmp_path, caplog):
    drawing = ezdxf.new(units=4)
    add_square(drawing.modelspace())
    drawing.modelspace().add_point((3, 3))
    text = io.StringIO()
    drawing.write(text)
    unknown = text.getvalue().replace("\nPOINT\n", "\nSTITCH\n")
    (tmp_path / "a.dxf").write_text(unknown)
    Outline.from_dxf(tmp_path / "a.dxf")
    assert "a.dxf: ignored: 1 STITCH" in caplog.text


def off(drawing, model):
    drawing.layers.add("Guides").off()
    model.add_circle((50, 50), 20, {"layer": "GUIDES"})


def frozen(drawing, model):
    drawing.layers.add("GUIDES").freeze()
    model.add_circle((50, 50), 20, {"layer": "GUIDES"})


def invisible(drawing, model):
    model.add_circle((50, 50), 20, {"invisible": 1})


def by_reference(drawing, model):
    """Entities on layer 0 of a block are on the layer of the reference."""
    drawing.layers.add("GUIDES").off()
    hole(drawing)
    model.add_blockref("HOLE", (50, 50), {"layer": "GUIDES"})


def frozen_reference(drawing, model):
    drawing.layers.add("GUIDES").freeze()
    hole(drawing, layer="CUT")
    model.add_blockref("HOLE", (50, 50), {"layer": "GUIDES"})


@pytest.mark.parametrize(
    "draw", [off, frozen, invisible, by_reference, frozen_reference]
)
def test_what_is_not_visible_does_not_count_and_is_named(read, draw):
    outline, said = read(draw)
    assert not outline.holes
    assert "ignored: 1 hidden" in said


# Lengths of the units of $INSUNITS in mm, by the definitions of the units.
UNITS = {
    **{1: 25.4, 2: 304.8, 3: 1609344.0, 4: 1.0, 5: 10.0, 6: 1e3, 7: 1e6, 8: 2.54e-5},
    **{9: 0.0254, 10: 914.4, 11: 1e-7, 12: 1e-6, 13: 1e-3, 14: 1e2, 15: 1e4, 16: 1e5},
    **{17: 1e12, 18: 1.495978707e14, 19: 9.4607304725808e18, 20: 3.0856775814913673e19},
    **{21: 1200e3 / 3937, 22: 100e3 / 3937, 23: 3600e3 / 3937, 24: 6336e6 / 3937},
}


@pytest.mark.parametrize("code", UNITS)
def test_every_unit_has_its_length(read, code):
    def draw(drawing, model):
        add_square(model, 100 / UNITS[code] if UNITS[code] < 1 else 100)

    side = 100 if UNITS[code] < 1 else 100 * UNITS[code]
    outline, said = read(draw, code, square=False)
    assert outline.shape().area == pytest.approx(side**2, rel=1e-12)
    assert not said


def test_a_given_unit_decides(read):
    for code in (0, 4, 99):
        outline, said = read(nothing, code, unit="cm")
        assert outline.shape().area == pytest.approx(1e6)
        assert ("read in cm, but $INSUNITS states another unit" in said) == (code == 4)
    with pytest.raises(ValueError, match=r"unit 99 of \$INSUNITS is unknown: specify"):
        read(nothing, 99)


def in_space(drawing, model):
    model.add_line((0, 0, 0), (9, 9, 9), {"layer": "AXIS"})


def frame(drawing, model):
    add_square(model, 300.0, (-50.0, -50.0), layer="FRAME")


def test_a_frame_is_named_and_a_layer_chosen(read):
    outline, said = read(frame)
    assert outline.shape().area == pytest.approx(8e4)
    assert "the ply is 300 x 300 mm (layer 'FRAME')" in said
    assert "the hole(s) 100 x 100 mm (layer '0')" in said
    for layer in ("0", ["0"]):
        outline, said = read(frame, layer=layer)
        assert outline.shape().area == pytest.approx(1e4)
        assert not said
    assert read(frame, layer="frame")[0].shape().area == pytest.approx(9e4)
    assert read(in_space, layer="0")[0].shape().area == pytest.approx(1e4)
    with pytest.raises(ValueError, match=r"layer 'cut'; it has lines on '0', 'FRAME'"):
        read(frame, layer=["0", "cut"])


def test_a_tilted_plane_is_laid_flat(read):
    def tilted(drawing, model):
        plane = {"extrusion": (0, 0.6, 0.8)}
        add_square(model, **plane)
        model.add_circle((50, 50), 10, plane)

    outline, said = read(tilted, square=False)
    assert outline.shape().area == pytest.approx(1e4 - ROUND, abs=1.5)
    assert "tilted plane, which is laid flat" in said


def steep(drawing, model):
    model.add_circle((50, 50), 10, {"extrusion": (0, 0.6, 0.8)})


def open_line(drawing, model):
    model.add_line((-10, 50), (110, 50), dxfattribs={"layer": "CENTER"})


def two(drawing, model):
    add_square(model, 50.0, (200.0, 0.0))


def island(drawing, model):
    model.add_circle((50, 50), 30)
    model.add_circle((50, 50), 10)


def clipped(drawing, model):
    from ezdxf.xclip import XClip

    hole(drawing)
    XClip(model.add_blockref("HOLE", (50, 50))).set_block_clipping_path(
        [(-1, -1), (0, 1)]
    )


def lost(drawing, model):
    model.add_blockref("LOST", (0, 0))


def external(drawing, model):
    drawing.add_xref_def("other.dxf", "OTHER")
    model.add_blockref("OTHER", (0, 0))


def endless(drawing, model):
    hole(drawing).add_blockref("HOLE", (5, 5))
    model.add_blockref("HOLE", (50, 50))


def countless(drawing, model):
    hole(drawing)
    rows = {"row_count": 1000, "row_spacing": 3, "column_count": 200}
    model.add_blockref("HOLE", (0, 0), {**rows, "column_spacing": 3})


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (steep, "a curve on layer '0' does not lie in the plane of the others"),
        (open_line, r"1 line\(s\) end at \(-10, 50\) of layer 'CENTER'"),
        (two, r"has 2 pieces: 100 x 100 mm \(layer '0'\), 50 x 50 mm \(layer '0'\)"),
        (island, r"20 x 20 mm \(layer '0'\) is a piece in a hole of 100 x 100 mm"),
        (clipped, "the block 'HOLE' on layer '0' is clipped, which is not supported"),
        (lost, "the block 'LOST' on layer '0' is not in the file"),
        (external, "the block 'OTHER' on layer '0' is not in the file"),
        (endless, "the block 'HOLE' on layer '0' contains itself"),
        (countless, "has more than 100000 elements"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(read, draw, message):
    with pytest.raises(ValueError, match=message) as error:
        read(draw)
    assert "\n" not in str(error.value)


def test_a_drawing_of_ignored_entities_only_has_no_lines(read):
    def several(drawing, model):
        for kind in ("MLINE", "MLINE", "HATCH"):
            KINDS[kind](model)

    with pytest.raises(ValueError, match="has no lines; ignored: 2 MLINE, 1 HATCH"):
        read(several, square=False)
