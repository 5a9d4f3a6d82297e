"""A chain from an outline to the part: forming, and exports of the finished run."""

import json
import shutil
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from skfem_textile import Outline, drape
from skfem_textile.cases import case_from_file, read_result
from skfem_textile.cases.finished import read_summary
from skfem_textile.cli import main as cli
from skfem_textile.cli.export import PartExport, decks_in
from skfem_textile.cli.extents import trimming_curves, warn_of_curves, warn_of_part
from skfem_textile.io import write_pattern
from skfem_textile.mesh.checks import MeshError
from tests.helpers import graph
from tests.helpers.command_line import rejected
from tests.helpers.curves import write_columns
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
    end = (formed / "out" / "pattern.csv").read_text().splitlines()[-1]
    assert end.startswith("2,")
    assert (formed / "out" / "part.csv").read_bytes() == before
    area = figures(formed)["pattern_area_mm2"]
    assert area == pytest.approx(np.pi * 8**2 * (1 - 0.2**2), rel=0.05)
    assert figures(formed)["converged"]


def test_a_hole_of_the_ply_is_cut_out_of_an_exported_pattern(formed, tmp_path, caplog):
    """The hole has 8 mm × 8 mm, its middle is at (−21, −11) mm of the flat ply."""
    shutil.copytree(formed / "out", tmp_path / "out")
    sheet = read_result(tmp_path / "out").sheet()
    x = sheet.points(sheet.at(np.vstack([1.5 * RING + [[-21], [-11]], 0 * t]), 10.0))
    write_columns(tmp_path / "around.csv", "x,y,z", *x)
    words = ["export", str(tmp_path / "out"), "--trim", str(tmp_path / "around.csv")]
    assert cli.main([*words, "--pattern", "csv"]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    disk = np.pi * 12**2
    assert summary["pattern_area_mm2"] == pytest.approx(disk - 64, rel=0.05)
    assert "the ply has a hole of 64 mm²" in caplog.text


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


def write_deck(file, height=6.0, section="M"):
    """Deck of two skins of one element, the upper one on the ply."""
    lines = ["*NODE"]
    for k, depth in enumerate((0.0, 2.0)):
        for i, (x, y) in enumerate([(-9, -9), (9, -9), (9, 9), (-9, 9)], 1 + 4 * k):
            lines.append(f"{i}, {x}, {y}, {height - depth}")
    lines += ["*ELEMENT, TYPE=S4, ELSET=SKIN", "1, 1, 2, 3, 4", "2, 5, 6, 7, 8"]
    lines += [f"*SHELL SECTION, ELSET=SKIN, MATERIAL={section}", "1.", ""]
    file.write_text("\n".join(lines))
    return str(file)


def exported(folder, deck, *more):
    """Exit code of the export of a deck."""
    words = "export", str(folder / "out"), "--thickness", "0.4", "--part-reach", "5"
    return cli.main([*words, "--deck", str(deck), *more])


def contents(folder):
    """Files of exports, and what they contain."""
    out, kinds = folder / "out", ("part.*", "pattern.*", "deck/*")
    files = (file for kind in kinds for file in out.glob(kind) if file.is_file())
    return {file.relative_to(out).as_posix(): file.read_bytes() for file in files}


def test_of_a_second_skin_below_the_part_the_pattern_is_not_affected(formed):
    two = write_deck(formed / "two.inp")
    assert exported(formed, two, "--pattern", "csv") == 0
    summary = figures(formed)
    assert summary["pattern_area_mm2"] == pytest.approx(18**2, rel=0.1)
    assert summary["part_covered_share_of_elements"] == 0.5
    (formed / "in.inp").write_text("*INCLUDE, INPUT=out/deck/two.inp")
    for deck in (formed / "out" / "deck" / "two.inp", formed / "in.inp"):
        before = contents(formed)
        assert exported(formed, deck) == 2
        assert contents(formed) == before


def test_an_export_replaces_what_it_writes_and_nothing_else(formed, capsys):
    """Of the same deck also what it no longer writes, and this is printed."""
    one, two = (write_deck(formed / f"{name}.inp") for name in ("one", "two"))
    assert exported(formed, one, "--calculix", "--pattern", "csv") == 0
    (formed / "out" / "deck" / "result.odb").write_text("1")
    before = contents(formed)
    assert exported(formed, two, "--material", "N", "--pattern", "svg") == 0
    after, decks = contents(formed), figures(formed)["deck_files"]
    others = [name for name in before if name.startswith("deck/one")]
    for name in (*others, "deck/result.odb", "pattern.csv"):
        assert after[name] == before[name]
    assert decks["deck/one.inp"] == sorted(others)
    assert {*after} >= {*decks["deck/two.inp"]}
    capsys.readouterr()
    assert exported(formed, one) == 0
    assert "removed from an earlier run: deck/one_ccx.inp" in capsys.readouterr().out
    last = contents(formed)
    assert {*after} - {*last} == {"deck/one_ccx.inp"}
    assert all(last[name] == after[name] for name in ("pattern.csv", "pattern.svg"))
    assert "deck/one_ccx.inp" not in figures(formed)["deck_files"]["deck/one.inp"]


def test_an_export_that_fails_leaves_earlier_ones(formed, capsys):
    """The reason is in the summary, and states that the files are earlier ones."""
    assert exported(formed, write_deck(formed / "one.inp"), "--pattern", "csv") == 0
    before, summary = contents(formed), figures(formed)
    far = write_deck(formed / "far.inp", height=500.0)
    assert exported(formed, far) == 1
    assert exported(formed, write_deck(formed / "one.inp", height=500.0)) == 1
    told = capsys.readouterr().err
    assert "part: not written" in told
    assert "deck: not written" in told
    assert "the files of an earlier export stay" in told
    assert contents(formed) == before
    after = figures(formed)
    reasons = {name: after.pop(name) for name in ("part", "deck")}
    assert all("earlier export" in reason for reason in reasons.values())
    assert after == {name: x for name, x in summary.items() if name != "deck"}


def test_a_reason_stays_until_its_export_is_written():
    no_part = {"first": [], "part": "not written: x"}
    summary = {**no_part, "pattern": "not written: y"}
    written = PartExport.added(summary, {"pattern_area_mm2": 1.0})
    written.pop("first")
    assert written == {"part": "not written: x", "pattern_area_mm2": 1.0}


def test_an_export_does_not_replace_a_file_of_another_deck(formed):
    for name, section in ("a", "M"), ("b", "N"):
        (formed / name).mkdir()
        whole = write_deck(formed / name / "nodes.inc", section=section)
        (formed / name / f"{name}.inp").write_text("*INCLUDE, INPUT=nodes.inc\n")
        assert Path(whole).exists()
    assert exported(formed, formed / "a" / "a.inp") == 0
    before = contents(formed)["deck/nodes.inc"]
    assert exported(formed, formed / "b" / "b.inp") == 1
    assert contents(formed)["deck/nodes.inc"] == before
    assert "deck/b.inp" not in contents(formed)
    assert "move that deck" in figures(formed)["deck"]


def test_a_missing_deck_for_calculix_is_reported(formed, capsys, monkeypatch):
    def refused(*_):
        raise MeshError("several instances")

    monkeypatch.setattr("skfem_textile.io.part_decks.calculix_deck", refused)
    assert exported(formed, write_deck(formed / "one.inp"), "--calculix") == 1
    assert "calculix: not written: several instances" in capsys.readouterr().err
    assert figures(formed)["calculix"] == "not written: several instances"
    assert exported(formed, formed / "one.inp") == 0
    assert "calculix" not in figures(formed)


@pytest.mark.parametrize(
    "command", ["export out --part-mesh part.stl", "net --tool part.stl --out net"]
)
def test_a_requested_dxf_requires_its_package(formed, command, capsys, monkeypatch):
    monkeypatch.chdir(formed)
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    words = *command.split(), "--pattern", "dxf"
    assert "a .dxf of the pattern requires ezdxf" in rejected(capsys, *words)


@pytest.mark.parametrize(
    ("scales", "text"),
    [
        ([1.0, 90.0], "curve_1.csv: flat pattern: the ply does not lie on"),
        ([0.4, 1.0], "specify the outline first, then its holes"),
    ],
)
def test_a_refused_curve_is_named(formed, capsys, scales, text):
    sheet, words = read_result(formed / "out").sheet(), ["export", str(formed / "out")]
    files = [str(formed / f"curve_{i}.csv") for i in range(len(scales))]
    for file, scale in zip(files, scales, strict=True):
        x = np.vstack([scale * RING, 0 * t])
        x = x if scale > 1 else sheet.points(sheet.at(x, 10.0))
        np.savetxt(file, x.T, delimiter=",", header="x,y,z", comments="")
    assert cli.main([*words, "--trim", *files]) == 1
    assert text in capsys.readouterr().err


def test_a_refused_boundary_of_a_part_is_named(formed, capsys):
    words, large = ["export", str(formed / "out")], formed / "large.stl"
    x, cells = graph(np.linspace(-90, 90, 7), lambda x, y: 0 * x)
    meshio.Mesh(x.T, [("triangle", cells.T)]).write(large)
    reach = "--part-reach", "20", "--pattern", "csv"
    assert cli.main([*words, "--part-mesh", str(large), *reach]) == 1
    err = capsys.readouterr().err
    assert f"boundary of the part {large}: flat pattern: the ply does not" in err


def test_what_the_run_has_printed_is_not_repeated(formed, caplog, monkeypatch):
    out = formed / "out"
    case_from_file(out / "case.toml")
    assert "the middle of the outline" in caplog.text
    caplog.clear()
    read_result(out)
    monkeypatch.setattr("skfem_textile.cli.report.draw_curves", lambda *_: None)
    assert cli.main(["report", str(out), "--test-curve", str(out / "curve.csv")]) == 0
    assert caplog.messages == []


def test_the_folder_of_a_net_and_of_an_unfinished_run_are_named(tmp_path):
    (tmp_path / "net.vtu").touch()
    for read in read_result, read_summary:
        with pytest.raises(ValueError, match="is the folder of a net, not of a run"):
            read(tmp_path)
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint" / "run.npz").touch()
    (tmp_path / "net.vtu").unlink()
    for folder in tmp_path, tmp_path / "checkpoint":
        with pytest.raises(ValueError, match="end this run with --resume"):
            read_result(folder)


def test_without_fields_the_last_state_is_read_from_the_checkpoint(tmp_path):
    line = "run strip --size 2x2 --steps 2 --set formulation.name=macro --no-render"
    assert cli.main([*line.split(), "--checkpoint", "--out", str(tmp_path)]) == 0
    before = read_result(tmp_path)
    shutil.rmtree(tmp_path / "fields")
    after = read_result(tmp_path)
    assert after.load_factor == before.load_factor
    np.testing.assert_allclose(after.u, before.u, atol=1e-12)
    shutil.rmtree(tmp_path / "checkpoint")
    with pytest.raises(ValueError, match=r"nor a checkpoint .* with --checkpoint"):
        read_result(tmp_path)


def test_files_removed_before_an_export_are_below_its_deck(tmp_path):
    names = ["deck/a[1].inp", "deck/more/b.inp", "/deck/c", "../d", "deck/../e", "f"]
    decks = {"deck/a[1].inp": names, "deck/g.inp": ["deck/g.inp"]}
    (tmp_path / "summary.json").write_text(json.dumps({"deck_files": decks}))
    assert decks_in(tmp_path) == ("deck/a[[]1].inp", "deck/more/b.inp", "deck/g.inp")
