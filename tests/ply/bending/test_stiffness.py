"""Stiffness against bending: fibres at rest, elements, regions, what is refused."""

import numpy as np
import pytest
from skfem import MeshTri

from skfem_textile import BodyForce, Fabric, Full, Macro, OnePoint, Ply
from skfem_textile.ply.refinement import refine
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import distorted, wobble
from tests.helpers.bent_plies import D, every_formulation, square


@every_formulation
@pytest.mark.parametrize("dimension", [2, 3])
def test_fibres_that_are_curved_at_rest_do_not_bend_in_a_homogeneous_motion(
    formulation, dimension
):
    fabric = Fabric(
        50.0,
        0.5,
        warp=lambda x: np.stack([np.cos(0.4 * x[1]), np.sin(0.4 * x[1])]),
        weft=lambda x: np.stack([-np.sin(0.3 * x[0]), np.cos(0.3 * x[0])]),
        bending=(3.0, 1.0),
    )
    ply = Ply(distorted(1, jitter=0.2), fabric, formulation, dimension=dimension)
    H = np.random.default_rng(3).standard_normal((dimension, 2))
    u = (H @ ply.nodes).T.ravel()
    wave = ply.energies(wobble(ply, 2, 0.1))["bending"]
    assert ply.energies(u)["bending"] < 1e-12 * wave


def test_directions_that_turn_from_element_to_element_bend_alike():
    """Fibres along circles, as a field and as one direction in each element."""
    mesh = rectangle(10, 10, (16, 16), "irregular", 0.2, 1)

    def warp(x):
        return np.stack([20 + x[1], -x[0]])

    def weft(x):
        return np.stack([x[0], 20 + x[1]])

    centres = mesh.p[:, mesh.t].mean(axis=1)
    fields = Fabric(warp=warp, weft=weft, bending=(D, 0.0))
    arrays = Fabric(warp=warp(centres), weft=weft(centres), bending=(D, 0.0))
    plies = [Ply(mesh, fabric, Full(), dimension=3) for fabric in (fields, arrays)]
    x, y = mesh.p
    u = plies[0].basis.zeros()
    u[2::3] = 0.01 * x**2 + 0.02 * x * y - 0.01 * y**2
    first, second = (ply.energies(u)["bending"] for ply in plies)
    assert second == pytest.approx(first, rel=1e-12)
    A = warp(centres) / np.hypot(*warp(centres))
    curvature = 0.02 * A[0] ** 2 + 0.04 * A[0] * A[1] - 0.02 * A[1] ** 2
    area = plies[0].basis.dx.sum(axis=1)
    assert first == pytest.approx(0.5 * D * (area * curvature**2).sum(), rel=0.02)


def test_each_family_and_each_element_has_its_own_stiffness():
    """½ D κ² of a cylinder, to the area beside the ends of the fibres."""
    mesh = square(8, side=8.0).with_subdomains({"all": np.arange(64)})
    x, y = mesh.p
    for given, of_warp, of_weft in (
        ((2.0, 3.0), 2.0, 3.0),
        ((np.full(64, 2.0), 3.0), 2.0, 3.0),
        ((0.0, 3.0), 0.0, 3.0),
    ):
        fabric = Fabric(bending=given)
        for chosen in (fabric, {"all": fabric}):
            ply = Ply(mesh, chosen, Full(), dimension=3)
            for shape, stiffness in ((x**2, of_warp), (y**2, of_weft), (x * y, 0.0)):
                u = ply.basis.zeros()
                u[2::3] = 0.5 * 0.1 * shape
                energy = ply.energies(u)["bending"]
                assert energy == pytest.approx(64 * 0.5 * stiffness * 0.01, abs=1e-12)


def test_stiffness_that_differs_between_elements_bends_where_it_is():
    mesh = square(16, side=8.0)
    left = mesh.p[0, mesh.t].mean(axis=0) < 4
    ply = Ply(mesh, Fabric(bending=(np.where(left, 1.0, 5.0), 0.0)), Macro())
    u = ply.basis.zeros()
    u[1::2] = 0.05 * ply.nodes[0] ** 2
    assert ply.energies(u)["bending"] == pytest.approx(32 * 0.5 * 0.01 * 6, rel=0.02)


def test_bending_goes_with_finer_and_refined_plies_and_their_ends():
    mesh = MeshTri().refined(2).scaled(10.0).with_defaults()
    fabric = Fabric(bending=(np.linspace(1, 2, mesh.nelements), 3.0))
    ends = {"left": "clamped", "bottom": "mirror"}
    ply = Ply(mesh, fabric, Macro(), dimension=3, fibre_ends=ends)
    refined = refine(ply, [0, 1]).ply
    for other in (ply.with_terms(BodyForce((0, 0, 1.0))), ply.finer().ply, refined):
        assert other.fibre_ends == ends
        u = other.basis.zeros()
        u[2::3] = 0.05 * other.nodes[0] ** 2
        energy = other.energies(u)["bending"]
        assert energy == pytest.approx(100 * 0.5 * 1.5 * 0.01, rel=0.15)


def test_a_planar_ply_without_bending_has_no_term_of_it():
    ply = Ply(square(2), Fabric(), OnePoint())
    assert "bending" not in ply.energies(ply.basis.zeros())


@pytest.mark.parametrize(
    "wrong", [1.0, (1.0,), (1.0, -1.0), (np.nan, 1.0), (np.ones((2, 2)), 1.0)]
)
def test_bending_stiffnesses_that_are_none_are_refused(wrong):
    with pytest.raises(ValueError, match="bending"):
        Fabric(bending=wrong)


@pytest.mark.parametrize(
    ("ends", "reason"),
    [
        ({"nowhere": "clamped"}, "no boundary 'nowhere'"),
        ({"left": "glued"}, "must be clamped, mirror or a function.* not 'glued'"),
        ({"left": lambda t: (0.0, t, 0.0)}, "turn of 'left' must be an angle"),
        ({"left": "clamped", "same": "mirror"}, "overlaps"),
        ({"middle": "clamped"}, "inside the ply"),
        ("clamped", "must be a mapping"),
    ],
)
def test_fibre_ends_that_are_unknown_are_refused(ends, reason):
    mesh = square(2).with_defaults()
    inside = np.flatnonzero(mesh.f2t[1] >= 0)
    mesh = mesh.with_boundaries({"same": mesh.boundaries["left"], "middle": inside})
    with pytest.raises(ValueError, match=reason):
        Ply(mesh, Fabric(bending=(1.0, 1.0)), OnePoint(), fibre_ends=ends)


def test_values_of_bending_for_too_few_elements_are_refused():
    fabric = Fabric(bending=(np.ones(3), 1.0))
    with pytest.raises(ValueError, match="bending of warp: 3 values for 4 elements"):
        Ply(square(2), fabric)
