"""Tools as CAD systems export them are repaired, or rejected for the right reason."""

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.mesh.checks import MeshError
from skfem_textile.mesh.graph import boundary_edges
from skfem_textile.surfaces.surface import onto
from tests.helpers import sphere
from tests.helpers.tool_shapes import (
    bonnet,
    cone,
    curved_ring,
    cylinder,
    double_dome,
    facing_up,
    hat,
    hemisphere_with_flange,
    patch,
    plate,
    ring,
    saddle,
    torus_part,
)

BONNET = bonnet(200.0, 150.0, 15.0, askew=True)
CLEAN = drape.TriangleMesh(*BONNET)
EDGE = 10.0

#: Small shapes: their roughness and repairs do not depend on their size.
SMALL = {
    "plate": plate(80.0, 60.0),
    "hemisphere with flange": hemisphere_with_flange(25.0, 8.0, 10.0),
    "hat": hat(60.0, 30.0, 30.0, 15.0),
    "saddle": saddle(100.0, 80.0),
    "bonnet": BONNET,
    "cylinder": cylinder(100.0, 60.0, 60.0),
    "cone": cone(40.0, 15.0, 40.0),
    "torus part": torus_part(100.0, 40.0),
    "double dome": double_dome(),
    "ring": ring(),
    "curved ring": curved_ring(),
}


def soup(x, t, scatter=0.0, seed=0):
    """Triangles with separate corners, which scatter."""
    corners = x[:, t.T.ravel()]
    noise = np.random.default_rng(seed).uniform(-scatter, scatter, corners.shape)
    return corners + noise, np.arange(corners.shape[1]).reshape(-1, 3).T


def mean_edge(x, t):
    return np.linalg.norm(x[:, t[0]] - x[:, t[1]], axis=0).mean()


def flipped(t, share, seed=0):
    """Triangles of which a share is reversed at random."""
    reverse = np.random.default_rng(seed).random(t.shape[1]) < share
    return np.where(reverse, t[::-1], t)


def above(x):
    """Points 3 mm above others."""
    return x + np.array([[0], [0], [3]])


def remark(tool, word):
    """The only remark with a word."""
    (line,) = (line for line in tool.remarks if word in line)
    assert "\n" not in line
    return line


def outline(tool):
    return boundary_edges(tool.facets.cells).shape[1]


# Sewing


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("scatter", [1e-5, 0.05])
def test_scattered_vertices_are_sewn(name, scatter):
    """Relative to the mean edge; the mean of six copies scatters less than each."""
    x, t = SMALL[name]
    edge = mean_edge(x, t)
    clean = drape.TriangleMesh(x, t)
    tool = drape.TriangleMesh(*soup(x, t, scatter * edge))
    assert tool.facets.points.shape == x.shape
    assert outline(tool) == outline(clean)
    smoothed, moved = np.abs(clean.level(x)), np.abs(clean.level(tool.facets.points))
    assert moved.max() < smoothed.max() + 1.5 * scatter * edge
    assert "sewn" in remark(tool, "merged")


def test_clean_triangles_are_not_changed():
    x, t = BONNET
    tool = CLEAN
    assert tool.remarks == ()
    corners = np.sort(tool.facets.points[:, tool.facets.triangles()].mean(axis=1))
    np.testing.assert_allclose(corners, np.sort(x[:, t].mean(axis=1)), atol=1e-12)


def test_the_largest_gap_and_the_number_of_copies_are_reported():
    x, t = plate(size=10.0)
    moved = x.copy()
    left = x[0, t].mean(axis=0) < 0
    moved[2] += 0.25  # a step between two faces
    both = np.hstack([x, moved])
    tool = drape.TriangleMesh(both, np.where(left, t, t + x.shape[1]))
    seam = np.intersect1d(t[:, left], t[:, ~left]).size
    assert f"{seam} copies of vertices merged" in remark(tool, "sewn")
    assert "the largest gap was 0.25 mm" in remark(tool, "sewn")


