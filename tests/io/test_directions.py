"""Fibre directions in files: round trips, Abaqus orientations, and rejected files."""

from contextlib import nullcontext

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import Fabric, LoadStepper, MeshError, Ply
from skfem_textile.fabric.directions import FibreDirections, directions_of
from skfem_textile.io import read_directions, read_mesh, write_directions, write_draped
from skfem_textile.mesh.selection import named_nodes, with_named_nodes
from skfem_textile.scenes import bias_extension
from tests.helpers import distorted
from tests.helpers.decks import DIRECTIONS

MESH = distorted(1, (4, 3))
ANGLES = np.random.default_rng(1).uniform(-180, 180, 12)
GIVEN = FibreDirections.of_angles(ANGLES, ANGLES + np.linspace(40, 140, 12))


def unit(v):
    return v / np.hypot(*v)


def angle_between(one, other):
    return max(
        np.abs(unit(getattr(one, name)) - unit(getattr(other, name))).max()
        for name in ("warp", "weft")
    )


@pytest.mark.parametrize(
    "mesh", [MESH, MeshTri().refined(1)], ids=["quads", "triangles"]
)
def test_a_round_trip_through_deck_vtu_and_csv_loses_nothing(tmp_path, mesh):
    n = mesh.nelements
    original = FibreDirections(GIVEN.warp[:, :n], GIVEN.weft[:, :n])
    read = original
    for name in ("a.inp", "b.vtu", "c.csv", "d.inp"):
        write_directions(tmp_path / name, mesh, read)
        read = read_directions(tmp_path / name)
        assert angle_between(original, read) < 1e-12
        if name != "c.csv":
            again = read_mesh(tmp_path / name)
            assert np.array_equal(again.p, mesh.p)
            assert np.array_equal(again.t, mesh.t)


def test_a_deck_keeps_sets_with_names_that_differ_in_case_alone(tmp_path):
    mesh = MeshQuad().refined(2).scaled(50.0).with_defaults()
    sides, (x, y) = mesh.boundaries, mesh.p[:, mesh.t].mean(axis=1)
    edges = {"Left": sides["left"], "left": sides["right"], "a b": sides["top"]}
    parts = {
        "LOW": y < 25,
        "low": x < 25,
        "HIGH": y > 25,
        "PLY": x > 25,
        "COVERED": y < 9,
    }
    parts = {name: np.flatnonzero(mask) for name, mask in parts.items()}
    named = MeshQuad(mesh.p, mesh.t, _boundaries=edges, _subdomains=parts)
    named = with_named_nodes(
        named, {"middle": np.array([8]), "Middle": np.array([3, 7])}
    )
    n = mesh.nelements
    written = FibreDirections.of_angles(np.linspace(0, 50, n), np.linspace(70, 99, n))
    write_directions(tmp_path / "a.inp", named, written)
    read = read_mesh(tmp_path / "a.inp")
    np.testing.assert_allclose(read.p, mesh.p, rtol=1e-12)
    for mine, theirs in ((edges, read.boundaries), (parts, read.subdomains)):
        assert set(mine) == set(theirs)
        for name, members in mine.items():
            np.testing.assert_array_equal(np.sort(members), theirs[name])
    nodes = {name: at.tolist() for name, at in named_nodes(read).items()}
    assert nodes == {"middle": [8], "Middle": [3, 7]}
    assert angle_between(written, read_directions(tmp_path / "a.inp")) < 1e-12


def test_a_vtu_preserves_every_bit(tmp_path):
    write_directions(tmp_path / "a.vtu", MESH, GIVEN)
    read = read_directions(tmp_path / "a.vtu")
    assert np.array_equal(read.warp, GIVEN.warp)
    assert np.array_equal(read.weft, GIVEN.weft)


def test_angles_alone_in_cell_data_are_read(tmp_path):
    write_directions(tmp_path / "a.vtu", MESH, GIVEN)
    text = (tmp_path / "a.vtu").read_text()
    text = text.replace('Name="warp_direction"', 'Name="other"')
    (tmp_path / "b.vtu").write_text(text)
    assert angle_between(read_directions(tmp_path / "b.vtu"), GIVEN) < 1e-12


A = "*ORIENTATION, NAME=A"
SECTIONS = """*ELSET, ELSET=FIRST
11,
*ORIENTATION, NAME=A
1., 0., 0., 0., 1., 0.
3, 0.
*ORIENTATION, NAME=B, LOCAL DIRECTIONS=2
1., 0., 0., 0., 1., 0.
3, 0.
1., 1.
0., 1.
*MEMBRANE SECTION, ELSET=FIRST, MATERIAL=M, ORIENTATION=A
1.,
*SHELL SECTION, ELSET=last, MATERIAL=M, ORIENTATION=b
1.,
"""
DISTRIBUTED = f"""*DISTRIBUTION TABLE, NAME=T
angle
*DISTRIBUTION, NAME=D, LOCATION=ELEMENT, TABLE=T
, 10.
LAST, 20.
{A}
1., 0., 0., 0., 1., 0.
3, D
"""
TURNED = DISTRIBUTED.replace("LAST, 20.", "11, 30.")


