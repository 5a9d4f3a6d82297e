"""Directions and fabrics of files on the command line, and the command ``show``."""

import numpy as np
import pytest

from skfem_textile import Fabric, Sin2
from skfem_textile.cli import main as cli
from skfem_textile.fabric.directions import FibreDirections, directions_of
from skfem_textile.io import read_directions, write_directions, write_fabric
from skfem_textile.scenes import bias_extension
from tests.helpers.command_line import computed

pytestmark = pytest.mark.usefixtures("no_interval")

PULL = bias_extension(size=(2, 4))
EDGES = PULL.mesh.p[:, PULL.mesh.t[1]] - PULL.mesh.p[:, PULL.mesh.t[0]]
ALONG_EDGES = FibreDirections(EDGES, np.stack([-EDGES[1], EDGES[0]]))
OF_SCENE = directions_of(PULL.mesh, Fabric(warp=PULL.warp, weft=PULL.weft))


def run(out, *words):
    """Summary of a run; each word may be several options."""
    few = "--shear-angle 10 --steps 1 --no-render"
    return computed(out, "bias_extension", few, *words)


@pytest.fixture
def mesh(tmp_path):
    """A mesh file with the directions of the scene."""
    path = tmp_path / "ply.vtu"
    write_directions(path, PULL.mesh, OF_SCENE)
    return path


def test_directions_and_laws_of_a_scene_in_files_give_the_same_run(tmp_path, mesh):
    fabric = tmp_path / "fabric.json"
    write_fabric(fabric, Fabric(1e5, Sin2(0.3)))
    files = f"--mesh {mesh} --directions {mesh} --fabric {fabric}"
    of_files = run(tmp_path / "files", files)
    laws = "--fibre-stiffness 1e5 --shear-law sin2 --shear-stiffness 0.3"
    plain = run(tmp_path / "plain", f"--mesh {mesh}", laws)
    assert of_files["reaction_y"] == pytest.approx(plain["reaction_y"], rel=1e-9)
    assert "load_over_exact" in plain
    assert "load_over_exact" not in of_files
    assert "fibre directions are read from" in of_files["exact_answer"]


def test_directions_rotate_with_the_problem(tmp_path, mesh):
    files = f"--mesh {mesh} --directions {mesh}"
    plain = run(tmp_path / "plain", files)
    turned = run(tmp_path / "turned", files, "--rotate 30")
    assert turned["reaction_y"] == pytest.approx(plain["reaction_y"], rel=1e-6)
    before, after = (
        read_directions(tmp_path / f / "fibres.csv").angles_deg()[0]
        for f in ("plain", "turned")
    )
    assert np.allclose(after, before + 30, atol=1e-4)


THICKNESS = "--set fabric.thickness_mm=0.3"


def test_a_run_reports_the_parts_of_a_deck_that_it_ignores(tmp_path, caplog):
    deck = tmp_path / "cloth.inp"
    write_fabric(deck, Fabric(1e5, 0.5), 0.3)
    deck.write_text(deck.read_text().replace("*FABRIC", "*DENSITY\n1e-9,\n*FABRIC"))
    run(tmp_path / "out", f"--size 2x4 --fabric {deck}", THICKNESS)
    assert "not represented exactly: *DENSITY" in caplog.text
    assert "in this file are ignored" not in caplog.text


def ignored(caplog):
    """Messages on ignored content since the last call."""
    found = [text for text in caplog.messages if "ignored: " in text]
    caplog.clear()
    return found


def test_data_that_a_run_uses_are_not_reported_as_ignored(tmp_path, caplog):
    deck = tmp_path / "ply.inp"
    write_directions(deck, PULL.mesh, OF_SCENE)
    write_fabric(tmp_path / "cloth.inp", Fabric(1e5, 0.5), 0.3)
    deck.write_text(deck.read_text() + (tmp_path / "cloth.inp").read_text() + "*STEP\n")
    files = f"--mesh {deck} --directions {deck} --fabric {deck}"
    run(tmp_path / "all", files, THICKNESS)
    assert ignored(caplog) == [f"{deck}: ignored: *STEP"]
    written = tmp_path / "all" / "case.toml"
    assert cli.main(["run", str(written), "--out", str(tmp_path / "again")]) == 0
    copy = tmp_path / "all" / "case_files" / "mesh.inp"
    assert ignored(caplog) == [f"{copy}: ignored: *STEP"]
    run(tmp_path / "mesh", f"--mesh {deck}")
    assert "*DISTRIBUTION, *MATERIAL, *FABRIC" in caplog.text


