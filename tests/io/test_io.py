import json
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from helpers import distorted, wobble
from skfem import MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    MeshError,
    OnePoint,
    Ply,
)
from skfem_textile.cli.results.result_folder import ResultFolder
from skfem_textile.io import (
    read_mesh,
    write_draped,
    write_fields,
    write_history,
    write_summary,
)
from skfem_textile.io.fields import cell_fields
from skfem_textile.mesh.splitting import split
from skfem_textile.scenes import strip
from skfem_textile.scenes.rectangle import rectangle

POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])

INP = """*HEADING
*NODE
1, 0.0, 0.0
2, 1.0, 0.0
3, 2.0, 0.0
4, 0.0, 1.0
5, 1.0, 1.0
6, 2.0, 1.0
*ELEMENT, TYPE=CPS4, ELSET=PLY
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*NSET, NSET=bottom
1, 2, 3
*NSET, NSET=right
3, 6
*NSET, NSET=corner
1
"""


def saved(path, cells, points=POINTS, **more):
    meshio.Mesh(points, cells, **more).write(path)
    return path


def test_a_plane_may_lie_anywhere_but_for_round_off(tmp_path):
    points = POINTS + np.outer(3 + 1e-16 * np.arange(6), [0, 0, 1])
    assert read_mesh(saved(tmp_path / "m.vtu", {"quad": QUADS}, points)).nelements == 2


def test_vtu_is_read(tmp_path):
    mesh = read_mesh(saved(tmp_path / "m.vtu", {"quad": QUADS}))
    np.testing.assert_array_equal(mesh.t, QUADS.T)
    np.testing.assert_array_equal(mesh.p, POINTS[:, :2].T)


def test_abaqus_node_sets_become_boundaries(tmp_path):
    (tmp_path / "m.inp").write_text(INP)
    mesh = read_mesh(tmp_path / "m.inp")
    assert set(mesh.boundaries) == {"bottom", "right"}
    bottom = mesh.p[1, mesh.facets[:, mesh.boundaries["bottom"]]]
    assert bottom.shape == (2, 2)
    assert np.all(bottom == 0)


def test_gmsh_physical_groups_become_boundaries(tmp_path):
    tags = {
        "gmsh:physical": [[3, 3], [1, 1, 2]],
        "gmsh:geometrical": [[1, 1], [1, 1, 2]],
    }
    meshio.Mesh(
        POINTS,
        [("quad", QUADS), ("line", [[0, 1], [1, 2], [2, 5]])],
        cell_data=tags,
        field_data={
            "bottom": np.array([1, 1]),
            "right": np.array([2, 1]),
            "ply": np.array([3, 2]),
        },
    ).write(tmp_path / "m.msh", file_format="gmsh22")
    boundaries = read_mesh(tmp_path / "m.msh").boundaries
    assert {k: len(v) for k, v in boundaries.items()} == {"bottom": 2, "right": 1}


TRIANGLES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])


@pytest.mark.parametrize(
    ("cells", "count"),
    [
        ([("triangle", TRIANGLES[:2]), ("quad", QUADS[1:])], 10),
        (
            [
                ("quad", QUADS[:1]),
                ("triangle", TRIANGLES[2:3]),
                ("triangle", TRIANGLES[3:]),
            ],
            10,
        ),
    ],
)
def test_meshes_of_both_are_split(tmp_path, cells, count):
    mesh = read_mesh(saved(tmp_path / "m.vtu", cells))
    assert mesh.nelements == count
    np.testing.assert_array_equal(mesh.p[:, :6], POINTS[:, :2].T)
    assert sum(c.shape[1] for c in mesh.cells) == sum(len(c) for _, c in cells)


def test_physical_groups_of_triangles_keep_their_names(tmp_path):
    tags = {
        "gmsh:physical": [[3, 3, 4, 4], [1, 1, 2]],
        "gmsh:geometrical": [[1, 1, 1, 1], [1, 1, 2]],
    }
    meshio.Mesh(
        POINTS,
        [("triangle", TRIANGLES), ("line", [[0, 1], [1, 2], [2, 5]])],
        cell_data=tags,
        field_data={
            "bottom": np.array([1, 1]),
            "right": np.array([2, 1]),
            "ply": np.array([3, 2]),
            "patch": np.array([4, 2]),
        },
    ).write(tmp_path / "m.msh", file_format="gmsh22")
    mesh = split(read_mesh(tmp_path / "m.msh"))
    assert {k: len(v) for k, v in mesh.boundaries.items()} == {"bottom": 4, "right": 2}
    bottom = mesh.p[:, mesh.facets[:, mesh.boundaries["bottom"]]]
    assert np.all(bottom[1] == 0)
    assert {k: len(v) for k, v in mesh.subdomains.items()} == {"ply": 6, "patch": 6}
    assert mesh.p[0, mesh.t[:, mesh.subdomains["patch"]]].min() == 1.0


