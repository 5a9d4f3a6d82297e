"""Macro-elements, and quadratic triangles with mean strain: energies, runs, locking."""

import numpy as np
import pytest
from skfem import Functional, asm
from skfem.helpers import grad

from skfem_textile import (
    Fabric,
    Linear,
    LoadStepper,
    Macro,
    MacroBasis,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
)
from skfem_textile.mesh.splitting import cut, split, split_cells
from skfem_textile.scenes import bias_extension, strip
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import (
    TRIANGLE_AND_QUAD,
    acting_tension,
    derivative,
    distorted,
    random_u,
)
from tests.helpers.intervals import without_interval

MESHES = {
    "triangles": split(cut(distorted(1))),
    "quads": split(distorted(1)),
    "both": split_cells(*TRIANGLE_AND_QUAD),
}
every_mesh = pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)


def tension(fabric, mesh):
    ply = Ply(mesh, fabric, Macro())
    ply._terms = tuple(term for term in ply.terms if term.name == "tension")
    return ply


def run(scene, formulation, E=1e4, shear=0.0, steps=2):
    ply = Ply(scene.mesh, Fabric(E, shear, scene.warp, scene.weft), formulation)
    result = LoadStepper(ply, scene.conditions, steps).run()
    return scene.summary(without_interval(result))


@every_mesh
def test_the_basis_has_the_elements_of_the_parts(mesh):
    basis, quads = MacroBasis(mesh), Ply(mesh, Fabric(), OnePoint(0.0))
    u = np.random.default_rng(1).standard_normal(basis.N)
    field, is_part = basis.interpolate(u), basis.parts >= 0
    of_parts = quads.gradient(u)[..., 0][:, :, basis.parts] * is_part
    np.testing.assert_allclose(np.asarray(field.grad), of_parts, atol=1e-12)
    nodal = u[quads.basis.nodal_dofs]
    centres = nodal[:, mesh.t].mean(axis=1)[:, basis.parts]
    np.testing.assert_allclose(np.asarray(field), centres * is_part)
    area = asm(Functional(lambda w: 1 + 0 * grad(w["u"])[0, 0]), basis, u=u)
    assert area == pytest.approx(quads.basis.dx.sum())
    x = np.arange(mesh.nelements)[None, :, None]
    np.testing.assert_array_equal(basis.to_ply_points(basis.from_ply_points(x)), x)


@every_mesh
def test_the_energy_is_the_sum_of_mean_and_deviation(mesh):
    ply = tension(Fabric((1e6, 100.0), 0.1, warp=(2, 1), weft=(-1, 3)), mesh)
    u, area = random_u(ply, 1), ply.basis.dx[:, 0]
    expected = 0.0
    for eps, E in zip(ply.fibre_strain(u)[..., 0], (1e6, 100.0), strict=True):
        stretch = np.exp(eps)
        for parent in range(mesh.parent.max() + 1):
            parts = mesh.parent == parent
            mean = np.average(stretch[parts], weights=area[parts])
            error = area[parts] @ (stretch[parts] - mean) ** 2
            resistance = {3: 370.0, 4: 700.0}[parts.sum()] * 0.1
            E_d = E * resistance / (E + resistance)
            of_mean = 0.5 * E * np.log(mean) ** 2 * area[parts].sum()
            expected += of_mean + 0.5 * E_d * error
    # The tension at rest is not zero to round-off.
    assert ply.energy(u) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(
    ("mesh", "formulation"),
    [
        *((mesh, Macro(deviation=(0.0, 0.0))) for mesh in MESHES.values()),
        (cut(distorted(1)), Quadratic(deviation=0.0)),
    ],
    ids=[*MESHES, "quadratic"],
)
def test_the_mean_strain_enters_the_law(mesh, formulation):
    """Without stiffness of deviations the tension that acts is λ T(ln λ̄)/λ̄."""
    ply = Ply(mesh, Fabric((1e6, 100.0), 0.1, warp=(2, 1), weft=(-1, 3)), formulation)
    u = random_u(ply, 1)
    of_law, local, tension = (
        ply.law_strain(u),
        ply.fibre_strain(u),
        ply.fibre_tension(u),
    )
    E = np.array([1e6, 100.0])[:, None, None]
    np.testing.assert_allclose(tension, E * of_law, rtol=1e-12)
    acting = np.exp(local - of_law) * tension
    np.testing.assert_allclose(acting_tension(ply, u), acting, rtol=1e-9)
    assert np.abs(of_law).max() < 0.9 * np.abs(local).max()


@every_mesh
def test_the_tensions_that_act_do_the_work_of_the_forces(mesh):
    """The predicted tensions are their first-order approximation."""
    ply = tension(Fabric((1e3, 400.0), 0.02), mesh)
    u, du = random_u(ply, 1), random_u(ply, 2, 1.0)
    rates = derivative(ply.fibre_strain, u, du)
    work = (acting_tension(ply, u) * rates).sum(axis=0) * ply.basis.dx
    assert work.sum() == pytest.approx(ply.residual(u) @ du)
    np.testing.assert_allclose(
        derivative(lambda x: ply.predicted_tension(u, x), 0 * u, du),
        derivative(lambda x: acting_tension(ply, x), u, du),
        atol=1e-5,
    )


