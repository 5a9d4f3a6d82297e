"""Bad input of tools, holders and their scenes is refused in one line."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import meshio
import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Fabric,
    Holder,
    LoadStepper,
    MeshError,
    Ply,
    Tool,
    contact,
    drape,
)
from skfem_textile.cases import case_from_tables
from skfem_textile.drape import TriangleMesh
from skfem_textile.io import read_surface
from skfem_textile.scenes import double_dome_forming, forming, hemisphere_forming
from tests.cases.test_tools import (
    DIE,
    HOLDER,
    PUNCH,
    graph_file,
    tables,
)
from tests.contact.test_tools import punch, ring
from tests.helpers import forming as formed
from tests.helpers import graph
from tests.helpers.forming import GAP, SYMMETRY, bowl
from tests.scenes.test_forming import SMALL, case, run

blank = partial(formed.blank, 2, bending=0.0)


def refused(call, message, kind=ValueError):
    with pytest.raises(kind, match=message) as error:
        call()
    assert "\n" not in str(error.value)


LAW = contact.Compaction(0.3, 1e-3, 8.0)


@dataclass
class Law:
    """A user's law of compaction."""

    pressure_at: Callable
    free: float = 0.3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: contact.Compaction(0.3, 1e-3, 0.0), "compaction: exponent must be"),
        (
            lambda: contact.MeasuredCompaction((0.2, 0.3), (0.0, 1.0)),
            "decreasing thicknesses",
        ),
        (
            lambda: contact.MeasuredCompaction((0.3, 0.2), (0.1, 1.0)),
            "increase from 0 N/mm2",
        ),
        (lambda: contact.MeasuredCompaction((0.3,), (0.0,)), "as many of both"),
    ],
)
def test_invalid_laws_of_compaction(make, message):
    refused(make, message)


