"""Invalid meshes, sides, angles and moves of scenes are refused by name."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad

from skfem_textile import MeshError
from skfem_textile.calibration import BiasExtension, PictureFrame
from skfem_textile.mesh.scikit_fem import with_names
from skfem_textile.scenes import (
    bias_extension,
    buckling,
    cantilever,
    picture_frame,
    specimen,
    strip,
    trellis,
)
from skfem_textile.scenes.drape import _refuse_sizes
from skfem_textile.scenes.rectangle import in_planes, rectangle
from skfem_textile.scenes.trellis import sheared

STEEP = {"warp": np.radians(60), "weft": np.radians(120)}
SKEW = MeshQuad(np.array([[0, 1, 1.2, 0.2], [0, 0, 1, 1.0]]), [[0], [1], [2], [3]])
UNNAMED = with_names(strip().mesh, None, None)
TURNED = trellis().rotated(0.3).mesh
TURNED = MeshQuad(TURNED.p, TURNED.t).with_boundaries({"top": np.array([0])})
LOW = rectangle(50, 90, (4, 8))
WAVE = lambda s, t: 8 * t * (1 - t) + 0 * s, lambda s, t: 0 * s
HELD = ("bottom", (0, 0))

BIAS = [
    ({"shear_angle": np.radians(95)}, "between 0 and 90 degrees, got 95"),
    ({"shear_angle": np.radians(61), **STEEP}, "between 0 and 60 degrees, got 61"),
    ({"mesh": LOW}, "at least 100 mm high, not 90 mm"),
    (
        {"mesh": rectangle(25, 100, (4, 8)), "part": "half", **STEEP},
        r"at least 173\.205 mm high, not 100 mm",
    ),
    ({"width": 80.0, "height": 150.0}, "must be at least 160 mm high"),
    *(
        (
            {"warp": np.radians(warp), "weft": np.radians(weft)},
            "symmetric about the loading direction",
        )
        for warp, weft in ((40, 130), (135, 45), (0, 180))
    ),
    ({"warp": np.nan, "weft": 2.4}, "symmetric about the loading direction"),
    ({"part": "third"}, "unknown part 'third': choose one of whole, half"),
    (
        {"mesh": rectangle(50, 100, (4, 8)).translated((1.0, 0.0))},
        "corner of the mesh must be at the origin",
    ),
]
NO_SIDES = {"left": 0.3, "right": 0.2, "top": "free", "bottom": "free"}
TRELLIS = [
    ({"edges": {"lid": "free"}}, "unknown side 'lid': choose one of top, right"),
    *(
        ({"edges": {"left": edge}}, "the left side must be 'held', 'free' or")
        for edge in (np.nan, "loose", None)
    ),
    ({"edges": NO_SIDES}, "no side is held: hold at least one"),
    (
        {"mesh": TURNED, "edges": {"left": "free"}},
        "no straight left edge: name a boundary 'left'",
    ),
    (
        {"warp": 0.0, "weft": np.radians(30), "turns": sheared(np.radians(31))},
        "would fold",
    ),
    ({"turns": WAVE}, r"shear by .* degrees at load factor 0\.3"),
    ({"warp": 0.3, "weft": 0.3}, "parallel"),
]
NO_MOVE = "no boundary has a prescribed displacement"
SPECIMEN = [
    ({"moves": []}, NO_MOVE),
    ({"moves": [("top", ("free", "free"))]}, NO_MOVE),
    ({"moves": [("lid", (0, 0))]}, "no boundary 'lid': its boundaries are 'left'"),
    ({"moves": [HELD, HELD]}, "the displacement of 'bottom' is given twice"),
    (
        {"moves": [("top", (0, np.inf))]},
        "of 'top' must be finite, got inf mm",
    ),
    ({"moves": [("top", (0, "up"))]}, "must be a number or 'free', got 'up'"),
    (
        {"driven": "left"},
        "'left' has no prescribed displacement: choose one of bottom, top",
    ),
    ({"width": 0.0}, "the width must be positive, got 0 mm"),
    ({"height": np.nan}, "the height must be positive, got nan mm"),
    (
        {"mesh": rectangle(50, 100, (2, 4), "aligned"), "moves": [("seam", (0, 0))]},
        "no boundary 'seam'",
    ),
]
STRIP = [
    ({"mesh": UNNAMED.translated((0, 5))}, "must lie on y = 0"),
    ({"mesh": UNNAMED.scaled(10.0)}, "mm high, not 600 mm"),
    ({"mesh": MeshHex()}, r"must be a skfem.MeshQuad or a skfem.MeshTri"),
    ({"mesh": "diagonal"}, "unknown mesh 'diagonal'"),
    ({"size": (0, 15)}, "at least 1x1"),
    ({"jitter": 1.0}, "jitter must be at least 0"),
]
OTHERS = [
    *(
        (picture_frame, {"shear_angle": np.radians(degrees)}, "would fold")
        for degrees in (90.0, 360.0)
    ),
    (picture_frame, {"side": 140.0, "frame": 100.0}, "longer than the side of the fr"),
    (cantilever, {"length": 0.0}, "length must be positive"),
    (cantilever, {"weight": np.inf}, "weight must be positive"),
    (buckling, {"shortening": 1.0}, "between 0 and 1"),
    (buckling, {"push": np.nan}, "push must be a finite number"),
    (buckling, {"mesh": SKEW}, "no straight left edge"),
    (cantilever().rotated, {"angle": 0.3}, "cannot be rotated"),
    (PictureFrame, {"frame": 100.0, "fabric": 120.0}, "longer than the side of the"),
    (PictureFrame, {"frame": 0.0, "fabric": 1.0}, "side of the frame must be"),
    (BiasExtension, {"width": np.nan, "height": 90.0}, "width must be"),
    (BiasExtension, {"width": 50.0, "height": 90.0}, "must be at least 100 mm high"),
    *(
        (BiasExtension, {"width": 50.0, "height": 900.0, "inclination": angle}, text)
        for angle, text in (
            (np.pi / 2, "degrees, got 90"),
            (np.radians(-45), "degrees, got -45"),
            (np.nan, "degrees, got nan"),
        )
    ),
]
ROWS = [
    *((bias_extension, *row) for row in BIAS),
    *((trellis, *row) for row in TRELLIS),
    *((specimen, *row) for row in SPECIMEN),
    *((strip, *row) for row in STRIP),
    *OTHERS,
]


@pytest.mark.parametrize(("make", "arguments", "text"), ROWS)
def test_a_scene_is_refused(make, arguments, text):
    with pytest.raises(ValueError, match=text) as raised:
        make(**arguments)
    if not isinstance(arguments.get("mesh", ""), str):
        assert isinstance(raised.value, MeshError)


@pytest.mark.parametrize(
    ("area", "text"),
    [(1.5, ""), (3.0, "a smaller ply"), (3e-5, ""), (3e-6, "a larger ply")],
)
def test_a_ply_of_another_size_than_its_tool_is_refused(area, text):
    ply = MeshQuad().scaled(area**0.5)
    with pytest.raises(ValueError, match=text) if text else nullcontext():
        _refuse_sizes(SimpleNamespace(area=1.0), ply)


@pytest.mark.parametrize(("off", "text"), [(3e-7, ""), (3e-6, "at the origin")])
def test_a_quarter_is_at_the_origin_up_to_rounding(off, text):
    mesh = rectangle(1, 1, (2, 2)).translated((off, 0.0))
    with pytest.raises(MeshError, match=text) if text else nullcontext():
        in_planes("hemisphere", mesh)
