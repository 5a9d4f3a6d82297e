"""Forms on parts of a mesh, in composite elements, and with fields as parameters."""

import operator
import pickle

import numpy as np
import pytest
from skfem import (
    Basis,
    CellBasis,
    ElementQuad0,
    ElementQuad1,
    ElementQuadBFS,
    ElementTriCR,
    ElementTriDG,
    ElementTriHermite,
    ElementTriP1,
    ElementVector,
    MeshQuad,
    MeshTri,
    asm,
)

from skfem_textile import (
    CENTRE,
    GAUSS,
    Fabric,
    HourglassBasis,
    MacroBasis,
    MeanBasis,
    OnePoint,
    Ply,
    Sin2,
    hourglass,
    mean_tension,
    quad_basis,
    shear,
    split,
    tension,
)
from skfem_textile.mesh.bases import element_numbers
from tests.helpers import defined, distorted

C_S, ANGLES = 2.0, np.linspace(-0.4, 0.5, 6)
BY_ELEMENT = np.array([np.cos(ANGLES), np.sin(ANGLES)])
FABRICS = {
    "even": Fabric((1e4, 3.0), Sin2(0.7), warp=(2, 1), weft=(-1, 3)),
    "by element": Fabric(np.arange(1.0, 7.0), np.arange(2.0, 8.0), warp=BY_ELEMENT),
    "by position": Fabric(50.0, 0.5, warp=lambda x: np.stack([1 + x[1], x[0]])),
}
MESH = distorted(1).with_subdomains({"right": np.array([1, 3, 4])})
PARTS = ("energy", "residual", "tangent")
ELEMENTS = {
    "displacement": lambda v: v,
    "first of two": lambda v: v * ElementQuad1(),
    "last of three": lambda v: ElementQuad0() * ElementQuad1() * v,
}
CASES = [
    ("even", "displacement", 3),
    ("by position", "displacement", 2),
    ("by element", "first of two", 2),
    ("by position", "last of three", 3),
]


def terms(fabric, element, part=None):
    """The element of Hamila & Boisse by forms, on a part of the mesh."""
    bases = CellBasis(MESH, element, quadrature=CENTRE), HourglassBasis(MESH, element)
    if part is not None:
        bases = tuple(basis.with_elements(part) for basis in bases)
    forms = tension(fabric), shear(fabric), hourglass(fabric, C_S)
    return list(zip(forms, (bases[0], *bases), strict=True))


def total(terms, name, u):
    return sum(asm(getattr(forms, name), basis, u=u) for forms, basis in terms)


def block_of(basis):
    """Unknowns of the displacement."""
    if isinstance(basis.elem, ElementVector):
        return np.arange(basis.N)
    (vector,) = (
        i for i, x in enumerate(basis.elem.elems) if isinstance(x, ElementVector)
    )
    return basis.split_indices()[vector]


def assert_equal(found, expected):
    found, expected = (
        x.toarray() if hasattr(x, "toarray") else np.asarray(x)
        for x in (found, expected)
    )
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("fabric", "element", "dimension"), CASES)
def test_forms_equal_a_ply_and_are_zero_for_other_fields(fabric, element, dimension):
    vector, fabric = ElementVector(ElementQuad1(), dimension), FABRICS[fabric]
    by_forms = terms(fabric, ELEMENTS[element](vector))
    basis = by_forms[0][1]
    u = 0.05 * np.random.default_rng(1).standard_normal(basis.N)
    block = block_of(basis)
    ply = Ply(MESH, fabric, OnePoint(C_S), dimension=dimension)
    names = ("tension", "shear", "stabilisation")
    of_ply = [term for term in ply.terms if term.name in names]
    assert len(of_ply) == 3
    energy, f, K = (total(by_forms, part, u) for part in PARTS)
    assert energy == pytest.approx(ply.energy(u[block], terms=of_ply), rel=1e-12)
    expected = ply.residual(u[block], terms=of_ply)
    assert_equal(f[block], expected)
    others = np.setdiff1d(np.arange(basis.N), block)
    assert not f[others].any()
    matrices = (term.tangent(u[block], 1.0) for term in of_ply)
    assert_equal(K.toarray()[np.ix_(block, block)], sum(matrices))
    assert not K[others].count_nonzero()
    assert not K[:, others].count_nonzero()