# Tools and holders of a ply


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: punch(side=2), "side must be 1, -1 or None"),
        (lambda: punch(thickness=-1.0), "thickness must not be negative"),
        (
            lambda: punch(motion=np.eye(3)),
            r"final translation of three .* got array\(\[\[1., 0., 0.\], \[0.",
        ),
        (
            lambda: punch(motion=lambda t: (2 * np.eye(3), np.zeros(3))),
            "not a rotation",
        ),
        (
            lambda: Holder(drape.Plane(), gap=1.0, side=1, name="a\\b"),
            "tool 'a.*b': the name contains .*, which names of files and columns can",
        ),
        (
            lambda: punch(motion=(0, 0, -1e200)),
            r"'punch': motion is 1e\+200 mm at load factor 1: check its unit",
        ),
        (lambda: punch(outline=[[0, 1], [0, 1]]), "at least three corners"),
        (lambda: Tool(drape.Plane()), "in the plane of the undeformed ply"),
        (
            lambda: Tool(drape.Sphere(20.0, (30, 30, -19)), stated=lambda x: x + 100),
            r"crosses the undeformed ply: node \d+ at \(130, 130, 100\) mm is 1 mm",
        ),
        (
            lambda: Tool(drape.Plane((0, 0, 1)), outline=[[500, 600, 600], [0, 0, 9]]),
            "no node of the undeformed ply is within its edges or outline",
        ),
        (
            lambda: Tool(drape.Sphere(9.0), outline=[[0, 9, np.nan], [0, 0, 9]]),
            "outline must be finite",
        ),
        (
            lambda: punch(friction=-0.1),
            r"'punch': friction must be .* 0 to 2, got -0.1",
        ),
        (lambda: punch(friction=20), "friction must be a number from 0 to 2, got 20"),
        (
            lambda: punch(friction=lambda t: 3 * t),
            r"friction must be a number from 0 to 2, got .* at load factor 0\.675",
        ),
        (
            lambda: punch(friction=0.1, elastic_slip=0.0),
            "elastic_slip must be a finite number > 0, got 0",
        ),
        (
            lambda: punch(friction=0.1, elastic_slip=[0.1, 0.2]),
            r"'punch': friction: elastic_slip must be .* got \[0.1, 0.2\]",
        ),
        (
            lambda: Holder(drape.Plane(), side=1),
            "either a gap, a pressure or a force",
        ),
        (
            lambda: Holder(drape.Plane(), gap=1.0, force=1.0, side=1),
            "either a gap, a pressure or a force",
        ),
        (
            lambda: Holder(drape.Plane(), force=1.0, side=1),
            "holder 'holder': a force requires a law of compaction .*: set comp",
        ),
        (
            lambda: Holder(drape.Plane(), pressure=1.0, compaction=LAW, side=1),
            "'holder': a law of compaction requires a force: set force, or omit comp",
        ),
        (
            lambda: Holder(drape.Plane(), force=-1.0, compaction=LAW, side=1),
            "force must be a number of at least 0 N, got -1",
        ),
        (
            lambda: Holder(drape.Plane(), force=1.0, compaction=0.3, side=1),
            "'holder': compaction must be a law of compaction, .* got 0.3",
        ),
        *(
            (
                lambda law=law: Holder(
                    drape.Plane(), force=1.0, compaction=law, side=1
                ),
                f"'holder': law of compaction{message}",
            )
            for law, message in (
                (
                    Law(lambda t: np.full(t.shape, np.nan)),
                    ": the pressure must be finite",
                ),
                (
                    Law(lambda t: 1.0),
                    ": the pressure must be finite, a number for each",
                ),
                (Law(lambda t: t - 0.3), ": the pressure must fall with the thickness"),
                (
                    Law(lambda t: 0.3 / t),
                    ": the .* must fall .* to 0 at 0.3 mm, got 2.5 to 1 N",
                ),
                (Law(lambda t: 1 / 0), " raised ZeroDivisionError"),
                (
                    Law(lambda t: 0.3 / t - 1, free=-1.0),
                    ": free must be a finite number",
                ),
            )
        ),
        (
            lambda: Holder(
                *(drape.Plane(), None, None, lambda t: 100 * t),
                Law(lambda t: 1e-3 * np.maximum(1 - t / 0.3, 0.0)),
                side=1,
            ),
            "^holder 'holder': its law of compaction carries less than the force 100 N",
        ),
        (lambda: Holder(drape.Plane(), gap=-0.1, side=1), "at least 0 mm"),
        (lambda: Holder(drape.Plane(), gap=True, side=1), "at least 0 mm, got True"),
        (
            lambda: Holder(drape.Plane(), gap=lambda t: abs(t - 0.4) - 0.1, side=1),
            r"at least 0 mm, got -.* at load factor 0\.3",
        ),
        (lambda: Tool(3.0), "surface must have the methods"),
    ],
)
def test_invalid_tools(make, message):
    refused(lambda: blank(terms=[make()]), message)


def test_plies_and_methods_that_tools_do_not_suit_are_refused():
    """Reactions of tools and conditions are stored by name."""
    ply = blank(terms=[punch(), ring(GAP / 2)])
    plane, named = MeshQuad().with_defaults(), {"x": SYMMETRY["x"]}
    for call, message in (
        (
            lambda: LoadStepper(ply, SYMMETRY, method="plain"),
            "use the method 'newton'",
        ),
        (
            lambda: LoadStepper(ply, named | {"die": SYMMETRY["y"]}),
            "a tool and a condition have the name 'die'",
        ),
        (
            lambda: blank(terms=[punch(), punch()]),
            "other terms have the name 'punch'",
        ),
        (
            lambda: Ply(plane, Fabric(1e4), terms=[punch()]),
            "requires a ply in space",
        ),
    ):
        refused(call, message)


