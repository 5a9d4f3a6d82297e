"""Fields of fibres on bases of any scikit-fem script."""

import numpy as np
import pytest
from skfem import (
    Basis,
    ElementHex1,
    ElementQuad0,
    ElementQuad1,
    ElementTriMorley,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    FacetBasis,
    MeshHex,
    MeshQuad,
    MeshTri,
    asm,
)

from skfem_textile import (
    CENTRE,
    GAUSS,
    Fabric,
    Full,
    HourglassBasis,
    Macro,
    MacroBasis,
    OnePoint,
    Ply,
    Tabulated,
    fibre_fields,
    quad_basis,
    split,
    tension,
)
from skfem_textile.fabric import kinematics as kin
from skfem_textile.forms.fields import on_basis
from tests.helpers import refused

RNG = np.random.default_rng(3)


def distorted(mesh):
    """The mesh with its inner vertices moved by up to an eighth of an edge."""
    p, inside = mesh.p.copy(), mesh.interior_nodes()
    p[:, inside] += RNG.uniform(-0.125, 0.125, (2, inside.size)) * mesh.param()
    return type(mesh)(p, mesh.t)


SQUARE = distorted(MeshQuad().refined(3)).with_subdomains(
    {"right": lambda x: x[0] > 0.5}
)
TRIANGLES = distorted(MeshTri().refined(2))
RIGHT = SQUARE.subdomains["right"]
WARP = RNG.standard_normal((2, SQUARE.nelements))
STIFFNESS = RNG.uniform(1e3, 2e3, SQUARE.nelements)

#: Directions and stiffnesses by element.
FABRIC = Fabric(STIFFNESS, 0.5, WARP, kin.rotated(WARP))

#: Names of fields, and the methods of a ply.
METHODS = {
    "strain": "law_strain",
    "tension": "fibre_tension",
    "shear_angle": "shear_angle",
    "direction": "fibre_direction",
}


def moved(basis, size=0.01):
    """A random displacement."""
    return size * np.random.default_rng(basis.N).standard_normal(basis.N)


def assert_equal(fields, ply, u, elements=slice(None)):
    """Fields at the points of the ply, in some of its elements."""
    expected = {name: getattr(ply, by)(u) for name, by in METHODS.items()}
    shape = 2, *ply.basis.dx.shape
    expected["reference"] = [np.broadcast_to(A, shape) for A in ply.directions()]
    for name, x in expected.items():
        of_elements = np.asarray(x)[..., elements, :]
        np.testing.assert_allclose(getattr(fields, name), of_elements, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("formulation", [Full(), OnePoint(1.0)], ids=["full", "one"])
def test_fields_are_those_of_a_ply_on_whole_part_and_composite_bases(
    dimension, formulation
):
    ply = Ply(SQUARE, FABRIC, formulation, dimension=dimension)
    whole, u = ply.basis, moved(ply.basis)
    assert_equal(fibre_fields(whole, u, FABRIC), ply, u)
    part = whole.with_elements("right")
    assert_equal(fibre_fields(part, u, FABRIC), ply, u, RIGHT)
    element = ElementVector(ElementQuad1(), dimension) * ElementQuad1()
    for basis, elements in (
        (whole.with_element(element), slice(None)),
        (part.with_element(element), RIGHT),
    ):
        both = moved(basis)
        displacement, _ = basis.split_indices()
        both[displacement] = u
        assert_equal(fibre_fields(basis, both, FABRIC), ply, u, elements)
    product = Basis(SQUARE, ElementQuad1(), quadrature=whole.quadrature) * whole
    both = np.concatenate([np.ones(SQUARE.nvertices), u])
    assert_equal(fibre_fields(product, both, FABRIC), ply, u)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    ("mesh", "element"),
    [
        (SQUARE, ElementQuad1()),
        (TRIANGLES, ElementTriP1()),
        (TRIANGLES, ElementTriP2()),
    ],
)
def test_fields_are_functions_of_the_gradient_that_scikit_fem_interpolates(
    mesh, element, dimension
):
    fabric = Fabric((1e3, 5e2), warp=lambda x: np.array([1 + x[1], x[0]]), weft=(-1, 3))
    whole = Basis(mesh, ElementVector(element, dimension), intorder=4)
    for basis in (whole, whole.with_elements(np.arange(3, 9))):
        u = moved(basis)
        fields = fibre_fields(basis, u, fabric)
        F = kin.deformation_gradient(np.asarray(basis.interpolate(u).grad))
        A = fabric.directions(np.asarray(basis.global_coordinates()))
        stretched = [kin.fibre(F, a) for a in A]
        lengths = np.array([np.linalg.norm(a, axis=0) for a in stretched])
        close = {"atol": 1e-12, "rtol": 1e-12}
        np.testing.assert_allclose(fields.strain, np.log(lengths), **close)
        E = np.array([1e3, 5e2])[:, None, None]
        np.testing.assert_allclose(fields.tension, E * np.log(lengths), atol=1e-9)
        angle = kin.shear_angle(F, *A)
        np.testing.assert_allclose(fields.shear_angle, angle, **close)
        expected = np.array(stretched) / lengths[:, None]
        np.testing.assert_allclose(fields.direction, expected, **close)