def test_both_stiffnesses_may_be_chosen():
    mesh, fabric = MESHES["quads"], Fabric((1e3, 1e6), 0.5)
    chosen, auto = (Ply(mesh, fabric, f) for f in (Macro(2.0, (1.0, 700.0)), Macro()))
    u = random_u(chosen, 1)
    assert chosen.energies(u) == pytest.approx(auto.energies(u), rel=1e-12)
    softer = Ply(mesh, fabric, Macro(0.0, (100.0, 100.0)))
    assert softer.energies(u)["tension"] < auto.energies(u)["tension"]
    assert "stabilisation" not in softer.energies(u)


def test_titles_contain_the_chosen_stiffnesses():
    chosen = (Macro(), Macro(4.0), Macro(deviation=(1.0, 2.0)))
    chosen += (Quadratic(), Quadratic(0.0), OnePoint(), OnePoint(1.0, "rate"))
    assert len({formulation.title for formulation in chosen}) == len(chosen)
    assert Macro(4.0).title == "macro-elements, C_s = 4 N/mm"
    assert OnePoint(0.01).title == "one point, C_s = 0.01 N/mm"


@pytest.mark.parametrize("formulation", [Macro(), Quadratic(80.0)])
def test_a_rotated_problem_is_the_same(formulation):
    mesh = rectangle(50, 100, (2, 4), "delaunay", 0.25)
    if isinstance(formulation, Macro):
        mesh = split(mesh)
    scene = bias_extension(mesh)
    turned = scene.rotated(0.7)
    plain, rotated = (run(s, formulation, 1e4, 0.5, 4) for s in (scene, turned))
    assert rotated["energy"] == pytest.approx(plain["energy"], rel=1e-9)
    assert rotated["reaction_y"] == pytest.approx(plain["reaction_y"], rel=1e-6)


def test_quadratic_triangles_of_mean_strain_do_not_lock_at_kinks():
    mesh, read = rectangle(50, 100, (8, 16), "delaunay", 0.25), []
    for formulation in (Quadratic(), Quadratic(80.0)):
        read.append(run(bias_extension(mesh), formulation, 1e6, 0.5)["load_over_exact"])
    assert read[0] > 50
    assert read[1] == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("curved", [False, True])
def test_soft_fibres_agree_with_one_point_elements(curved):
    """With E_d the fibre stiffness, to 1e-8, a macro-element is the sum of its parts.

    Directions may differ from part to part.  Energies of small strains differ by a
    fraction proportional to them.
    """
    mesh = split(distorted(4))
    angle = np.linspace(0.1, 0.4, mesh.nelements) if curved else np.zeros(24)
    fabric = Fabric(1e-6, 0.5, np.array([np.cos(angle), np.sin(angle)]), (-1, 2))
    macro, plain = (Ply(mesh, fabric, made) for made in (Macro(), OnePoint()))
    u = random_u(macro, 1)
    shares = [
        macro.energies(k * u)["tension"] / plain.energies(k * u)["tension"] - 1
        for k in (1e-2, 1e-3)
    ]
    assert abs(shares[0]) < 0.01
    assert shares[1] == pytest.approx(0.1 * shares[0], rel=0.1)


@pytest.mark.parametrize(
    ("E", "law"),
    [
        (1e6, Sin2(0.5)),
        pytest.param(1e4, Sin2(0.5), marks=pytest.mark.slow),
        pytest.param(1e5, Linear(0.5), marks=pytest.mark.slow),
    ],
)
def test_the_load_of_a_bias_extension_is_accurate_for_any_fibre_stiffness(E, law):
    mesh = split(rectangle(50, 100, (8, 16), jitter=0.25))
    summary = run(bias_extension(mesh), Macro(), E, law)
    assert summary["stable"]
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=0.05)


def test_macro_elements_of_triangles_do_not_lock():
    """Within 12 %: one point in each part alone overestimates the load by half."""
    mesh = split(cut(rectangle(50, 100, (4, 8), jitter=0.25, seed=2)))
    load = run(bias_extension(mesh), Macro(), 1e6, 0.5)["load_over_exact"]
    assert load == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("E", [1e6, pytest.param(1e4, marks=pytest.mark.slow)])
def test_the_shape_of_a_strip_converges(E):
    """Position errors decrease more than threefold as the element size halves."""
    errors = []
    for size in ((5, 8), (10, 15)):
        summary = run(strip(split(rectangle(40, 60, size))), Macro(), E)
        assert summary["stable"]
        errors.append(summary["displacement_error_rms"])
    assert abs(summary["reaction_x"]) < 1e-4 * E
    assert errors[1] < errors[0] / 3 < 0.01
