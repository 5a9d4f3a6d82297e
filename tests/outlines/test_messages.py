"""Outlines, fabrics and sizes that cannot be meshed are refused in one line."""

import numpy as np
import pytest
import shapely
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Outline,
    Traction,
    mesh_along_fibres,
    mesh_outline,
    singular_fibres,
)
from skfem_textile.outlines import fibres as module
from skfem_textile.outlines.triangles import triangles
from tests.helpers import refused
from tests.outlines.test_cases import SVG, case, coupon  # noqa: F401
from tests.outlines.test_fibres import HELD_ALONG_ALL_SIDES, STRIP, W, bias, rectangle
from tests.outlines.test_outline import SQUARE, at

OUTLINES = {
    "crosses": ({"polygon": [[0, 1, 1, 0], [0, 1, 0, 1]]}, r"itself at \(0.5, 0.5\)"),
    "touches itself": (
        {"polygon": [[0, 2, 2, 1, 0], [0, 0, 2, 0, 2]]},
        r"touches itself at \(1, 0\)",
    ),
    "no area": ({"polygon": [[0, 1, 2], [0, 1, 2]]}, r"no area, at \(0, 0\)"),
    "coincident": ({"polygon": [[0, 1, 1, 0], [0, 0, 0, 1]]}, r"corners at \(1, 0\)"),
    "not finite": ({"polygon": [[0, 1, np.nan], [0, 0, 1]]}, "corner 2 is not finite"),
    "huge": ({"polygon": [[0, 1e200, 0], [0, 0, 1]]}, "corner 1 is not finite, or too"),
    "shape": ({"polygon": [[0, 1], [0, 0]]}, r"n >= 3, not \(2, 2\)"),
    "text": ({"polygon": [["a"], ["b"]]}, "must be real-valued"),
    "hole outside": ({"holes": [at(200, 0)]}, r"outside .* near \(200, 10\)"),
    "hole at a corner": (
        {"holes": [[[100, 80, 90], [50, 45, 60]]]},
        r"hole touches or crosses the outer polygon at \(100, 50\)",
    ),
    "holes touch": (
        {"holes": [at(20, 20), at(30, 30)]},
        r"hole 1 and hole 2 touch or overlap at \(30, 30\)",
    ),
    "hole in hole": ({"holes": [at(20, 20, 40), at(30, 30)]}, "hole 1 and hole 2"),
    "unknown edge": ({"names": {"a": [4]}}, r"ring 0 has the edges 0 to 3, got \[4\]"),
    "unknown ring": ({"names": {"a": (1, [0])}}, "there is no ring 1"),
    "not edges": ({"names": {"a": "bottom"}}, "edges 'a' must be numbers of edges"),
    "fractions": ({"names": {"a": [0.5]}}, "edges 'a' must be numbers of edges"),
    "no edges": ({"names": {"a": []}}, "ring 0 has the edges 0 to 3"),
    "point outside": ({"points": {"a": (101, 0)}}, r"point 'a' at \(101, 0\) lies out"),
    "point in hole": (
        {"holes": [at(40, 40)], "points": {"a": (45, 45)}},
        "point 'a' .* lies outside",
    ),
    "no point": ({"points": {"a": 3.0}}, r"finite pair \(x, y\)"),
    "region outside": ({"regions": {"a": at(100, 0)}}, "region 'a' .* lies outside"),
    "regions overlap": (
        {"regions": {"a": at(20, 20), "b": at(25, 25)}},
        r"regions 'a' and 'b' overlap near \(",
    ),
}


@pytest.mark.parametrize("name", OUTLINES)
def test_bad_outlines_are_refused(name):
    given, message = OUTLINES[name]
    refused(lambda: Outline(**{"polygon": SQUARE, **given}), message)


# Singular fibres


def source(x):
    return x - np.reshape((33.3, 44.4), (2,) + (1,) * (x.ndim - 1))


def turning(x):
    a = 0.03 * x[0]
    return np.stack([np.cos(a), np.sin(a)])


def undefined(x):
    return np.where(x[1] > 50, np.nan, 1.0) * np.ones_like(x)