@pytest.mark.parametrize("sizes", [(10.0, 7.0), (10.0, 4.0), (9.0, 9.5)])
def test_faces_of_different_triangles_are_sewn_along_their_seam(sizes):
    """On a cylinder: the vertices of each lie on arcs over the edges of the other."""
    parts = []
    for side, size in zip((-1, 1), sizes, strict=True):

        def half(s, t, side=side):
            around = np.pi / 3 * (s - 0.5)
            return np.array(
                [100 * np.sin(around), 50 * (t + (side - 1) / 2), 100 * np.cos(around)]
            )

        parts.append(patch(half, 105.0, 50.0, size))
    (x, t), (y, u) = parts
    tool = drape.TriangleMesh(np.hstack([x, y]), np.hstack([t, u + x.shape[1]]))
    assert "inserted into edges" in remark(tool, "sewn")
    loops = tool.facets.boundary()
    assert len(loops) == 1
    ends = np.abs(loops[0][1]) > 49
    sides = np.abs(loops[0][0]) > 49
    assert (ends | sides).all()
    seam = np.linspace(-0.5, 0.5, 31)
    x = np.array([100 * np.sin(seam), 0 * seam, 100 * np.cos(seam)])
    assert np.abs(tool.level(x)).max() < 0.12
    assert not tool.beyond_edges(x).any()


@pytest.mark.parametrize(
    ("scatter", "message"),
    [
        (0.5, "the gaps between them"),
        (0.16, r"3\.\d+ mm, 0\.3\d? of the mean edge, and"),
    ],
)
def test_triangles_that_do_not_meet_are_rejected(scatter, message):
    with pytest.raises(MeshError, match=f"do not meet: .*{message}"):
        drape.TriangleMesh(*soup(*BONNET, scatter * EDGE))


# Sides


@pytest.mark.parametrize("share", [0.1, 0.3])
@pytest.mark.parametrize("scatter", [0.0, 1e-3])
def test_flipped_triangles_are_turned_to_the_side_of_most(share, scatter):
    x, t = BONNET
    wrong = flipped(t, share)
    turned = (wrong != t).any(axis=0).sum()
    tool = drape.TriangleMesh(*soup(x, wrong, scatter))
    text = f"{turned} of {t.shape[1]} triangles turned to the side of the others"
    assert remark(tool, "turned") == text
    points = above(x)
    np.testing.assert_allclose(tool.level(points), CLEAN.level(points), atol=0.02)


def test_triangles_of_which_half_are_flipped_face_upwards():
    x, t = BONNET
    tool = drape.TriangleMesh(x, flipped(t, 0.5))
    assert "upwards (+z)" in remark(tool, "turned")
    assert (tool.level(above(x)) > 0).all()


def test_triangles_that_all_face_down_are_left():
    x, t = BONNET
    tool = drape.TriangleMesh(x, t[::-1])
    assert tool.remarks == ()
    assert (tool.level(above(x)) < 0).all()


def test_a_closed_surface_faces_outwards():
    x, t = sphere(300)
    tool = drape.TriangleMesh(50 * x, flipped(t, 0.8))
    assert "turned outwards" in remark(tool, "turned")
    assert "lies on its outside" in remark(tool, "closed")
    assert (tool.level(52 * x) > 0).all()
    assert not tool.beyond_edges(60 * x).any()


def test_a_surface_with_one_side_is_rejected():
    a, w = np.linspace(0, 2 * np.pi, 61), np.linspace(-10, 10, 5)
    a, w = (s.ravel() for s in np.meshgrid(a, w, indexing="ij"))
    r = 60 + w * np.cos(a / 2)
    x = np.array([r * np.cos(a), r * np.sin(a), w * np.sin(a / 2)])
    k = np.add.outer(5 * np.arange(60), np.arange(4)).ravel()
    t = np.hstack([[k, k + 1, k + 6], [k, k + 6, k + 5]])
    with pytest.raises(MeshError, match="has only one side, like a Moebius strip"):
        drape.TriangleMesh(x, t)


