"""Plies on tools from files, from the command line: their files, cases and exports."""

from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from types import SimpleNamespace

import meshio
import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.cases.schema import Output
from skfem_textile.cli import main as cli
from skfem_textile.cli.export import PartExport
from tests.helpers import sphere
from tests.helpers.tools import (
    SPHERE,
    bump_height,
    command,
    geodesic_u,
    plate,
    square,
    summary,
    write,
)

pytestmark = pytest.mark.usefixtures("quick")

SHIFT = np.array([[300.0], [0], [9]])


@pytest.fixture(scope="module")
def draped(tmp_path_factory, quick):
    """Tool and results of a ply with a part, on a tool that is not at the origin."""
    folder = tmp_path_factory.mktemp("draped")
    x, t = plate()
    tool = write(folder / "tool.stl", x + SHIFT, t)
    x, t = plate(40.0, 9)
    part = write(folder / "part.stl", x + SHIFT, t)
    options = "--fibres", "35", "--point", "296", "3", "38", "--part-mesh", str(part)
    assert command(folder / "out", *options, "--checkpoint", tool=tool) == 0
    return SimpleNamespace(tool=tool, out=folder / "out", options=options)


def test_files_are_in_the_axes_of_the_tool(draped):
    last = meshio.read(draped.out / "fields" / "step_0001.vtu")
    for x in (
        last.points + last.point_data["displacement"],
        meshio.read(draped.out / "fibres.vtu").points,
    ):
        z = bump_height(x[:, 0] - 300, x[:, 1]) + 9
        assert np.abs(x[:, 2] - z).max() < 0.1
    warp = last.cell_data["warp_direction"][0]
    assert np.abs(warp[:, 2]).max() > 0.2
    np.testing.assert_allclose(np.linalg.norm(warp, axis=1), 1)


def test_the_written_case_describes_the_same_tool(draped, tmp_path):
    run_words = "run", str(draped.out / "case.toml"), "--no-render"
    assert cli.main([*run_words, "--out", str(tmp_path)]) == 0
    one, other = summary(draped.out), summary(tmp_path)
    for key in ("energy", "touches_at_x_mm", "pattern_area_mm2"):
        assert one[key] == other[key]
    for name in ("case.toml", "case_files/tool.stl", "case_files/part_mesh.stl"):
        assert (tmp_path / name).read_bytes() == (draped.out / name).read_bytes()


def test_a_run_on_a_tool_is_resumed_from_its_checkpoint(draped, tmp_path, capsys):
    x, t = plate(n=21, height=lambda x, y: bump_height(x, y) + 0.01 * x)
    other = write(tmp_path / "other.stl", x + SHIFT, t)
    resume = partial(command, draped.out, *draped.options, "--checkpoint", "--resume")
    assert resume(tool=other) == 2
    assert "checkpoint" in capsys.readouterr().err
    assert resume(tool=draped.tool) == 0


def test_init_writes_a_case_that_requires_a_tool(tmp_path, capsys):
    file = tmp_path / "new.toml"
    assert cli.main(["init", str(file), "--scene", "drape"]) == 0
    assert "# tool is not given" in file.read_text()
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "scene.tool is missing: name an STL file" in capsys.readouterr().err


# Exports of a run on a flat tool: what is beyond it, fibres on a part, its pattern


@pytest.fixture(scope="module")
def flat(tmp_path_factory, quick):
    """A flat tool of 120 mm, a ply of 150 mm, and a part of two pieces with a hole."""
    folder = tmp_path_factory.mktemp("flat")
    tool = write(folder / "flat.stl", *plate(60.0, 13, lambda x, y: 0 * x))
    x, t = plate(40.0, 9, lambda x, y: 0 * x)
    middle = x[:, t].mean(axis=1)
    gap = np.abs(middle[0]) < 10
    hole = (np.abs(middle[0] + 25) < 5) & (np.abs(middle[1]) < 10)
    part = write(folder / "part.stl", x, t[:, ~(gap | hole)])
    size = "--width", "150", "--height", "100"
    options = *size, "--fibres", "20", "--part-mesh", str(part)
    with redirect_stdout(StringIO()) as printed:
        assert command(folder / "out", *options, tool=tool) == 0
    printed = printed.getvalue()
    return SimpleNamespace(tool=tool, out=folder / "out", size=size, printed=printed)