PLY = rectangle(W, W, points={"p": (50, 50)})
FIBRES = {
    "numbers": ({"conditions": {"a": Condition([1, 2])}}, "'a': nodes are not known"),
    "name": (
        {"conditions": {"a": Condition("clamp")}},
        "'a': the outline has no edges or point 'clamp' .*'bottom'.*'p'",
    ),
    "nowhere": (
        {"conditions": {"a": Condition(lambda x: x[0] > 200)}},
        "'a': where selects none of the points of the outline",
    ),
    "no bool": (
        {"conditions": {"a": Condition(lambda x: x[0])}},
        "'a': where must return one bool for each position",
    ),
    "raises": (
        {"conditions": {"a": Condition(lambda x: x[5])}},
        "'a': where raised IndexError",
    ),
    "no condition": ({"conditions": {"a": "bottom"}}, "must be a Condition"),
    "no mapping": ({"conditions": [Condition("bottom")]}, "must be a mapping"),
    "traction": (
        {"loads": [Traction("clamp", (0, 1))]},
        "load 'traction on clamp': the outline has no edges 'clamp'",
    ),
    "force": ({"loads": [Force([3], (0, 1))]}, "load 'force': nodes are not known"),
    "region": ({"fabrics": {"r": bias(3)}}, "no region 'r' .available: none."),
    "fabric": ({"fabric": "glass"}, "the outline requires a Fabric, not str"),
    "per element": (
        {"fabric": Fabric(1e9, warp=np.ones((2, 5)), weft=(0, 1))},
        "warp: directions per element belong to a mesh",
    ),
    "source": (
        {"fabric": Fabric(1e9, 0.5, source, lambda x: source(x)[::-1] * [[1], [-1]])},
        r"warp has a source or a centre near \(33.3, 44.4\)",
    ),
    "parallel": (
        {"fabric": Fabric(1e9, 0.5, turning, (1, 1))},
        r"warp and weft are parallel at \(2[56]\.",
    ),
    "not finite": (
        {"fabric": Fabric(1e9, 0.5, undefined, (0, 1))},
        r"warp must be a non-zero finite .*; it is not at \(\S+, 5[01]",
    ),
    "field raises": (
        {"fabric": Fabric(1e9, 0.5, lambda x: x[7], (0, 1))},
        "warp raised IndexError",
    ),
    "motion": (
        {"conditions": {"a": Condition("top", lambda x, t: x[5])}},
        "'a': the value raised IndexError",
    ),
    "finest": ({"finest": -1.0}, "finest must be a positive number of mm, got -1"),
}


@pytest.mark.parametrize("name", FIBRES)
def test_input_without_singular_fibres_is_refused(name):
    bad, message = FIBRES[name]
    given = {"outline": PLY, "fabric": bias(30), **bad}
    refused(lambda: singular_fibres(**given), message)


def test_too_many_fibres_are_refused(monkeypatch):
    monkeypatch.setattr(module, "MOST_LINES", 50)
    refused(
        lambda: singular_fibres(STRIP, bias(41), HELD_ALONG_ALL_SIDES, finest=1e-3),
        r"more than 50 singular .* from \(\d",
    )


# Meshes


def along(outline=SQUARE, warp=(1, 0), weft=(0, 1), spacing=10.0):
    return lambda: mesh_along_fibres(outline, warp, weft, spacing)


def meshed(outline=None, fabric=None, held=(), **options):
    outline = outline or rectangle(50, 100)
    held = {"bottom": Condition("bottom"), **dict(held)}
    return lambda: mesh_outline(outline, fabric or bias(45), held, **options)


PINS = {"A": (25.0, 50.0), "B": (25.3, 50.0)}
SMALL = "the spacing is too small: the mesh would have about"
MESHES = [
    (
        along(Outline(SQUARE, regions={"patch": at(20, 20)})),
        "have no regions: use mesh_outline",
    ),
    (along(weft=(-2, 0)), "parallel"),
    (along(warp=(0, 0)), "warp must be a non-zero finite vector"),
    (along(warp=lambda x: x), "warp"),
    (along(spacing=0.0), "spacing must be positive"),
    (along(spacing=(1.0, np.inf)), "spacing must be positive"),
    (along(spacing=1e-30), SMALL),
    (along(warp=(1, 1), weft=(-1, 1), spacing=(1.0, 1e-7)), SMALL),
    (meshed(density=1000.0), "choose a smaller one"),
    (meshed(fabric={"rest": bias(45)}), "must be a Fabric, not dict"),
    (
        lambda: rectangle(50, 100, regions={"rest": [[1, 9, 5], [1, 1, 9]]}),
        "must not be named 'rest'",
    ),
    (
        meshed(
            rectangle(50, 100, points=PINS),
            held={name: Condition(name) for name in PINS},
            size=10.0,
        ),
        "point 'B' at",
    ),
    *((meshed(density=x), "density must be positive") for x in (0.0, np.nan, np.inf)),
    (lambda: triangles(shapely.box(0, 0, 9, 9), [], 1e-5), "choose a larger one"),
    (
        lambda: triangles(
            shapely.box(0, 0, 50, 100) - shapely.box(1e-3, 40, 10, 60), [], 5.0
        ),
        r"gap of 0.001 mm at \(.*\) is too narrow",
    ),
    (
        lambda: Outline.of_mesh(MeshQuad().refined(1).restrict(np.array([0, 2]))),
        r"4 line\(s\) end at \(0.5, 0.5\)",
    ),
]