@pytest.mark.parametrize("mesh", [SQUARE, TRIANGLES], ids=["quad", "tri"])
def test_on_a_macro_basis_the_strain_is_that_of_the_mean_stretch(mesh):
    fabric = Fabric(Tabulated((0.0, 1.0), (0.0, 1e3), odd=True), 0.5, (1, 1), (-1, 1))
    ply = Ply(mesh, fabric, Macro())
    u = moved(ply.basis, 1e-3)
    fields = fibre_fields(MacroBasis(ply.mesh), u, fabric)
    assert_equal(fields, ply, u)
    assert np.abs(fields.strain - ply.fibre_strain(u)).max() > 1e-4


def test_values_by_users_elements_are_those_of_the_parts_of_a_split_mesh():
    mesh = split(SQUARE)
    basis = quad_basis(mesh, CENTRE)
    fields = fibre_fields(basis.with_elements([3, 200]), basis.zeros(), FABRIC)
    parents = mesh.parent[[3, 200]]
    expected = WARP[:, parents] / np.linalg.norm(WARP[:, parents], axis=0)
    np.testing.assert_allclose(fields.reference[0, ..., 0], expected)


def test_values_of_elements_are_area_weighted_means():
    mesh = MeshQuad(np.array([[0, 3, 2, 0], [0, 0, 2, 1.0]]), [[0], [1], [2], [3]])
    basis, fabric = quad_basis(mesh, GAUSS), Fabric(1e3)
    u = moved(basis)
    at_points, of_elements = (
        fibre_fields(basis, u, fabric, at) for at in ("points", "elements")
    )
    for name in ("strain", "tension", "shear_angle"):
        mean = np.average(getattr(at_points, name), axis=-1, weights=basis.dx[0])
        np.testing.assert_allclose(getattr(of_elements, name), mean, atol=1e-15)
    assert of_elements.direction.shape == (2, 2, 1)
    np.testing.assert_allclose(np.linalg.norm(of_elements.direction, axis=1), 1)


@pytest.mark.parametrize("rule", [CENTRE, GAUSS], ids=["one point", "2x2"])
def test_nodes_keep_integrals_and_uniform_fields(rule):
    """The lumped projection; Σ m_i x_i = ∫ x."""
    basis, fabric = quad_basis(SQUARE, rule), Fabric(1e3, warp=(1, 1), weft=(-1, 1))
    stretched = 0.02 * SQUARE.p.T.ravel()
    uniform = fibre_fields(basis, stretched, fabric, at="nodes")
    np.testing.assert_allclose(uniform.strain, np.log(1.02))
    u = moved(basis)
    nodal = fibre_fields(basis, u, fabric, at="nodes")
    points = fibre_fields(basis, u, fabric)
    area = np.zeros(SQUARE.nvertices)
    hats = Basis(SQUARE, ElementQuad1(), quadrature=rule)
    np.add.at(area, hats.element_dofs, [(N[0] * hats.dx).sum(1) for N in hats.basis])
    for x, at in ((nodal.strain, points.strain), (nodal.shear_angle, points[2])):
        np.testing.assert_allclose(x @ area, (at * basis.dx).sum(axis=(-2, -1)))
        assert at.min() <= x.min() <= x.max() <= at.max()