def test_a_ply_beyond_the_edges_of_its_tool_is_reported(flat):
    """The share of area is known; there are a sentence and a field."""
    result = summary(flat.out)
    assert result["beyond_tool_share_of_area"] == pytest.approx(1 - 120 / 150, abs=0.06)
    assert "use a smaller ply or a larger tool" in result["beyond_tool"]
    fields = meshio.read(flat.out / "fields" / "step_0001.vtu")
    beyond = fields.cell_data["beyond_tool"][0]
    middle = fields.points[fields.cells[0].data].mean(axis=1)
    np.testing.assert_array_equal(beyond, np.abs(middle[:, 0]) > 60)


def test_fibres_and_pattern_are_exported(flat):
    """The pattern equals the part, and fibres keep their angle."""
    result = summary(flat.out)
    assert result["part_covered_share_of_elements"] == 1
    area = 80 * 80 - 20 * 80 - 10 * 20
    assert result["pattern_area_mm2"] == pytest.approx(area, rel=1e-3)
    edges = 4 * (30 + 80) + 2 * (10 + 20)
    assert result["pattern_length_mm"] == pytest.approx(edges, rel=1e-3)
    text = f"Flat pattern            {result['pattern_area_mm2']:.4g} mm²"
    assert text in flat.printed
    fibres = meshio.read(flat.out / "part.vtu")
    np.testing.assert_allclose(fibres.cell_data["warp_angle_deg"][0], 20, atol=1e-6)
    for name in ("part.csv", "part.inp", "pattern.csv", "pattern.svg"):
        assert (flat.out / name).stat().st_size > 100
    files = {file.name for file in (flat.out / "case_files").iterdir()}
    assert files == {"tool.stl", "part_mesh.stl"}


def test_a_curve_trims_the_pattern_and_the_next_run_removes_it(flat, tmp_path, capsys):
    a = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    curve, out = tmp_path / "curve.csv", tmp_path / "out"
    rows = np.column_stack([a, 5 + 40 * np.cos(a), 40 * np.sin(a), 0 * a])
    np.savetxt(curve, rows, delimiter=",", header="angle,X,y (mm), z", comments="")
    small = *flat.size, "--size", "2x2"
    assert command(out, *small, "--trim", str(curve), tool=flat.tool) == 0
    area = summary(out)["pattern_area_mm2"]
    assert area == pytest.approx(np.pi * 40**2, rel=3e-3)
    assert not (out / "part.vtu").exists()
    x, t = plate(40.0, 9)
    far = write(tmp_path / "far.stl", x + np.array([[500], [0], [0]]), t)
    capsys.readouterr()
    assert command(out, *small, "--part-mesh", str(far), tool=flat.tool) == 1
    assert "part: not written: fibres on a tool" in capsys.readouterr().err
    result = summary(out)
    assert result["converged"]
    assert result["part"].startswith("not written: ")
    assert (out / "fibres.vtu").exists()
    assert not [name for name in PartExport.all_files if (out / name).exists()]


def test_what_cannot_be_exported_is_named(tmp_path):
    """Beside a part that the ply does not cover, a curve beyond, and a closed part."""
    ply = square(60.0, 6)
    u = geodesic_u(ply, SPHERE)
    x, t = sphere(900)
    ball = drape.ToolMesh(100 * x - [[0], [0], [100]], (t,))
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = 90 * np.array([np.cos(turn), np.sin(turn), 0 * turn])
    ring[2] = np.sqrt(1e4 - 90**2) - 100
    closed = PartExport(Output(), ball, no_curves="ball.stl: the tool is closed")
    for export, missing in (
        (closed, []),
        (
            PartExport(Output(trim="ring.csv"), ball, curves=[ring]),
            ["pattern: not written: ring.csv: flat"],
        ),
    ):
        figures = export.write(drape.Sheet.of_ply(ply, u), "", tmp_path)
        assert 0 < figures["part_covered_share_of_elements"] < 0.2
        found = export.missing(figures)
        assert [x[: len(y)] for x, y in zip(found, missing, strict=True)] == missing
        assert "is closed" in figures["pattern"] or "does not lie on" in found[0]
        assert not (tmp_path / "pattern.csv").exists()