@pytest.mark.parametrize(("fabric", "element", "dimension"), CASES)
def test_parts_of_a_mesh_add_up_to_the_whole(fabric, element, dimension):
    vector = ELEMENTS[element](ElementVector(ElementQuad1(), dimension))
    fabric = FABRICS[fabric]
    parts = [terms(fabric, vector, part) for part in ("right", np.array([0, 2, 5]))]
    whole = terms(fabric, vector)
    u = 0.05 * np.random.default_rng(2).standard_normal(whole[0][1].N)
    for name in PARTS:
        found = sum(total(part, name, u) for part in parts)
        assert_equal(found, total(whole, name, u))
    for (form, right), (_, left) in zip(*parts, strict=True):
        for x, definition in zip(form, defined(form), strict=True):
            both = asm(x, [right, left], u=u)  # a list of bases
            assert_equal(both, asm(x, right, u=u) + asm(x, left, u=u))
            if isinstance(right.elem, ElementVector):
                numbers = element_numbers(right)
                expected = asm(definition, right, u=u, element=numbers)
                assert_equal(asm(x, right, u=u), expected)


def test_element_matrices_are_read_changed_and_added_as_those_of_other_forms():
    basis, form = quad_basis(MESH, GAUSS), tension(FABRICS["even"])
    u = 0.05 * np.random.default_rng(12).standard_normal(basis.N)
    (own,) = asm(form.tangent, basis, u=u, to=list)
    (expected,) = asm(defined(form).tangent, basis, u=u, to=list)
    assert_equal(own.tolocal(), expected.tolocal())
    doubled = own.fromlocal(2 * own.tolocal())
    assert_equal(doubled.tocsr(), 2 * expected.tocsr())
    assert_equal((own + expected).tocsr(), 2 * form.tangent.assemble(basis, u=u))
    assert_equal(own.dot(u), expected.tocsr() @ u)


def test_parts_of_macro_elements_add_up_to_the_whole():
    mesh = split(MeshQuad().refined(1).with_subdomains({"some": [0, 3]}))
    fabric, whole = Fabric(1e3, warp=(2, 1)), MacroBasis(mesh)
    E_d = np.arange(1.0, 9.0).reshape(2, 4, 1)
    u = 0.01 * np.random.default_rng(3).standard_normal(whole.N)
    some = whole.with_elements("some")
    rest = whole.with_elements(np.setdiff1d(np.arange(16), mesh.subdomains["some"]))
    for form in mean_tension(fabric):
        parts = (
            asm(form, part, u=u, E_d=E_d[:, rows])
            for part, rows in ((some, [0, 3]), (rest, [1, 2]))
        )
        assert_equal(sum(parts), asm(form, whole, u=u, E_d=E_d))


def test_mean_tension_in_a_composite_element_equals_that_of_the_displacement():
    vector, fabric = ElementVector(ElementQuad1()), FABRICS["by element"]
    alone = MeanBasis(MESH, vector, quadrature=GAUSS)
    both = MeanBasis(MESH, vector * ElementQuad1(), quadrature=GAUSS)
    u = 0.05 * np.random.default_rng(4).standard_normal(both.N)
    block, w = block_of(both), {"E_d": np.ones((2, 6, 1))}
    energy, f, K = (asm(form, both, u=u, **w) for form in mean_tension(fabric))
    expected = [asm(form, alone, u=u[block], **w) for form in mean_tension(fabric)]
    found = energy, f[block], K.toarray()[np.ix_(block, block)]
    for x, y in zip(found, expected, strict=True):
        assert_equal(x, y)


def test_a_product_of_bases_and_interpolated_fields_are_composite_too():
    fabric, centre = FABRICS["even"], quad_basis(MESH, CENTRE)
    product = centre * CellBasis(MESH, ElementQuad1(), quadrature=CENTRE)
    u = 0.05 * np.random.default_rng(5).standard_normal(product.N)
    for form in tension(fabric):
        expected = asm(form, centre, u=u[: centre.N])
        for given in (u, product.interpolate(u), product.interpolate(u)[0]):
            found = asm(form, product, u=given)
            if np.ndim(found):
                found = found[: centre.N]
            if np.ndim(found) == 2:
                found = found[:, : centre.N]
            assert_equal(found, expected)


def test_quadrilaterals_and_triangles_with_common_nodes_are_assembled_from_a_list():
    """Two parts of one numbering of nodes equal the ply on each."""
    p = np.array([[0, 0, 2, 2, 1, 1], [0, 1, 0, 1, 0, 1.0]])
    quads = MeshQuad(p, np.array([[0, 4, 5, 1]]).T, validate=False)
    triangles = MeshTri(p, np.array([[4, 2, 5], [2, 3, 5]]).T, validate=False)
    bases = [
        CellBasis(quads, ElementVector(ElementQuad1()), intorder=3),
        CellBasis(triangles, ElementVector(ElementTriP1()), intorder=1),
    ]
    u = np.zeros(12)
    u[0::2] = 0.1 * p[0]
    energy, f, _ = (asm(x, bases, u=u) for x in tension(Fabric(1e4)))
    assert energy == pytest.approx(0.5e4 * np.log(1.1) ** 2 * 2.0)
    T = 1e4 * np.log(1.1) / 1.1
    assert f[[4, 6]].sum() == pytest.approx(T)


