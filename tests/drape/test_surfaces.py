"""Surfaces: derivatives, curvatures that are known, growth, smoothed triangles."""

import meshio
import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.io import read_surface
from skfem_textile.mesh.checks import MeshError
from skfem_textile.solve.surface import Grown, OffSurfaceError, is_on, onto
from tests.helpers import sphere

RNG = np.random.default_rng(1)


SURFACES = {
    "plane": drape.Plane((1, 2, 3), (1, -2, 2)),
    "cylinder": drape.Cylinder(3.0, (1, 0, 2), (1, 2, 3)),
    "sphere": drape.Sphere(4.0, (1, 2, 0)),
    "cone": drape.Cone(0.6, (1, 1, -9), (0.2, 0.1, 1)),
    "torus": drape.Torus(9.0, 2.0, (0, 1, 0), (0.3, 0, 1)),
    "double dome": drape.double_dome(6.0, 18.0, 7.5, 0.25, 6.0),
    "triangles": drape.TriangleMesh(*[sphere(600)[0] * 5, sphere(600)[1]]),
    "grown": Grown(drape.Sphere(4.0, (0, 0, -4)), np.zeros(3), 0.3),
}

every_surface = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)


def points(surface):
    """Points near a surface."""
    x = onto(surface, RNG.uniform(2, 5, (3, 40)))
    return x + RNG.uniform(-0.05, 0.05, x.shape)


@every_surface
def test_derivatives_are_those_of_the_level(surface):
    x, d, h = points(surface), RNG.standard_normal((3, 40)), 1e-5
    level = (surface.level(x + h * d) - surface.level(x - h * d)) / (2 * h)
    gradient = (surface.gradient(x + h * d) - surface.gradient(x - h * d)) / (2 * h)
    slope = surface.gradient(x)
    np.testing.assert_allclose(level, (slope * d).sum(axis=0), rtol=1e-7, atol=1e-7)
    hessian = surface.hessian(x)
    np.testing.assert_allclose(
        gradient, np.einsum("ijn,jn->in", hessian, d), rtol=1e-6, atol=1e-6
    )
    np.testing.assert_allclose(hessian, hessian.swapaxes(0, 1), atol=1e-12)


