"""Each bad input is refused in one line that names it."""

import sys

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Locking,
    MeshError,
    OnSurface,
    Ply,
    StepError,
    Tabulated,
    drape,
    equilibrium_near,
)
from skfem_textile.fabric.directions import directions_of
from skfem_textile.io import (
    read_surface,
    read_tool_mesh,
    write_directions,
    write_fibres,
    write_pattern,
)
from skfem_textile.mesh import overlap
from skfem_textile.scenes import Case, cylinder, double_dome, hemisphere, saddle
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers import sphere, tool_shapes
from tests.helpers.command_line import rejected
from tests.helpers.tools import (
    SPHERE,
    geodesic_u,
    plate,
    rolled,
    rolled_ply,
    run_words,
    square,
    write,
    write_sphere,
)

POINTS, TRIANGLES = sphere(30)
PLATE = drape.TriangleMesh(*tool_shapes.plate(200.0, 150.0, 25.0))
TURN = np.linspace(0, 2 * np.pi, 60, endpoint=False)


def refused(call, message, kind=ValueError):
    with pytest.raises(kind, match=message) as error:
        call()
    assert "\n" not in str(error.value)


# Nets, starts, courses and darts


def on_sphere(cell, *counts, **options):
    return drape.net(SPHERE, cell, *counts, **options)


def on_plate(**options):
    return drape.net(PLATE, 5.0, **{"point": (0, 0, 0)} | options)


STRAIGHT = np.array([[-50.0, 0, 50], [0, 0, 0], [0, 0, 0]])
RISING = np.array([[0.0, 20, 80], [0, 0, 0], [0, 0, 40]])


def best(**options):
    return drape.best_start(PLATE, **{"cell": 20.0, **options})


def laid(overlap):
    return drape.courses(PLATE, 5.0, 60.0, overlap, point=(0, 0, 0))


NETS = {
    "cell must be a positive length": lambda: on_sphere(0.0, (0, 8), (0, 8)),
    "warp must be two whole num": lambda: on_sphere(2.0, (0, 0.5), (0, 8)),
    "weft must be two whole num": lambda: on_sphere(2.0, (0, 8), (0, 0)),
    "not be parallel": lambda: on_sphere(1.0, (0, 1), (0, 1), angles=(0.3, 0.305)),
    "is outside the net, which extends from": lambda: on_sphere(5.0, (4, 8), (3, 8)).at(
        np.array([[100.0], [0.0]])
    ),
    "normal to the surface": lambda: drape.exponential_map(
        SPHERE, np.ones((2, 3)), first=(0, 0, 1)
    ),
    "beyond the edges of the tool: start on": lambda: on_plate(point=(120, 0, 0)),
    "specify the numbers of cells along the weft": lambda: on_sphere(1.0, (1, 1)),
    r"net: the start must be three finite.*got \(0, 0\)": lambda: on_plate(
        point=(0, 0)
    ),
    "passes the start .* a distance of 9 mm": lambda: on_plate(
        point=(2, 0, 0), warp_along=np.add(STRAIGHT, [[0], [9], [0]])
    ),
    "have two distinct points": lambda: on_plate(warp_along=np.ones((3, 4))),
    r"finite numbers of shape \(3, n\)": lambda: on_plate(warp_along=np.ones((2, 4))),
    "threads are parallel": lambda: on_plate(warp_along=STRAIGHT, weft_along=STRAIGHT),
    "mm away from the tool": lambda: on_plate(warp_along=RISING),
    "nets: specify at least one start": lambda: drape.nets(PLATE, 20.0, []),
    "`first` must be three finite numbers": lambda: drape.nets(
        PLATE, 20.0, [drape.NetStart((0, 0, 0), (np.nan, 0.0, 0.0))]
    ),
    "specify at least one point of the part": lambda: best(points=np.empty((3, 0))),
    "points must be finite numbers": lambda: best(points=np.zeros((2, 4))),
    "search cell must be a positive length": lambda: best(search_cell=-1.0),
    "measure must be one of largest, mean": lambda: best(measure="median"),
    "the overlap must be .* got -1": lambda: laid(-1.0),
    "the overlap must be .* got 60": lambda: laid(60.0),
    "is closed, and parallel threads meet at a": lambda: drape.courses(
        drape.TriangleMesh(30 * POINTS, TRIANGLES), 9.0, 12.0, point=(0, 0, 30)
    ),
    "locking angle must be between 0": lambda: drape.net_with_darts(PLATE, 4.0, 50.0),
}


