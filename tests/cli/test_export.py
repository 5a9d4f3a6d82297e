"""A chain from an outline to the part: forming, and exports of the finished run."""

import json
import shutil

import meshio
import numpy as np
import pytest

from skfem_textile import Outline, drape
from skfem_textile.cases import read_result
from skfem_textile.cli import main as cli
from skfem_textile.cli.export import decks_in
from skfem_textile.cli.extents import trimming_curves, warn_of_curves, warn_of_part
from skfem_textile.io import write_pattern
from tests.helpers import graph
from tests.helpers.command_line import rejected
from tests.helpers.specimen import write_case

pytestmark = pytest.mark.usefixtures("no_interval")

RING = 8 * np.array([np.cos(t := np.linspace(0, 2 * np.pi, 40)[:-1]), np.sin(t)])

# The outline of the ply, 0.5 mm below the plane in which the punch touches it.
ROWS = "curve,x (cm),y (cm)", "1,0,0", "1,8,0", "1,9,2", "1,9,7", "1,0,6"
HOLE = "2,2,2", "2,2.8,2", "2,2.8,2.8", "2,2,2.8"


@pytest.fixture(scope="module")
def formed(tmp_path_factory):
    """Folder of a ply with an outline that a punch forms, and of its tools."""
    folder = tmp_path_factory.mktemp("formed")

    def bowl(name, top, height, sign=1.0):
        x, t = graph(
            np.linspace(-70, 70, 15),
            lambda x, y: top - height * (1 - np.exp(-(x**2 + y**2) / 900)),
        )
        meshio.Mesh(x.T, [("triangle", t.T)]).write(folder / name)

    bowl("punch.stl", 0.0, 40.0)
    bowl("die.stl", 32.3, 32.0)
    (folder / "ply.csv").write_text("\n".join([*ROWS, *HOLE]))
    x, t = graph(np.linspace(-15, 15, 7), lambda x, y: 6 * np.exp(-(x**2 + y**2) / 900))
    meshio.Mesh(x.T, [("triangle", t.T)]).write(folder / "part.stl")
    tools = "--punch", str(folder / "punch.stl"), "--die", str(folder / "die.stl")
    ply = "--outline", str(folder / "ply.csv"), "--size", "6x5", "--fibres", "30"
    few = "--travel", "6", "--steps", "1", "--set", "bending.warp_N_mm=5"
    more = "bending.weft_N_mm=5", "--part-mesh", str(folder / "part.stl")
    words = ["run", "forming", *tools, *ply, *few, *more, "--no-render"]
    assert cli.main([*words, "--out", str(folder / "out")]) == 0
    return folder


def figures(folder):
    return json.loads((folder / "out" / "summary.json").read_text())


def test_a_ply_with_an_outline_is_formed_about_its_middle(formed):
    mesh = meshio.read(formed / "out" / "fields" / "own_step_0001.vtu")
    assert np.ptp(mesh.points, axis=0) == pytest.approx([90, 70, 0])
    assert mesh.points.max(axis=0)[:2] == pytest.approx([45, 35])
    assert figures(formed)["punch_force_N"] > 0.1
    text = (formed / "out" / "case.toml").read_text()
    assert 'outline = "case_files/outline.csv"' in text


def test_the_part_has_the_fibres_of_the_formed_ply(formed):
    """In each of its elements, as they are in the ply above it."""
    assert figures(formed)["part_covered_share_of_elements"] == 1
    finished = read_result(formed / "out")
    part = meshio.read(formed / "out" / "part.vtu")
    sheet = finished.sheet()
    centres = part.points[part.cells[0].data].mean(axis=1).T
    warp, _, angle = sheet.fibres_at(sheet.at(centres))
    found = part.cell_data["warp_direction"][0].T
    assert np.abs((warp * found).sum(axis=0)).min() > 0.99
    of_part = part.cell_data["shear_angle_deg"][0]
    np.testing.assert_allclose(of_part, np.degrees(angle), atol=1e-9)
    last = meshio.read(formed / "out" / "fields" / "step_0001.vtu")
    moved = finished.ply.nodal(finished.u).T
    np.testing.assert_allclose(moved, last.point_data["displacement"], atol=1e-12)
    assert finished.load_factor == 1


def test_a_finished_run_is_exported_without_computing_it(formed, capsys, monkeypatch):
    """A part, and a trimmed pattern with a hole in the requested kinds."""
    monkeypatch.setattr("skfem_textile.solve.stepper.LoadStepper.run", lambda *_: 1 / 0)
    before = (formed / "out" / "part.csv").read_bytes()
    finished = read_result(formed / "out")
    sheet, names = finished.sheet(), []
    for name, scale in ("outline.csv", 1.0), ("hole.csv", 0.2):
        x = np.vstack([scale * RING + [[-8], [0]], 0 * t])
        x = sheet.points(sheet.at(x, 10.0))
        np.savetxt(formed / name, x.T, delimiter=",", header="x,y,z", comments="")
        names.append(str(formed / name))
    words = "export", str(formed / "out"), "--trim", *names, "--pattern", "svg", "csv"
    assert cli.main([*words, "--part-mesh", str(formed / "part.stl")]) == 0
    assert "Flat pattern" in capsys.readouterr().out
    written = {file.name for file in (formed / "out").glob("pattern.*")}
    assert written == {"pattern.csv", "pattern.svg"}
    assert (formed / "out" / "part.csv").read_bytes() == before
    area = figures(formed)["pattern_area_mm2"]
    assert area == pytest.approx(np.pi * 8**2 * (1 - 0.2**2), rel=0.05)
    assert figures(formed)["converged"]