@pytest.mark.parametrize(
    ("text", "warp", "weft"),
    [
        (f"{A}\n1., 1., 0., 0., 1., 0.\n3, 0.\n", 135, 45),  # the weft is the first
        (f"{A}\n1, 0, 0, 0, 1, 0\n3, 30.\n", 120, 30),
        (f"{A}\n1, 0, 0, 0, -1, 0\n3, 30.\n", -120, -30),  # the third points down
        (f"{A}\n1, 0, 0, 0, 1, 0, 5, 0, 0\n3, 0.\n", 90, 180),  # the origin is past a
        (f"{A}\n0, 0, 1, 1, 0, 0\n1, 0.\n", 90, 0),  # about the first, the normal
        (f"{A}\n1, 0, 0, 0, 0, -1\n2, 0.\n", 0, 90),  # 3 and 1 lie in the plane
        (DISTRIBUTED, [100, 110], [10, 20]),  # a default, and a set
        (TURNED, [120, 100], [30, 10]),  # a default, and an element
        (SECTIONS, [90, 90], [0, 45]),  # yarns need not be square
    ],
)
def test_orientations_of_abaqus_turn_axes_of_sections_and_elements(
    tmp_path, text, warp, weft
):
    (tmp_path / "deck.inp").write_text(DIRECTIONS + text)
    read = np.array(read_directions(tmp_path / "deck.inp").angles_deg())
    error = read - np.stack(np.broadcast_arrays(warp, weft)).reshape(2, -1)
    assert np.abs((error + 180) % 360 - 180).max() < 1e-12


def test_draped_fibres_agree_with_the_deformed_ply(tmp_path):
    scene = bias_extension(size=(4, 8))
    ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
    result = LoadStepper(ply, scene.conditions, steps=2).run()
    write_draped(result, tmp_path)
    read = [read_directions(tmp_path / f"fibres.{s}") for s in ("vtu", "csv", "inp")]
    assert angle_between(read[0], read[1]) < 1e-12
    assert angle_between(read[0], read[2]) < 1e-12
    warp, weft = read[0].angles_deg()
    sheared = 90 - (weft - warp)
    angle = ply.on_users_elements(np.degrees(ply.shear_angle(result.u)).mean(axis=1))
    assert np.abs(sheared - angle).max() < 2.0  # means over parts, of two kinds
    assert sheared.max() > 35
    n = scene.mesh.nvertices
    moved = scene.mesh.p + ply.nodal(result.u)[:, :n]
    assert np.allclose(read_mesh(tmp_path / "fibres.inp").p, moved, atol=1e-12)


def test_tables_of_directions_may_have_semicolons_and_decimal_commas(tmp_path):
    rows = ["element;warp_angle_deg;weft_angle_deg", "1;22,5;112,5"]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    warp, weft = read_directions(tmp_path / "a.csv").angles_deg()
    assert (warp[0], weft[0]) == pytest.approx((22.5, 112.5))


def test_a_boundary_of_many_nodes_is_written_once_in_a_deck(tmp_path):
    """It continues on further lines."""
    mesh = MeshQuad.init_tensor(np.arange(41.0), np.arange(3.0)).with_defaults()
    directions = directions_of(mesh, Fabric(warp=(1, 0), weft=(0, 1)))
    write_directions(tmp_path / "m.inp", mesh, directions)
    lines = (tmp_path / "m.inp").read_text().splitlines()
    first = lines.index("*NSET, NSET=bottom") + 1
    last = next(i for i, x in enumerate(lines[first:], first) if x.startswith("*"))
    numbers = [int(x) for line in lines[first:last] for x in line.split(",")]
    expected = np.unique(mesh.facets[:, mesh.boundaries["bottom"]]) + 1
    assert numbers == expected.tolist()


@pytest.mark.parametrize(("z", "text"), [(3e-6, ""), (3e-5, "must lie in the plane")])
def test_directions_lie_in_the_plane_up_to_six_digits(tmp_path, z, text):
    points, cells = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]]
    vectors = {"warp_direction": [[[1, 0, z]]], "weft_direction": [[[0, 1, 0]]]}
    data = {name: np.array(v, dtype=float) for name, v in vectors.items()}
    grid = meshio.Mesh(points, [("triangle", cells)], cell_data=data)
    grid.write(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match=text) if text else nullcontext():
        read_directions(tmp_path / "a.vtu")