def test_derivatives_of_triangles_are_those_of_the_level_far_away_too():
    """Where the weights reach further, as the nearest vertex is further away."""
    surface, h = SURFACES["triangles"], 1e-5
    away = RNG.standard_normal((3, 40))
    x = away / np.linalg.norm(away, axis=0) * RNG.uniform(6.5, 12.0, 40)
    for d in np.eye(3)[:, :, None]:
        slope = surface.level(x + h * d) - surface.level(x - h * d)
        bend = surface.gradient(x + h * d) - surface.gradient(x - h * d)
        gradient = (surface.gradient(x) * d).sum(axis=0)
        hessian = np.einsum("ijn,jk->in", surface.hessian(x), d)
        np.testing.assert_allclose(slope / (2 * h), gradient, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(bend / (2 * h), hessian, rtol=1e-5, atol=1e-5)


@every_surface
def test_points_are_brought_onto_the_surface(surface):
    x = points(surface)
    assert not is_on(surface, x)
    assert is_on(surface, onto(surface, x))


def test_points_move_along_what_is_free_alone():
    x = np.array([[1.0], [2.0], [4.5]])
    free = np.diag([0.0, 0.0, 1.0])[None]
    end = onto(SURFACES["sphere"], x, free)
    np.testing.assert_array_equal(end[:2], x[:2])
    assert end[2, 0] == pytest.approx(4.0)
    with pytest.raises(OffSurfaceError, match="no way to the surface"):
        onto(SURFACES["sphere"], np.array([[9.0], [2.0], [1.0]]), free)


def test_curvatures_of_sphere_cylinder_and_torus():
    outer = np.array([[11.0], [1.0], [0.0]])
    torus = drape.Torus(9.0, 2.0, (0, 1, 0))
    np.testing.assert_allclose(
        torus.hessian(outer)[..., 0], np.diag([0, 1 / 11, 1 / 2]), atol=1e-15
    )
    sphere = drape.Sphere(4.0).hessian(np.array([[4.0], [0.0], [0.0]]))
    np.testing.assert_allclose(sphere[..., 0], np.diag([0, 0.25, 0.25]))
    cylinder = drape.Cylinder(4.0).hessian(np.array([[4.0], [7.0], [0.0]]))
    np.testing.assert_allclose(cylinder[..., 0], np.diag([0, 0, 0.25]))


def test_a_surface_grows_out_of_its_tangent_plane():
    x, sphere = RNG.uniform(-1, 1, (3, 9)), drape.Sphere(4.0, (0, 0, -4))
    np.testing.assert_allclose(Grown(sphere, np.zeros(3), 0.0).level(x), x[2])
    half = Grown(sphere, np.zeros(3), 0.5)
    larger = drape.Sphere(8.0, (0, 0, -8))
    np.testing.assert_allclose(half.level(x), larger.level(x))
    np.testing.assert_allclose(half.hessian(x), larger.hessian(x))


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_normals_of_an_stl_file_are_those_of_the_sphere(tmp_path, form):
    p, t = sphere(2502)
    assert t.shape[1] == 5000
    file = tmp_path / "sphere.stl"
    meshio.Mesh(100 * p.T, [("triangle", t.T)]).write(file, binary=form == "binary")
    surface = read_surface(file)
    x = RNG.standard_normal((3, 4000))
    n = x / np.linalg.norm(x, axis=0)
    x = onto(surface, 100 * n)
    g = surface.gradient(x)
    cosine = (g * x).sum(axis=0) / np.linalg.norm(g, axis=0) / np.linalg.norm(x, axis=0)
    assert np.degrees(np.arccos(np.minimum(cosine, 1))).max() < 0.1  # asked: 1
    assert np.abs(np.linalg.norm(x, axis=0) - 100).max() < 2e-3


def test_normals_and_curvatures_of_triangles_are_continuous():
    surface = SURFACES["triangles"]
    way = np.linspace(0, 1, 4001)
    path = np.array([np.cos(way), np.sin(way), 0.3 + 0 * way])
    path = 5 * path / np.linalg.norm(path, axis=0)
    for values in (surface.gradient(path), surface.hessian(path)):
        steps = np.abs(np.diff(values, axis=-1)).max()
        coarse = np.abs(np.diff(values[..., ::2], axis=-1)).max()
        assert coarse == pytest.approx(2 * steps, rel=0.1)  # no jump


def test_bad_surfaces_are_refused(tmp_path):
    p, t = sphere(30)
    for build, message in (
        (lambda: drape.Sphere(-1.0), "radius must be a positive number"),
        (lambda: drape.Plane(normal=(0, 0, 0)), "normal must not be zero"),
        (lambda: drape.Cylinder(1.0, (0, 0)), "must be three finite numbers"),
        (lambda: drape.Cone(2.0), "between 0 and"),
        (lambda: drape.Torus(1.0, 2.0), "must be smaller"),
        (lambda: drape.double_dome(waist=1.0), "waist from 0 to less than 1"),
        (lambda: drape.TriangleMesh(p[:, :9], t[:, :0]), "triangles must be"),
        (lambda: drape.TriangleMesh(p, t + 1), "not there"),
        (lambda: drape.TriangleMesh(p * np.nan, t), "finite"),
        (lambda: drape.TriangleMesh(p, t[:, :2]), "too few"),
        (lambda: drape.TriangleMesh(p, np.c_[t, t[::-1]]), "orient them alike"),
    ):
        with pytest.raises(ValueError, match=message):
            build()
    with pytest.raises(MeshError, match="no such file"):
        read_surface(tmp_path / "none.stl")
    empty = tmp_path / "empty.stl"
    empty.write_text("nothing")
    with pytest.raises(MeshError, match=r"empty\.stl"):
        read_surface(empty)


@pytest.mark.parametrize(
    "surface",
    [
        drape.Plane((0, 0, 0.3), (1, 2, 5)),
        drape.Sphere(0.8, (0.1, 0, 0)),
        drape.Torus(0.6, 0.25),
    ],
)
def test_triangles_on_a_surface_cover_it(surface):
    """As closed surfaces without gaps, and on it."""
    x, t = drape.triangles_on(surface, np.full(3, -1.0), np.full(3, 1.0), 24)
    np.testing.assert_allclose(surface.level(x), 0.0, atol=1e-6)
    edges = np.sort(np.hstack([t[[0, 1]], t[[1, 2]], t[[2, 0]]]), axis=0)
    pairs, count = np.unique(edges, axis=1, return_counts=True)
    assert count.max() == 2
    outer = x[:, pairs[:, count == 1].ravel()]
    assert (np.abs(outer).max(axis=0) > 0.95).all()  # at the box alone


def test_a_surface_beside_the_box_has_no_triangles_there():
    sphere = drape.Sphere(1.0, (9, 9, 9))
    x, t = drape.triangles_on(sphere, np.full(3, -1.0), np.full(3, 1.0), 8)
    assert x.shape == (3, 0)
    assert t.shape == (3, 0)