def test_a_pattern_is_the_outline_of_another_ply(formed, tmp_path):
    """Read again with its hole, and in mm."""
    sheet = read_result(formed / "out").sheet()
    curves = [
        sheet.points(sheet.at(np.vstack([r * RING, 0 * t]), 10.0)) for r in (1, 0.3)
    ]
    pattern = drape.flat_pattern(sheet, curves[0], holes=curves[1:])
    write_pattern(tmp_path / "pattern.csv", pattern)
    again = Outline.from_file(tmp_path / "pattern.csv")
    assert again.shape().area == pytest.approx(pattern.area, rel=1e-6)
    assert len(again.holes) == 1


def trimming(path, radius, scale=1.0, x=0.0):
    """A circle about a point of the x axis, in mm or in another unit."""
    circle = np.array([x + radius * np.cos(t), radius * np.sin(t), 0 * t])
    np.savetxt(path, scale * circle.T, delimiter=",", header="x,y,z", comments="")
    return str(path)


def test_trimming_curves_in_metres_are_refused_or_told(formed, caplog, tmp_path):
    curve = trimming(tmp_path / "curve.csv", 20, 1e-3)
    with pytest.raises(ValueError, match=r"over 0.04 mm: if it is in m, state its"):
        trimming_curves([curve])
    sizes = {"o.csv": (20, 1), "a.csv": (5, 1e-3), "b.csv": (2, 1)}
    files = [trimming(tmp_path / name, *size) for name, size in sizes.items()]
    curves, ply = trimming_curves(files), read_result(formed / "out").sheet().positions
    caplog.clear()
    warn_of_curves(files, curves, ply)
    (line,) = caplog.messages
    assert "a.csv: the curve extends over 0.00999 mm, the ply over 90 mm" in line
    warn_of_part("part.stl", ply, ply)
    warn_of_part("part.stl", 0.04 * ply, ply)
    assert "part.stl: the part extends over 3.6 mm, the ply over" in caplog.messages[1]


@pytest.fixture(scope="module")
def folders(formed):
    """A run in its plane, and copies of the formed ply with other fields."""
    line = "run strip --size 2x2 --steps 1 --set formulation.name=macro --no-render"
    assert cli.main([*line.split(), "--out", str(formed / "plane")]) == 0
    other = (formed / "out" / "fields" / "own_step_0001.vtu").read_bytes()
    for name, content in ("cut", b"<VTKFile"), ("other", other):
        shutil.copytree(formed / "out", formed / name)
        (formed / name / "fields" / "step_0001.vtu").write_bytes(content)
    (formed / "own").mkdir()
    write_case(formed / "own").rename(formed / "own" / "case.toml")
    return formed


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("out", "nothing to export: specify --part-mesh, --deck or --trim"),
        ("out --part-mesh none.stl", "none.stl: no such file"),
        ("out --part-mesh part.stl --part-reach 0", "--part-reach must be a number >"),
        ("nowhere --part-mesh part.stl", "case.toml is missing: name the results"),
        ("own --part-mesh part.stl", "own/case.toml was not written by a run"),
        ("cut --part-mesh part.stl", "step_0001.vtu cannot be read"),
        ("other --part-mesh part.stl", "does not belong to the case"),
        ("plane --part-mesh part.stl", "is in its plane: exports require tools"),
    ],
)
def test_a_folder_or_an_export_is_refused(folders, words, text, capsys, monkeypatch):
    monkeypatch.chdir(folders)
    assert text in rejected(capsys, "export", *words.split())


def test_exports_leave_other_files_and_decks(formed, tmp_path):
    """Of a second skin below the part the pattern is not affected."""
    out = formed / "out"
    lines = ["*NODE"]
    for k, depth in enumerate((0.0, 2.0)):
        for i, (x, y) in enumerate([(-9, -9), (9, -9), (9, 9), (-9, 9)], 1 + 4 * k):
            lines.append(f"{i}, {x}, {y}, {6.0 - depth}")
    lines += ["*ELEMENT, TYPE=S4, ELSET=SKIN", "1, 1, 2, 3, 4", "2, 5, 6, 7, 8"]
    lines += ["*SHELL SECTION, ELSET=SKIN, MATERIAL=M", "1.", ""]
    (formed / "two.inp").write_text("\n".join(lines))
    words = "export", str(out), "--thickness", "0.4", "--part-reach", "5", "--deck"
    assert cli.main([*words, str(formed / "two.inp")]) == 0
    summary = figures(formed)
    assert summary["pattern_area_mm2"] == pytest.approx(18**2, rel=0.1)
    assert summary["part_covered_share_of_elements"] == 0.5
    (out / "deck" / "notes").mkdir()
    (out / "deck" / "result.odb").write_text("1")
    assert cli.main([*words, str(formed / "two.inp"), "--pattern", "csv"]) == 0
    assert (out / "deck" / "result.odb").exists()
    part = "--part-mesh", str(formed / "part.stl")
    assert cli.main(["export", str(out), *part]) == 0
    assert (out / "deck" / "two.inp").exists()
    assert cli.main([*words, str(out / "deck" / "two.inp")]) == 2


def test_files_removed_before_an_export_are_below_its_deck(tmp_path):
    names = ["deck/a[1].inp", "deck/more/b.inp", "/deck/c", "../d", "deck/../e", "f"]
    (tmp_path / "summary.json").write_text(json.dumps({"deck_files": names}))
    assert decks_in(tmp_path) == ("deck/a[[]1].inp", "deck/more/b.inp")