TRIANGLES_INP = INP.replace("CPS4", "CPS3").replace(
    "1, 1, 2, 5, 4\n2, 2, 3, 6, 5\n",
    "1, 1, 2, 5\n2, 1, 5, 4\n3, 2, 3, 6\n4, 2, 6, 5\n",
)


def test_triangles_are_read_as_they_are(tmp_path):
    (tmp_path / "m.inp").write_text(TRIANGLES_INP)
    mesh = read_mesh(tmp_path / "m.inp")
    assert isinstance(mesh, MeshTri)
    np.testing.assert_array_equal(np.sort(mesh.t.T), np.sort(TRIANGLES))
    np.testing.assert_array_equal(mesh.p, POINTS[:, :2].T)
    boundaries = {k: mesh.facets[:, v].T.tolist() for k, v in mesh.boundaries.items()}
    assert boundaries == {"bottom": [[0, 1], [1, 2]], "right": [[2, 5]]}


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([("triangle", TRIANGLES + 1)], r"2 triangle.* name a node that is not there"),
        ([("triangle", TRIANGLES[:2])], r"2 node.*belong to no triangle.*: 2, 5"),
    ],
)
def test_bad_triangles_are_refused_by_name(tmp_path, cells, message):
    path = saved(tmp_path / "bad.vtu", cells)
    with pytest.raises(MeshError, match=f"bad.vtu: .*{message}"):
        read_mesh(path)


def test_node_sets_of_triangles_become_boundaries(tmp_path):
    (tmp_path / "m.inp").write_text(TRIANGLES_INP)
    boundaries = split(read_mesh(tmp_path / "m.inp")).boundaries
    assert {k: len(v) for k, v in boundaries.items()} == {"bottom": 4, "right": 2}


@pytest.mark.parametrize(
    ("cells", "points", "message"),
    [
        ({"triangle": [[0, 1, 4]]}, POINTS, "node.*belong to no triangle.*: 2, 3"),
        ({"triangle": [[0, 1, 9]]}, POINTS, "nodes 0 to 5 only"),
        ({"triangle": [[0, 1, 2]]}, POINTS[:3], "inverted or degenerate"),
        (
            [("quad", QUADS[:1]), ("tetra", [[1, 2, 5, 3]])],
            POINTS,
            "triangles and four-node quadrilaterals are supported, found quad, tetra",
        ),
        ({"quad": QUADS[:, [0, 2, 1, 3]]}, POINTS, r"2 quad.* inverted or degenerate"),
        ({"quad": QUADS[:1]}, POINTS, r"2 node.*belong to no quadrilateral.*: 2, 5"),
        (
            {"quad": QUADS},
            POINTS + np.outer(np.arange(6), [0, 0, 1]),
            "plane z = const",
        ),
        ({"line": [[0, 1]]}, POINTS, "found none"),
        ({"quad": QUADS + 1}, POINTS, r"1 quad.* name a node that is not there .*: 1"),
    ],
    ids=[
        *("unused corner", "triangle index", "flat triangle", "solids"),
        *("inverted", "unused", "space", "lines", "index"),
    ],
)
def test_bad_meshes_are_refused_by_name(tmp_path, cells, points, message):
    path = saved(tmp_path / "bad.vtu", cells, points)
    with pytest.raises(MeshError, match=f"bad.vtu: .*{message}"):
        read_mesh(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [("no.vtu", None), ("empty.vtu", ""), ("text.msh", "hello"), ("mesh.xyzzy", "1 2")],
)
def test_unreadable_files_are_refused_in_one_line(tmp_path, capfd, name, content):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(MeshError, match=name) as error:
        read_mesh(tmp_path / name)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