@pytest.mark.parametrize("press", [{"pressure": 0.1}, {"gap": 0.3}])
@pytest.mark.parametrize(
    ("outline", "text"),
    [
        (
            [[0, 50, 0, 50], [0, 50, 50, 0]],
            "edges of the outline from corner 0 and from",
        ),
        ([[0, 50, 20], [0, 50, 20]], "the outline encloses no area"),
        (
            [[200, 300, 300, 200], [0, 0, 99, 99]],
            "'holder': no part of the undeformed ply is within",
        ),
    ],
)
def test_outlines_that_cross_themselves_or_hold_nothing_are_refused(
    press, outline, text
):
    holder = Holder(drape.Plane(), side=1, outline=outline, **press)
    refused(lambda: blank(terms=[holder]), text)


# Tools of case files


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("mm", "extends over 0.08 mm, less than two elements of the ply, 10 mm each"),
        ("m", "extends over 8e+04 mm, over 100 times the size of the ply, 60 mm"),
    ],
)
def test_a_tool_of_a_file_in_another_unit_is_refused(tmp_path, unit, message):
    x, t = graph(np.linspace(0.0, 0.08, 9), lambda x, y: 0.25 * x)
    path = tmp_path / "P.stl"
    meshio.Mesh((x if unit == "mm" else 1e3 * x).T, [("triangle", t.T)]).write(path)
    file = {"surface": "triangles", "source": str(path), "unit": unit, "side": 1}
    with pytest.raises(ValueError, match=f"^tool 'tool_1' {re.escape(message)}") as e:
        case_from_tables(tables(file)).stepper()
    assert str(e.value).endswith(": check its unit")