@pytest.mark.parametrize("message", NETS)
def test_nets_that_do_not_exist_are_refused(message):
    refused(NETS[message], message)


# Surfaces and tools


def mesh_of(cell, points=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    return lambda: drape.ToolMesh(points, (np.array(cell)[:, None],))


SURFACES = {
    "radius must be a positive length": lambda: drape.Sphere(-1.0),
    "normal must not be zero": lambda: drape.Plane(normal=(0, 0, 0)),
    "must be three finite numbers": lambda: drape.Cylinder(1.0, (0, 0)),
    "between 0 and": lambda: drape.Cone(2.0),
    "must be smaller": lambda: drape.Torus(1.0, 2.0),
    "punch: radius must be a positive length": lambda: drape.Punch(-3.0),
    "fillet must be a positive length": lambda: drape.Die(3.0, 0.0),
    "waist at least 0 and less than 1": lambda: drape.double_dome(waist=1.0),
    "triangles must be": lambda: drape.TriangleMesh(POINTS[:, :9], TRIANGLES[:, :0]),
    "undefined vertex": lambda: drape.TriangleMesh(POINTS, TRIANGLES + 1),
    "finite": lambda: drape.TriangleMesh(POINTS[:2], TRIANGLES),
    "vertices, but at least": lambda: drape.TriangleMesh(POINTS, TRIANGLES[:, :2]),
    "shape": mesh_of([0, 0, 0], np.zeros((2, 3))),
    "no triangles or quadrilaterals": lambda: drape.ToolMesh(np.zeros((3, 3)), ()),
    "an undefined node": mesh_of([0, 1, 7]),
    "element 1 has zero area": mesh_of([0, 1, 1]),
    "must be finite": mesh_of([0, 1, 2], np.full((3, 3), np.nan)),
    "no boundary": lambda: drape.ToolMesh(POINTS, (TRIANGLES,)).boundary(),
    r"extend over .* mm: specify coordinates in mm": lambda: drape.TriangleMesh(
        1e160 * POINTS, TRIANGLES
    ),
    r"none\.stl: no such file": lambda: read_surface("none.stl"),
    r"gone\.stl: no such file": lambda: read_tool_mesh("gone.stl"),
}


@pytest.mark.parametrize("message", SURFACES)
def test_surfaces_that_do_not_exist_are_refused(message):
    refused(SURFACES[message], message, (ValueError, MeshError))


class Broken(drape.Plane):
    """A surface with invalid values."""

    def __init__(self, level):
        super().__init__()
        self.__dict__["level"] = level


def step(surface, ply=None, **options):
    names = {"a": OnSurface(surface, **options)}
    return lambda: LoadStepper(ply or square(), names, 1)


CONDITIONS = {
    "on another surface": lambda: LoadStepper(
        square(), {"a": OnSurface(SPHERE), "b": OnSurface(SPHERE, "top")}, 1
    ),
    "no boundary 'nowhere'": step(SPHERE, where="nowhere"),
    r"z = 0 at \(0.0, 0.0\), where it has no tangent": step(drape.Sphere(1.0)),
    "where it is 0.25 mm away: move": step(drape.Plane((0, 0, -0.25))),
    "where it is inclined by 37°: move": step(drape.Plane((0, 0, 0), (0, 3, 4))),
    r"where it is 0.12\d mm away": step(SPHERE, touch=(5.0, 0.0)),
    "'a'.*surface must have the methods level, gradient, hessian": step(5),
    "surface must have the methods level, gradient": step(drape.Sphere),
    "'a'.*must have the shape": step(Broken(lambda x: x)),
    "'a'.*level of the surface raised": step(Broken(lambda x: x[7])),
    "a surface requires a ply in space": step(
        drape.Plane(), ply=Ply(MeshQuad().refined(1), Fabric(1e4, 1.0))
    ),
}
CONDITIONS |= {
    f"initial_guess must be.*{word}": lambda guess=guess: LoadStepper(
        square(), hemisphere().conditions, initial_guess=guess
    )
    for word, guess in (("1", [0.0]), ("", "net"), ("finite", np.full(75, np.nan)))
}


@pytest.mark.parametrize("message", CONDITIONS)
def test_conditions_that_do_not_fit_are_refused(message):
    refused(CONDITIONS[message], message)


def test_plies_that_nothing_holds_or_that_cannot_stay_are_refused():
    ply = square()
    start = geodesic_u(ply, SPHERE)
    across = {"on": OnSurface(SPHERE), "held": Condition([0], (None, None, 0.0))}
    nowhere = Broken(lambda x: np.where(x[0] > 30, np.nan, x[2]))
    clamped = {"on": OnSurface(nowhere), "clamp": Condition("left")}
    for conditions, u, message in (
        (across, start, "already fix node"),
        (clamped, 0 * start, "cannot be projected onto the surface"),
    ):
        with pytest.raises(NoEquilibriumError, match=message):
            equilibrium_near(ply, conditions, u)
    slides = LoadStepper(ply, {"on": OnSurface(SPHERE)}, 1, max_halvings=1)
    with pytest.raises(StepError, match=r"mechanism|unstable"):
        slides.run()


# Exports: fibres on a tool and flat patterns


@pytest.fixture(scope="module")
def sheet():
    return drape.Sheet.of_ply(*rolled_ply(12))


def circle(n=60, radius=30.0, middle=50.0):
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return middle + radius * np.array([np.cos(t), np.sin(t)])


def flat_part():
    x, t = plate(5.0, 4, lambda x, y: 0 * x)
    return drape.ToolMesh(np.add(x, [[20], [50], [0]]), (t,))


BACK = np.array([50 + 30 * np.cos(TURN), 25 + 15 * np.cos(TURN)])
PATTERNS = [
    (rolled(circle(middle=80.0)), None, r"does not lie on \d+ of \d+ points"),
    (rolled(circle()) * 1e305, None, r"does not lie on \d+ of 60 points"),
    (rolled(BACK), None, "encloses no area"),
    (rolled(circle(4)), None, "specify more points"),
    (rolled(circle()), 1e-5, r"1.88e\+07 points, but at most 1000000"),
    (rolled(circle()), 1e-320, "inf points, but at most 1000000"),
    (circle(), None, r"shape \(3, n\)"),
    (np.full((3, 9), np.nan), None, "finite numbers"),
    (np.ones((3, 9)), None, "at least three distinct points"),
    (rolled(circle()), 0.0, "spacing must be a positive length"),
    *(
        (rolled(curve), None, r"crosses itself at \(.*a curve that")
        for curve in (
            50 + 30 * np.array([np.sin(2 * TURN + 0.01), np.sin(TURN)]),
            50 + 30 * np.array([np.sin(2 * TURN), np.sin(TURN)]),  # a point twice
            np.tile(circle(40), 2),
        )
    ),
]


@pytest.mark.parametrize(("curve", "spacing", "message"), PATTERNS)
def test_curves_that_bound_no_pattern_are_refused(sheet, curve, spacing, message):
    refused(lambda: drape.flat_pattern(sheet, curve, spacing), message)


def test_a_pattern_that_overlaps_or_cannot_be_checked_is_refused(sheet, monkeypatch):
    tube = drape.Cylinder(10.0, (0, 0, -10))
    around = drape.Sheet.of_net(drape.net(tube, 1.0, (45, 45), (10, 10)))
    ring = [10 * np.sin(TURN), 0 * TURN, 10 * np.cos(TURN) - 10]
    refused(
        lambda: drape.flat_pattern(around, ring), r"the outline jumps by 6\d.* mm at"
    )
    monkeypatch.setattr(overlap, "_MOST_PAIRS", 100)
    refused(
        lambda: drape.flat_pattern(sheet, rolled(circle(720))),
        "to determine whether it crosses itself",
    )


def test_holes_outside_the_outline_are_refused():
    """Across the outline, and beyond it."""
    net = drape.net(drape.Plane(), 5.0, (16, 20), (16, 16))
    outer, across, beyond = (
        np.pad(circle(60, r, m), ((0, 1), (0, 0)))
        for r, m in ((40, 0), (10, 28), (5, 60))
    )
    for hole in (across, beyond):
        refused(
            lambda hole=hole: drape.trimmed(net, outer, [hole]),
            "crosses the outline or another hole|lie on",
        )


def test_exports_that_are_not_possible_are_refused(sheet, tmp_path, monkeypatch):
    part, outline = flat_part(), circle()
    fibres = drape.fibres_on_tool(sheet, part, reach=20.0)
    plane = Ply(MeshQuad(), Fabric(1.0))
    pattern = drape.flat_pattern(sheet, rolled(outline))
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    for call, message in (
        (
            lambda: drape.fibres_on_tool(sheet, part, (0, 0, 0)),
            "axis must not be zero",
        ),
        (
            lambda: drape.fibres_on_tool(sheet, part, reach=-1.0),
            "reach must be a positive length",
        ),
        (lambda: drape.fibres_on_ply(plane, plane.basis.zeros()), "must be in space"),
        (lambda: write_fibres(tmp_path / "a.txt", fibres), "can be written only to"),
        (lambda: write_pattern(tmp_path / "a.txt", pattern), "can be written only to"),
        (lambda: write_pattern(tmp_path / "a.svg", []), "no pattern to write"),
        (
            lambda: write_pattern(tmp_path / "a.dxf", pattern),
            r"a \.dxf file requires ezdxf",
        ),
    ):
        refused(call, message, (ValueError, ImportError))
    assert list(tmp_path.iterdir()) == []


# Scenes


def table_from_zero(scene):
    law = Tabulated(np.radians([0, 60]), [0, 0.2])
    fabric = Fabric(1e4, law, scene.warp, scene.weft)
    stepper = Case(scene=scene, fabric=fabric, steps=1).stepper()
    stepper.max_halvings = 0
    return stepper.run()


def locked(degrees):
    scene = hemisphere(size=(4, 4))
    fabric = Fabric(1e4, Locking(0.1, np.radians(degrees)))
    return Case(scene=scene, fabric=fabric, steps=1).run()


CORNER = MeshTri(np.array([[-90.0, 90, 90], [-50, -90, 90]]), np.array([[0], [1], [2]]))
TRAPEZIUM = MeshQuad(np.array([[0, 9, 8, 1], [0, 0, 9, 9.0]]), [[0], [1], [2], [3]])
SCENES = {
    "hemisphere: the width must be positive": lambda: hemisphere(width=0.0),
    "saddle: the height must be positive": lambda: saddle(height=np.nan),
    "saddle: radius must be a positive length": lambda: saddle(radius=-1.0),
    "radius must be a positive length": lambda: cylinder(radius=0.0),
    "edge tension must be 0 or positive": lambda: double_dome(tension=-1.0),
    "angle of the fibres must be finite": lambda: cylinder(fibres=np.inf),
    "use the whole ply": lambda: cylinder(fibres=0.3, part="quarter"),
    "lower left corner of the mesh of a quarter must be at the o": lambda: hemisphere(
        rectangle(40, 40, (2, 2)).translated((1, 0))
    ),
    "origin must be inside the mesh of a whole ply": lambda: hemisphere(
        rectangle(40, 40, (2, 2)), part="whole"
    ),
    "the mesh of a quarter has no straight left edge": lambda: hemisphere(TRAPEZIUM),
    "no three such nodes: refine the mesh": lambda: hemisphere(CORNER, part="whole"),
    "beyond the domain of the shear law": lambda: locked(40),
    "a table that starts at 0 requires odd=True": lambda: table_from_zero(
        hemisphere(size=(2, 2), part="whole", tension=0.0)
    ),
}


@pytest.mark.usefixtures("no_interval")
@pytest.mark.parametrize("message", SCENES)
def test_settings_that_do_not_fit_a_tool_are_refused(message):
    refused(SCENES[message], message, (ValueError, MeshError, StepError))


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("hemisphere", "--fibres", "nan"), "--fibres must be a finite number"),
        (
            ("hemisphere", "--width", "320", "--height", "320"),
            "the kinematic net folds",
        ),
        (
            ("hemisphere", "--set", "shear.wrinkling_angle_deg=91"),
            "shear.wrinkling_angle_deg must be a number <= 90",
        ),
        (("saddle", "--rotate", "10"), "unrecognized arguments: --rotate 10"),
    ],
)
def test_bad_options_of_a_scene_are_refused(options, reason, tmp_path, capsys):
    words = "run", *options, "--size", "4x4", "--no-render"
    assert reason in rejected(capsys, *words, "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_directions_of_a_file_do_not_replace_those_of_a_tool(tmp_path, capsys):
    mesh, file = hemisphere(size=(4, 4)).mesh, tmp_path / "turned.csv"
    turned = Fabric(1e4, 0.1, warp=(2.0, 1.0), weft=(-1.0, 2.0))
    write_directions(file, mesh, directions_of(mesh, turned))
    line = "run", "hemisphere", "--size", "4x4", "--directions", str(file)
    error = rejected(capsys, *line, "--out", str(tmp_path / "out"))
    assert "scene hemisphere: set --fibres" in error


# Tools from files, from the command line


def invalid_tools(folder):
    """Invalid files of tools, the expected messages, and the numbers of warnings."""
    x, t = plate(n=15)
    yield folder / "no.stl", "no.stl: no such file", 0
    empty = folder / "empty.stl"
    empty.write_text("solid nothing\nendsolid nothing\n")
    yield empty, "empty.stl: the file contains no triangles", 0
    bad = x.copy()
    bad[2, 5] = np.nan
    yield write(folder / "nan.stl", bad, t), "far from all others", 0
    steep = plate(n=15, height=lambda x, y: 0.3 * x)
    yield write(folder / "steep.stl", *steep), "is at its edge or on a slope", 0
    metres = write(folder / "metres.stl", 1e-3 * x, t)
    yield metres, "use a smaller ply, or specify the unit of the tool file", 1
    for scale in (1e3, 1e30):
        large = write(folder / f"{scale:g}.stl", scale * x, t)
        yield large, "use a larger ply, or specify the unit of the tool file", 1


def test_invalid_tools_are_refused(tmp_path, capsys):
    for file, reason, warnings in invalid_tools(tmp_path):
        words = run_words(tmp_path / "out", tool=file)
        assert reason in rejected(capsys, *words, warnings=warnings)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("coarse_net", "no_interval")
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--point", "0", "0", "nan"), "--point must be a finite number"),
        (("--point", "0", "0", "90"), "specify a point on the tool"),
        (("--point", "0", "0", "1e306"), "specify a point on the tool"),
        (("--point", "130", "0", "0"), "the contact point of the ply, (129.6"),
        (("--point", "0", "0"), "expected 3 arguments"),
        (("--part-mesh", "none.stl"), "--part-mesh none.stl: no such file"),
        (("--trim", "none.csv"), "--trim none.csv: no such file"),
        (("--trim", "CURVE"), "curve.csv: the curve has 2 different points, but at"),
    ],
)
def test_bad_options_of_a_tool_are_refused(tool, options, reason, tmp_path, capsys):
    curve = tmp_path / "curve.csv"
    curve.write_text("x,y,z\n0,0,0\n1,0,0\n0,0,0\n")
    options = [str(curve) if word == "CURVE" else word for word in options]
    assert reason in rejected(capsys, *run_words(tmp_path / "out", *options, tool=tool))
    assert not (tmp_path / "out").exists()