@pytest.fixture
def result():
    scene = strip(size=(2, 3))
    ply = Ply(scene.mesh, Fabric(1e4, 0.5), OnePoint(5.0))
    return LoadStepper(ply, scene.conditions, steps=2).run()


def test_fields_are_written_for_every_state(tmp_path, result):
    write_fields(result, tmp_path)
    files = sorted(tmp_path.glob("*.vtu"))
    assert [f.name for f in files] == [f"step_000{i}.vtu" for i in range(3)]
    saved = meshio.read(files[-1])
    assert set(saved.point_data) == {"displacement"}
    assert set(saved.cell_data) == {
        "warp_strain",
        "weft_strain",
        "warp_tension",
        "weft_tension",
        "shear_angle",
        "warp_direction",
        "weft_direction",
    }
    u = result.ply.nodal(result.u)
    np.testing.assert_allclose(saved.point_data["displacement"][:, :2], u.T)
    np.testing.assert_array_equal(saved.points[:, :2], result.ply.mesh.p.T)
    steps = ElementTree.parse(tmp_path / "steps.pvd").findall("Collection/DataSet")
    assert [step.get("file") for step in steps] == [f.name for f in files]
    assert [float(step.get("timestep")) for step in steps] == [
        state.load_factor for state in result.states
    ]
    np.testing.assert_allclose(
        saved.cell_data["shear_angle"][0],
        np.degrees(result.ply.shear_angle(result.u))[:, 0],
    )
    np.testing.assert_allclose(
        np.linalg.norm(saved.cell_data["weft_direction"][0], axis=1), 1.0
    )


@pytest.mark.parametrize("series", ["steps.pvd", "own_steps.pvd"])
def test_a_series_of_steps_is_warped_once(tmp_path, series):
    pv = pytest.importorskip("pyvista")
    scene = strip(split(rectangle(40, 60, (2, 3), "irregular", 0.3)))
    ply = Ply(scene.mesh, Fabric(1e4), Macro())
    result = LoadStepper(ply, scene.conditions, steps=2).run()
    write_fields(result, tmp_path)
    reader = pv.get_reader(tmp_path / series)
    assert reader.time_values == [state.load_factor for state in result.states]
    reader.set_active_time_value(1.0)
    (fields,) = reader.read()
    n = fields.n_points
    assert fields.active_scalars_name == "shear_angle"
    np.testing.assert_array_equal(fields.points[:, :2], ply.nodes.T[:n])
    current = (ply.nodes + ply.nodal(result.u)).T[:n]
    np.testing.assert_allclose(fields.warp_by_vector().points[:, :2], current)


def test_a_ply_in_space_is_written_in_space(tmp_path):
    mesh = rectangle(2, 2, (2, 2), "irregular", 0.0, 1)
    ply = Ply(mesh, Fabric(100.0, 1.0), Macro(), dimension=3)
    lift = Condition("right", (0.0, 0.0, 0.5))
    result = LoadStepper(ply, {"left": Condition("left"), "right": lift}, 2).run()
    write_fields(result, tmp_path)
    last = meshio.read(tmp_path / "own_step_0002.vtu")
    moved = last.point_data["displacement"]
    np.testing.assert_allclose(moved, ply.nodal(result.u)[:, : len(moved)].T)
    assert moved[:, 2].max() == pytest.approx(0.5)
    assert (last.cell_data["warp_direction"][0][:, 2] > 0.2).all()
    write_history(result, tmp_path / "history.csv")
    head = (tmp_path / "history.csv").read_text().splitlines()[0]
    assert "right_reaction_z" in head
    assert "right_displacement_z" in head
    write_draped(result, tmp_path)
    draped = meshio.read(tmp_path / "fibres.vtu")
    assert draped.points[:, 2].max() == pytest.approx(0.5)
    np.testing.assert_allclose(
        draped.cell_data["warp_direction"][0], last.cell_data["warp_direction"][0]
    )
    rows = (tmp_path / "fibres.csv").read_text().splitlines()
    assert len(rows) == 1 + ply.on_users_elements(np.ones(ply.mesh.nelements)).size


def test_of_several_points_the_extreme_is_shown():
    ply = Ply(distorted(1), Fabric(10.0), Full())
    u = wobble(ply, 1)
    strain = ply.fibre_strain(u)[0]
    shown = cell_fields(ply, u)["warp_strain"]
    np.testing.assert_array_equal(np.abs(shown), np.abs(strain).max(axis=1))
    assert (shown < 0).any()