@pytest.mark.parametrize("scatter", [0.0, 1e-4])
def test_triangles_listed_twice_are_removed(scatter):
    """Even with opposite orientation, as exports for both sides list them."""
    x, t = BONNET
    tool = drape.TriangleMesh(*soup(x, np.hstack([t, t[::-1]]), scatter))
    assert f"{t.shape[1]} duplicate triangle(s)" in remark(tool, "duplicate")
    np.testing.assert_allclose(tool.level(x), CLEAN.level(x), atol=1e-9 + scatter)


# Shape


@pytest.mark.parametrize("thickness", [1.0, 3.0, 8.0])
def test_a_thin_shell_is_rejected(thickness):
    x, t = BONNET
    both = np.hstack([x, x - [[0], [0], [thickness]]])
    with pytest.raises(MeshError, match=r"opposite sides .*only the side that is drap"):
        drape.TriangleMesh(both, np.hstack([t, t[::-1] + x.shape[1]]))


def test_both_sides_of_a_thick_part_remain():
    x, t = BONNET
    both = np.hstack([x, x - [[0], [0], [40]]])
    tool = drape.TriangleMesh(both, np.hstack([t, t[::-1] + x.shape[1]]))
    assert "2 separate parts" in remark(tool, "separate")
    np.testing.assert_allclose(tool.level(x), CLEAN.level(x), atol=1e-9)


@pytest.mark.parametrize(("share", "is_told"), [(3e-5, False), (3e-4, True)])
def test_a_part_of_a_small_share_of_the_area_is_not_counted(share, is_told):
    x, t = SMALL["plate"]
    side = np.sqrt(2 * share * 80.0 * 60.0)
    part = np.array([[200, 200 + side, 200], [0, 0, side], [0, 0, 0]])
    triangles = np.column_stack([t, x.shape[1] + np.arange(3)])
    remarks = drape.TriangleMesh(np.hstack([x, part]), triangles).remarks
    assert any("2 separate parts" in line for line in remarks) == is_told


def test_one_edge_of_three_triangles_is_told():
    x, t = BONNET
    fin = np.append(t[:2, 100], x.shape[1])
    tip = x[:, t[:2, 100]].mean(axis=1) - [0, 0, 9]
    tool = drape.TriangleMesh(np.column_stack([x, tip]), np.column_stack([t, fin]))
    assert remark(tool, "two triangles").startswith("1 edge(s) belong to more")


def test_holes_are_reported_with_their_place():
    x, t = ring()
    line = remark(drape.TriangleMesh(np.add(x, [[7], [0], [0]]), t), "hole")
    assert "1 hole(s)" in line
    assert "251 mm around (7, 0, 0) mm" in line


@pytest.mark.parametrize("wrong", [1e30, -2e5, np.nan, np.inf])
def test_a_coordinate_that_is_not_sane_is_named(wrong):
    x, t = saddle()
    x[1, 17] = wrong
    triangle = np.flatnonzero((t == 17).any(axis=0))[0] + 1
    with pytest.raises(MeshError, match=rf"triangle {triangle} has a corner at \("):
        drape.TriangleMesh(x, t)


def test_a_spike_is_named():
    x, t = BONNET
    inside = np.abs(x[0] - 20) + np.abs(x[1] + 10)
    vertex = inside.argmin()
    for height, error in ((30.0, False), (2000.0, True)):
        y = x.copy()
        y[2, vertex] += height
        place = f"({y[0, vertex]:.6g}, {y[1, vertex]:.6g}, "
        if error:
            with pytest.raises(MeshError, match="like a spike") as caught:
                drape.TriangleMesh(y, t)
            assert place in str(caught.value)
        else:
            assert place in remark(drape.TriangleMesh(y, t), "away from the smooth")