def assert_sum(both, one, other, basis, **parameters):
    for name in PARTS:
        parts = (asm(getattr(x, name), basis, **parameters) for x in (one, other))
        assert_equal(asm(getattr(both, name), basis, **parameters), sum(parts))


@pytest.mark.parametrize(
    ("rule", "part", "element", "dimension"),
    [(CENTRE, None, "displacement", 3), (GAUSS, "right", "first of two", 2)],
    ids=["one point", "part"],
)
def test_a_sum_of_forms_is_assembled_as_its_terms(rule, part, element, dimension):
    vector = ELEMENTS[element](ElementVector(ElementQuad1(), dimension))
    basis = CellBasis(MESH, vector, quadrature=rule).with_elements(part)
    u = 0.05 * np.random.default_rng(9).standard_normal(basis.N)
    for fabric in (FABRICS["even"], FABRICS["by element"]):
        one, other = tension(FABRICS["even"]), shear(fabric)
        assert_sum(one + other, one, other, basis, u=u)


def test_a_sum_of_forms_takes_the_parameters_of_its_terms():
    fabric, basis = FABRICS["even"], MacroBasis(split(MESH))
    one, other = mean_tension(fabric), shear(fabric)
    given = {
        "u": 0.05 * np.random.default_rng(10).standard_normal(basis.N),
        "E_d": np.arange(1.0, 13.0).reshape(2, 6, 1),
    }
    assert_sum(one + other, one, other, basis, **given)
    T = np.ones((2, *basis.dx.shape))
    assert_sum(one + other, one, other, basis, **given, tension=T)
    with pytest.raises(ValueError, match="E_d"):
        asm((one + other).energy, basis, u=given["u"])


def test_forms_of_ones_own_add_to_forms_and_nothing_else_does():
    basis, one = quad_basis(MESH, GAUSS), shear(FABRICS["even"])
    own = defined(one)
    u = 0.05 * np.random.default_rng(11).standard_normal(basis.N)
    for both in (own + one, one + own, pickle.loads(pickle.dumps(one + one))):
        assert both.kernel is None
        assert_sum(both, one, own, basis, u=u, element=element_numbers(basis))
    with pytest.raises(TypeError, match=r"\+"):
        operator.add(one, (own.energy,))


@pytest.mark.parametrize("dimension", [2, 3])
def test_directions_are_functions_or_fields_or_dof_vectors(dimension):
    """A bilinear field of directions, given in three ways."""
    plain, curved = Fabric(50.0, 0.5), FABRICS["by position"]
    basis = quad_basis(MESH, GAUSS, dimension)
    nodal = np.zeros((MESH.nvertices, dimension))
    nodal[:, :2] = curved.warp(MESH.p).T
    u = 0.05 * np.random.default_rng(7).standard_normal(basis.N)
    warp, x = nodal.ravel(), np.asarray(basis.global_coordinates())
    for given, expected in zip(
        (*tension(plain), *shear(plain)),
        (*tension(curved), *shear(curved)),
        strict=True,
    ):
        right = asm(expected, basis, u=u)
        for field in (warp, basis.interpolate(warp), curved.warp(x)):
            assert_equal(asm(given, basis, u=u, warp=field), right)
    corners = HourglassBasis(MESH, dimension)
    pair = hourglass(plain, C_S).tangent, hourglass(curved, C_S).tangent
    found, right = asm(pair[0], corners, u=u, warp=warp), asm(pair[1], corners, u=u)
    assert_equal(found, right)


@pytest.mark.parametrize(
    ("mesh", "element"),
    [
        (MeshTri().refined(1), ElementTriHermite()),
        (MeshTri(), ElementTriCR()),
        (MeshTri(), ElementTriDG(ElementTriP1())),
        (MESH, ElementQuadBFS()),
    ],
    ids=lambda x: type(x).__name__,
)
def test_elements_with_other_unknowns_than_values_at_nodes_are_right(mesh, element):
    basis = Basis(mesh, ElementVector(element), intorder=4)
    u = 0.01 * np.random.default_rng(0).standard_normal(basis.N)
    for forms in (tension(Fabric(1e3)), shear(Fabric(1e3, 0.3))):
        for form, readable in zip(forms, defined(forms), strict=True):
            expected = asm(readable, basis, u=basis.interpolate(u))
            assert_equal(asm(form, basis, u=u), expected)