@pytest.mark.parametrize(("call", "message"), MESHES)
def test_what_cannot_be_meshed_is_refused(call, message):
    refused(call, message)


# Cases


CASES = [
    ("strip", {}, "mesh.outline applies to the scene specimen and to"),
    ("specimen", {"size": [3, 4]}, "mesh.size does not apply to a graded mesh"),
    ("specimen", {"source": "aligned"}, "mesh.outline does not apply to the mesh"),
    ("specimen", {"layer": ["cut"]}, "no visible lines on the layer 'cut'"),
    ("specimen", {"unit": "ft"}, r"mesh\.unit"),
    ("specimen", {"density": 0.0}, "density must be positive"),
    ("specimen", {"density": 1e9}, "choose a smaller one"),
    ({"name": "specimen", "width_mm": 80.0}, {}, "width_mm does not apply"),
    (
        {"name": "specimen", "move_mm": {"side": [0.0, 0.0]}},
        *({}, "no boundary 'side'"),
    ),
    ("specimen", {"outline": None, "unit": "cm"}, r"requires mesh\.outline"),
    ("specimen", {"outline": None, "layer": ["outer"]}, r"requires mesh\.outline"),
    (
        "specimen",
        {"outline": None, "source": "irregular", "density": 2.0},
        r"mesh\.density does not apply to the mesh",
    ),
    *(
        (
            name,
            {"outline": None, "source": "graded"},
            "applies to scenes in the plane only",
        )
        for name in ("hemisphere", "cantilever")
    ),
]


@pytest.mark.parametrize(("scene", "mesh", "message"), CASES)
def test_keys_that_do_not_suit_a_drawing_are_refused(
    coupon,  # noqa: F811
    scene,
    mesh,
    message,
):
    keys = {"outline": coupon, **mesh}
    keys = {name: value for name, value in keys.items() if value is not None}
    refused(lambda: case(scene, keys), message)


SQUARES = [
    f"{number},{x},{y}"
    for number, (a, b) in enumerate([(0, 90), (10, 80), (20, 70)])
    for x, y in [(a, a), (b, a), (b, b), (a, b)]
]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (SQUARES, "is a piece in a hole of .*: remove the other curves"),
        ([*SQUARES[:4], "1,95,0", "1,99,0", "1,99,9"], "a ply is one: remove the"),
        (SQUARES[:8], ""),
    ],
)
def test_messages_about_tables_name_no_layers(tmp_path, caplog, rows, message):
    (tmp_path / "ply.csv").write_text("\n".join(["curve,x,y", *rows]))
    if message:
        refused(lambda: Outline.from_file(tmp_path / "ply.csv"), message)
    else:
        Outline.from_file(tmp_path / "ply.csv")
        assert "(curve 1); remove curves if this is not so" in caplog.text
    assert "layer" not in caplog.text


def test_files_that_are_no_drawings_in_mm_are_refused(tmp_path):
    """A drawing in metres, one of another kind, a drawing as a mesh, and a mesh."""
    metres, other = tmp_path / "metres.svg", tmp_path / "ply.dwg"
    mesh_file = tmp_path / "mesh.dxf"
    mesh_file.write_text("*NODE\n1, 0, 0\n")
    metres.write_text(SVG.replace("50mm", "0.05mm").replace("100mm", "0.1mm"))
    other.write_bytes(b"AC1032")
    for mesh, message in (
        ({"outline": str(metres)}, r"extends over 0.1 mm: .* \(mesh\.unit\)"),
        (
            {"outline": str(other)},
            r"ply\.dwg contains no DXF or SVG drawing: an outline is read from \.dxf,",
        ),
        ({"outline": str(mesh_file)}, r"mesh\.dxf contains no DXF or SVG drawing"),
        ({"source": str(mesh_file)}, r"mesh\.dxf: \.dxf files are not supported"),
        ({"source": str(metres)}, r"is a drawing: name it in mesh\.outline"),
    ):
        refused(lambda mesh=mesh: case(mesh=mesh), message)