def test_a_bad_position_of_a_file_is_named(tmp_path):
    file = {"surface": "triangles", "source": graph_file(tmp_path / "P.stl")}
    for placed, message in (
        ({"rotation_axis": [0, 0, 0]}, "tool_1: rotation_axis must not be zero"),
        ({"offset_mm": [1, 2]}, "tool_1.offset_mm must be"),
        ({"rotation_deg": "x"}, "tool_1.rotation_deg must be a number"),
        ({"rotation": 3}, "no key 'rotation'; did you mean 'rotation_"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            case_from_tables(tables({**file, **placed}))
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"offset_mm requires .*surface is triangles"):
        case_from_tables(tables({**PUNCH, "offset_mm": [0, 0, 1]}))


@pytest.mark.parametrize(
    ("tools", "message"),
    [
        (
            [{**PUNCH, "radius": 3}],
            "tools.punch has no key 'radius'; did you mean 'radius_",
        ),
        (
            [PUNCH, {**DIE, "surface": "dice"}],
            "tool_2.surface is 'dice': expected one of",
        ),
        ([{"surface": "sphere", "radius_mm": 3}], "tool_1.centre_mm is missing"),
        (
            [{**PUNCH, "motion_mm": [1, 2]}],
            "tools.punch.motion_mm must be three numbers",
        ),
        ([{**PUNCH, "motion_axis": [1, 0, 0]}], "tools.punch: .* require motion_deg"),
        (
            [{**PUNCH, "motion_deg": 5, "motion_axis": [0, 0, 0]}],
            "tools.punch: motion_axis must not be zero",
        ),
        ([{**PUNCH, "motion_mm": [0, [1, 0, 0, 0]]}], "both rows and numbers"),
        ([{**PUNCH, "motion_mm": [[0.5, 0, 0, 0], [1, 0, 0, 1]]}], "from 0 to 1"),
        ([{**PUNCH, "motion_mm": [[0, 0, 0], [1, 0, 1]]}], "tools.punch.motion_mm"),
        ([{**HOLDER, "gap_mm": [[0, 1], [1, -1]]}], "gap must be a number of at least"),
        ([{"surface": "triangles", "source": "none.stl"}], "none.stl: no such file"),
        ([], "scene.punch is missing: name STL files of punch and die, or describe"),
        ({"surface": "plane"}, r"tools must be an array of tables, \[\[tools\]\]"),
        (
            [{**PUNCH, "motion_mm": [0, 0, -5.0]}],
            "nothing touches the ply at any load factor: the nearest is 'punch', 0.2 ",
        ),
        ([{**PUNCH, "side": -1}], "'punch': the whole undeformed ply is behind its"),
        (
            [PUNCH, {"surface": "plane", "point_mm": [0, 0, 2], "name": "lid"}],
            "tools 'punch' and 'lid' leave no room for the ply at load factor 0.75: ",
        ),
    ],
)
def test_bad_tools_are_named_in_one_line(tools, message):
    case = tables() | {"tools": tools}
    refused(lambda: case_from_tables(case).stepper(), message)


@pytest.mark.parametrize("name", ["specimen", "hemisphere"])
def test_tools_do_not_apply_to_plane_and_draped_plies(name):
    case = tables(PUNCH, scene={"name": name})
    with pytest.raises(ValueError, match=f"do not apply to the scene {name}"):
        case_from_tables(case)


# Scenes, in Python and from the command line


def test_a_holder_has_a_gap_or_a_pressure_and_a_flange_to_press_on(files, flanged):
    punch, die = map(read_surface, files)
    for tools, options, message in (
        (flanged, {"gap": 0.3, "pressure": 0.1}, "either a gap, a pressure or a force"),
        ((punch, die), {"pressure": 0.1}, "no flat flange at z = 500.011 mm on which"),
        (flanged, {"pressure": -0.1}, "pressure must be a number of at least 0 N/mm2"),
    ):
        build = partial(forming, *tools, travel=10.0, **options, **SMALL)
        refused(lambda build=build: case(build()).ply(), message)


def test_bad_input_is_one_line(files, tmp_path):
    punch, die = map(read_surface, files)
    tiny = read_surface(bowl(tmp_path / "tiny.stl", 2.0, 490.0, side=9.0))
    of_metres = TriangleMesh(1e3 * die.facets.points, die.facets.cells[0])
    for build, message in (
        (lambda: hemisphere_forming(centre=(1, np.nan)), "centre must be two finite"),
        (
            lambda: hemisphere_forming(centre=(9, 0), part="quarter"),
            "a quarter of the ply has its centre on the axis",
        ),
        (lambda: hemisphere_forming(travel=0.0), "travel must be a positive length"),
        (lambda: hemisphere_forming(radius=-1.0), "radius must be a positive length"),
        (lambda: hemisphere_forming(fibres=0.3, part="quarter"), "no planes of symm"),
        (lambda: double_dome_forming(travel=61.0), "at most the height of the dome"),
        (lambda: forming(punch, die, travel=0.0, **SMALL), "length in mm other than"),
        (lambda: forming(die, punch, travel=9.0, **SMALL), "beyond the plane of the"),
        (lambda: forming(tiny, die, travel=9.0, **SMALL), "less than two elements"),
        (lambda: forming(punch, of_metres, **SMALL), "must have the same unit"),
    ):
        refused(build, message, (ValueError, MeshError))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--punch", "none.stl"], "--punch none.stl: no such file"),
        (["--holder-gap=-1"], "the holder gap must be a length of at least 0 mm"),
        (["--travel", "45"], "punch passes the plane of the ply, z = 499.511 mm, by 5"),
    ],
)
def test_bad_files_and_numbers_are_refused_before_the_run(
    files, tmp_path, capsys, words, message
):
    punch, die = files
    ply = "--width", 100, "--height", 100, "--size", "3x3", "--part", "quarter"
    tools = "--punch", punch, "--die", die, "--holder-gap", 1, "--travel", 15
    options = [str(word) for word in (*ply, *tools)]
    for flag in {word.partition("=")[0] for word in words} & {*options}:
        at = options.index(flag)
        del options[at : at + 2]
    out = tmp_path / "out"
    assert run("forming", *options, *words, "--out", out) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert message in error
    assert not out.exists()