def test_a_bending_stiffness_is_required_without_a_net(tmp_path, capsys):
    file = write_sphere(tmp_path / "ball.stl", 500)
    large = "--width", "330", "--height", "330", "--tension", "2"
    words = run_words(tmp_path / "out", *large, tool=file)
    _, warning, message = rejected(capsys, *words, warnings=2).splitlines()
    assert "their net folds at" in warning
    assert "give the fibres a bending stiffness" in message


def test_the_part_of_a_closed_tool_needs_a_curve(tmp_path, capsys):
    """Not around the tool, and not along an arc and back."""
    ball = write_sphere(tmp_path / "ball.stl", 300, 30.0, (0, 0, 0))
    words = ("net", "--tool", str(ball), "--out", str(tmp_path / "out"))
    assert "specify --trim" in rejected(capsys, *words, warnings=1)
    file = write(tmp_path / "tube.stl", *tool_shapes.tube())
    for turn, message in (
        (TURN, "trim.csv: part: the curve runs around the tool and bounds no"),
        (np.hstack([TURN[:8], TURN[6:0:-1]]), "no triangle of the tool is inside the"),
    ):
        ring = np.array([30 * np.cos(turn), 30 * np.sin(turn), 45 + 0 * turn]).T
        np.savetxt(tmp_path / "trim.csv", ring, delimiter=",", header="x,y,z")
        words = ("net", "--tool", str(file), "--trim", str(tmp_path / "trim.csv"))
        assert message in rejected(capsys, *words, "--out", str(tmp_path / "out"))