@pytest.mark.parametrize("suffix", [".json", ".inp"])
def test_a_run_reports_that_it_ignores_directions_of_a_fabric(tmp_path, caplog, suffix):
    others = FibreDirections.of_angles(*(angle + 5 for angle in OF_SCENE.angles_deg()))
    mesh, cloth = tmp_path / "ply.vtu", tmp_path / f"cloth{suffix}"
    write_directions(mesh, PULL.mesh, others)
    options = f"--mesh {mesh} --fabric {cloth}"
    if suffix == ".json":
        write_fabric(cloth, others.on(Fabric(1e5, 0.5)))
    else:
        write_fabric(cloth, Fabric(1e5, 0.5), 0.3)
        law = cloth.read_text()
        write_directions(cloth, PULL.mesh, others)
        cloth.write_text(cloth.read_text() + law)
        options += f" {THICKNESS}"
    run(tmp_path / "scenes", options)
    message = f"{cloth}: the fibre directions in this file are ignored; "
    message += "the directions from the scene are used: "
    assert message in caplog.text
    caplog.clear()
    run(tmp_path / "turned", options, f"--directions {mesh} --rotate 20")
    assert "are ignored" not in caplog.text


@pytest.mark.parametrize("stated", [{"warp": (1, 1), "weft": (1, -1)}, {}])
def test_used_and_default_directions_of_a_fabric_are_not_ignored(
    tmp_path, caplog, stated
):
    file = tmp_path / "fabric.json"
    write_fabric(file, Fabric(1e5, 0.5, **stated))
    run(tmp_path / "out", f"--size 2x4 --fabric {file}")
    assert "in this file are ignored" not in caplog.text


def test_show_draws_the_mesh_and_writes_directions_that_are_read_back(
    tmp_path, mesh, capsys, caplog, monkeypatch
):
    plot, drawn = pytest.importorskip("skfem_textile.plot"), []
    monkeypatch.setattr(plot, "mesh_and_fibres", lambda *of, **to: drawn.append(to))
    out = tmp_path / "out"
    assert cli.main(["show", str(mesh), "--out", str(out)]) == 0
    assert [to["filename"].name for to in drawn] == ["mesh_and_fibres.png"]
    for suffix in ("vtu", "csv", "inp"):
        again = read_directions(out / f"directions.{suffix}")
        assert np.allclose(again.warp, OF_SCENE.warp, atol=1e-12)
    assert "8" in capsys.readouterr().out
    assert "edge" not in caplog.text


def test_show_warns_of_directions_that_follow_the_numbering_of_nodes(tmp_path, caplog):
    path = tmp_path / "edges.inp"
    write_directions(path, PULL.mesh, ALONG_EDGES)
    line = ["show", str(path), "--no-render", "--out", str(tmp_path / "out")]
    assert cli.main(line) == 0
    assert "warp runs along edge 1 in 8 of 8 elements" in caplog.text


def test_show_accepts_angles_for_a_mesh_without_directions(tmp_path, capsys):
    out = tmp_path / "out"
    write_directions(tmp_path / "ply.inp", PULL.mesh, OF_SCENE)
    line = ["show", str(tmp_path / "ply.inp"), "--warp", "30", "--weft", "120"]
    assert cli.main([*line, "--no-render", "--out", str(out)]) == 0
    printed = dict(
        row.split(maxsplit=1) for row in capsys.readouterr().out.splitlines()
    )
    assert printed["warp_angle_deg"] == "30 to 30"
    assert printed["weft_angle_deg"] == "120 to 120"
    assert printed["angle_between_deg"] == "90 to 90"
    warp, weft = read_directions(out / "directions.csv").angles_deg()
    assert np.allclose([warp, weft], [[30] * 8, [120] * 8])