def test_ribs_are_rejected():
    x, t = plate(size=10.0)
    spine = np.flatnonzero(np.abs(x[1]) < 5)
    spine = spine[x[1, spine] == x[1, spine[0]]]
    spine = spine[np.argsort(x[0, spine])]
    k, n = np.arange(len(spine) - 1), x.shape[1]
    rib = [[spine[:-1], spine[1:], n + k + 1], [spine[:-1], n + k + 1, n + k]]
    y = np.hstack([x, x[:, spine] - [[0], [0], [9]]])
    with pytest.raises(MeshError, match=r"edge\(s\) belong to more than two triangles"):
        drape.TriangleMesh(y, np.hstack([t, *map(np.array, rib)]))


# Roughness


@pytest.mark.parametrize("name", SMALL)
def test_clean_shapes_have_no_noise(name):
    assert not any("scatter by" in r for r in drape.TriangleMesh(*SMALL[name]).remarks)


@pytest.mark.parametrize("noise", [0.01, 0.08])
@pytest.mark.parametrize("name", ["plate", "hat", "saddle", "double dome"])
def test_the_standard_deviation_of_noise_is_measured(name, noise):
    x, t = SMALL[name]
    edge = mean_edge(x, t)
    rng = np.random.default_rng(4)
    tool = drape.TriangleMesh(x + noise * edge * rng.standard_normal(x.shape), t)
    words = remark(tool, "scatter by").split()
    assert float(words[4]) == pytest.approx(noise * edge, rel=0.25)
    assert float(words[6]) == pytest.approx(noise, rel=0.25)


def shear(tool):
    """Shear angles of a net from the top of a hat, in degrees."""
    foot = onto(tool, np.array([[0.0], [0.0], [40.0]]))[:, 0]
    surface = tool.moved(*drape.Axes.at(tool, foot))
    return np.degrees(drape.net(surface, 70 / 16, (16, 16), (16, 16)).shear_angle())


@pytest.mark.parametrize("noise", [0.03])
def test_noise_changes_shear_angles_by_less_than_reported(noise):
    """By 150° times the noise relative to the mean edge; up to 125° here."""
    x, t = hat(150.0, flange=30.0, bow=400.0, size=6.0)
    edge = mean_edge(x, t)
    rng = np.random.default_rng(0)
    tool = drape.TriangleMesh(x + noise * edge * rng.standard_normal(x.shape), t)
    reported = float(remark(tool, "scatter by").split()[-2])
    error = np.abs(shear(tool) - shear(drape.TriangleMesh(x, t))).max()
    assert 0.2 * reported < error < 1.1 * reported  # it has one digit


def test_a_rough_surface_is_rejected():
    x, t = BONNET
    rng = np.random.default_rng(4)
    rough = x + 0.15 * EDGE * rng.standard_normal(x.shape)
    with pytest.raises(MeshError, match=r"scatter by 1.* of the mean edge"):
        drape.TriangleMesh(*facing_up(rough, t))


# Holes


@pytest.mark.parametrize("name", ["ring", "curved ring"])
def test_a_patch_over_a_hole_continues_the_surface(name):
    """A plane exactly; a sphere of R 120 over a hole of R 40 to 0.5 mm."""
    tool = drape.TriangleMesh(*SMALL[name])
    whole = tool.without_holes()
    assert not any("hole" in line for line in whole.remarks)
    assert len(whole.facets.boundary()) == 1
    patch = whole.facets.points[:, np.hypot(*whole.facets.points[:2]) < 39]
    assert patch.shape[1] > 100
    if name == "ring":
        np.testing.assert_allclose(patch[2], 0, atol=1e-9)
    else:
        np.testing.assert_allclose(np.linalg.norm(patch, axis=0), 120, atol=0.5)
    edges = whole.facets.longest_edges()
    assert edges.max() < 2 * tool.facets.longest_edges().max()
    assert not whole.beyond_edges(patch).any()
    normal = whole.gradient(patch)
    assert (normal[2] > 0).all()


def test_missing_triangles_are_filled():
    x, t = BONNET
    tool = drape.TriangleMesh(x, np.delete(t, [200, 500], axis=1))
    whole = tool.without_holes()
    assert whole.facets.n_elements == t.shape[1]
    assert len(whole.facets.boundary()) == 1