@pytest.mark.parametrize("second", [ElementQuad1(), ElementQuad0()])
def test_the_first_vector_field_is_the_displacement_of_fields_and_forms(second):
    both = Basis(SQUARE, VECTOR * ElementVector(second), intorder=2)
    alone, u = Basis(SQUARE, VECTOR, intorder=2), moved(both)
    first = u[both.split_indices()[0]]
    found, expected = fibre_fields(both, u, FABRIC), fibre_fields(alone, first, FABRIC)
    for x, y in zip(found, expected, strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-14)
    energy = tension(FABRIC).energy
    assert asm(energy, both, u=u) == pytest.approx(asm(energy, alone, u=first))


def test_vertices_without_elements_of_the_basis_have_no_value():
    basis = quad_basis(SQUARE, CENTRE)
    part = basis.with_elements("right")
    of_part = fibre_fields(part, basis.zeros(), FABRIC, at="nodes")
    inside = np.unique(SQUARE.t[:, RIGHT])
    finite = np.isfinite(of_part.strain[0])
    np.testing.assert_array_equal(np.flatnonzero(finite), inside)


PLAIN = quad_basis(SQUARE, CENTRE)
U = PLAIN.zeros()
FIVE, NONE = np.ones((2, 5)), np.empty(0, dtype=int)
ACROSS, FIVE_ROWS = kin.rotated(FIVE), PLAIN.with_elements(np.arange(9, 14))
VECTOR = ElementVector(ElementQuad1())
TWO_FIELDS = VECTOR * ElementQuad1()
CONSTANT = Basis(SQUARE, ElementVector(ElementQuad0()))
HEX = Basis(MeshHex(), ElementVector(ElementHex1()))
MORLEY = Basis(MeshTri(), ElementVector(ElementTriMorley()))

MISUSES = [
    ((SQUARE, U, FABRIC), "basis must be a scikit-fem basis .* not a MeshQ"),
    ((U, PLAIN, FABRIC), "basis must be a .* pass .basis, u, fabric"),
    ((PLAIN, U, 1e4), "fabric must be a Fabric .* not a float"),
    ((Basis(SQUARE, ElementQuad1()), U, FABRIC), "has no vector field,"),
    (
        (FacetBasis(SQUARE, TWO_FIELDS), U, FABRIC),
        "must be of elements, .* not a FacetBas",
    ),
    ((HourglassBasis(SQUARE), U, FABRIC), "not an HourglassBasis"),
    (
        (HEX, np.zeros(24), FABRIC),
        "quadrilaterals or triangles in the plane, not MeshHex",
    ),
    ((MORLEY, np.zeros(MORLEY.N), FABRIC), "not ElementTriMorley"),
    ((CONSTANT, U, FABRIC), "ElementQuad0 has no gradient"),
    ((PLAIN.with_elements(NONE), U, FABRIC), "the basis has no elements"),
    ((PLAIN, U[1:], FABRIC), r"u must .* shape \(basis.N,\), got shape"),
    ((PLAIN, U + np.nan, FABRIC), "u must .* finite numbers"),
    ((PLAIN, "u", FABRIC), "u must be real-valued, got 'u'"),
    ((PLAIN, U, Fabric(warp=FIVE, weft=ACROSS)), "warp: 5 vectors for 64 elements"),
    ((FIVE_ROWS, U, Fabric(np.ones(5))), "tension of warp: 5 values for 64"),
    ((PLAIN, U, FABRIC, "element"), "at must be one of points, elements"),
]


@pytest.mark.parametrize(("arguments", "message"), MISUSES)
def test_wrong_arguments_are_named_in_one_line(arguments, message):
    refused(lambda: fibre_fields(*arguments), message)


def test_the_area_ratio_of_a_part_is_the_smallest_at_points_and_corners():
    ply = Ply(SQUARE, FABRIC, Full())
    u = moved(ply.basis)
    sheet, u = on_basis(ply.basis.with_elements("right"), u, FABRIC)
    np.testing.assert_allclose(
        sheet.least_area_ratio(u), ply.least_area_ratio(u)[RIGHT]
    )