def test_history_and_summary_are_written(tmp_path, result):
    write_history(result, tmp_path / "history.csv")
    header, *rows = (tmp_path / "history.csv").read_text().splitlines()
    assert header.startswith(
        "load_factor,linear_solves,residual,tolerance,negative_pivots,min_det_F,"
        "max_fibre_strain,mesh_fibre_strain,bottom_displacement_x,"
    )
    assert len(rows) == 3
    for row, state in zip(rows, result.history(), strict=True):
        written = [float(x) for x in row.split(",")]
        np.testing.assert_allclose(written, list(state.values()), rtol=1e-11)
        assert len(row.split(",")[-1].strip("-").replace(".", "")) <= 12
    write_summary(result.summary(), tmp_path / "summary.json")
    assert json.loads((tmp_path / "summary.json").read_text()) == result.summary()


NAMES = ("summary.json", "picture.png", "fields/step_[0-9]*.vtu")


def test_a_result_replaces_the_one_before_and_nothing_else(tmp_path):
    out = tmp_path / "out"
    with ResultFolder(out, NAMES) as folder:
        (folder / "fields").mkdir()
        for name in ("summary.json", "picture.png", "fields/step_0001.vtu"):
            (folder / name).write_text("old")
    (out / "fields" / "mine.pvsm").write_text("kept")
    (out / "mine").write_text("kept")
    with ResultFolder(out, NAMES) as folder:
        (folder / "fields").mkdir()
        for name in ("summary.json", "fields/step_0000.vtu"):
            (folder / name).write_text("new")
    files = {str(p.relative_to(out)): p for p in out.rglob("*") if p.is_file()}
    assert set(files) == {
        "summary.json",
        "fields/step_0000.vtu",
        "fields/mine.pvsm",
        "mine",
    }
    assert files["summary.json"].read_text() == "new"


def test_an_interrupted_run_leaves_the_folder_as_it_was(tmp_path):
    def interrupted(out):
        with ResultFolder(out, NAMES) as folder:
            (folder / "summary.json").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "summary.json").write_text("whole")
    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path / "old")
    assert [p.name for p in (tmp_path / "old").iterdir()] == ["summary.json"]
    assert (tmp_path / "old" / "summary.json").read_text() == "whole"


def test_what_stands_in_the_way_is_refused_at_once(tmp_path):
    (tmp_path / "summary.json").mkdir()
    (tmp_path / "file").write_text("")
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / "fields").write_text("")
    for path, message in [
        (tmp_path, "summary.json is a folder"),
        (tmp_path / "file", "cannot write results to .*file"),
        (tmp_path / "ours", "fields is no folder"),
    ]:
        with pytest.raises(OSError, match=message):
            ResultFolder(path, NAMES)


def test_stale_steps_are_removed(tmp_path, result):
    (tmp_path / "step_0099.vtu").write_text("stale")
    (tmp_path / "step_notes.txt").write_text("mine")
    write_fields(result, tmp_path)
    assert not (tmp_path / "step_0099.vtu").exists()
    assert (tmp_path / "step_notes.txt").exists()


def test_of_two_runs_into_one_folder_the_second_is_told(tmp_path):
    out = tmp_path / "new" / "out"
    first = ResultFolder(out, NAMES)
    with pytest.raises(BlockingIOError, match=f"another run is writing to {out}"):
        ResultFolder(out, NAMES)
    with first as folder:
        (folder / "summary.json").write_text("{}")
    ResultFolder(out, NAMES)
    assert [p.name for p in out.iterdir()] == ["summary.json"]


def test_a_folder_into_which_nothing_comes_is_not_left(tmp_path):
    out = tmp_path / "new" / "out"
    results = ResultFolder(out, NAMES)
    assert out.is_dir()
    del results
    assert list(tmp_path.iterdir()) == []


def test_what_others_wrote_into_a_new_folder_stays_when_results_cannot(tmp_path):
    """A checkpoint, say."""
    out = tmp_path / "out"
    results = ResultFolder(out, NAMES)
    (out / "checkpoint").mkdir()
    with pytest.raises(OSError, match="full"), results:
        raise OSError("full")
    assert [p.name for p in out.iterdir()] == ["checkpoint"]
