"""A form on the wrong basis, or with wrong parameters, is refused in one line."""

import numpy as np
import pytest
from skfem import (
    Basis,
    ElementHex1,
    ElementQuad0,
    ElementQuad1,
    ElementQuad2,
    ElementQuadRT0,
    ElementTriP1,
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
    HourglassBasis,
    JumpBasis,
    MeanBasis,
    forms,
    quad_basis,
    split,
    triangle_basis,
)
from skfem_textile.mesh.bases import MacroBasis

FABRIC, MESH = Fabric(1e3, shear=0.1), MeshQuad().refined(2)
N, VECTOR = MESH.nelements, ElementVector(ElementQuad1())
PLAIN, SCALAR = quad_basis(MESH, CENTRE), Basis(MESH, ElementQuad1())
IN_SPACE = quad_basis(MESH, CENTRE, 3)
HOURGLASS, JUMPS = HourglassBasis(MESH), JumpBasis(MESH)
MEANS = MeanBasis(MESH, VECTOR)
EDGES = FacetBasis(MESH, VECTOR)
TWO_POINTS = quad_basis(MESH, (np.full((2, 2), 0.5), np.full(2, 0.5)))
BIQUADRATIC = HourglassBasis(MESH, ElementVector(ElementQuad2()))
CONSTANT = Basis(MESH, ElementVector(ElementQuad0()))
WITHOUT_VECTOR = Basis(MESH, ElementQuad1() * ElementQuad1())
FLUX = Basis(MESH, ElementQuadRT0())
FOUR = Basis(MESH, ElementVector(ElementQuad1(), 4))
SOLID = Basis(MeshHex(), ElementVector(ElementHex1()))
PART = PLAIN.with_elements(np.arange(3))
C_S, E_D = {"C_s": np.ones((N, 1))}, {"E_d": np.ones((2, N, 1))}
MOMENT = {"moment": np.zeros((N, 1)), "last": PLAIN.zeros()}
U = PLAIN.zeros()
ON_PART = PART.interpolate(U)
FLAT_IN_SPACE = IN_SPACE.interpolate(IN_SPACE.zeros())
OF_GAUSS = quad_basis(MESH, GAUSS).interpolate(U)
ONE_INFINITE = np.where(np.arange(PLAIN.N) == 3, np.inf, 0.0)
NOT_FINITE = PLAIN.interpolate(U + np.nan)
SHORT = MOMENT | {"last": U[1:]}
TOO_MANY = np.ones((2, N + 4))

OF_FABRIC, WITH_NUMBER = (FABRIC,), (FABRIC, 1.0)
MISUSES = [
    # form, its arguments, a basis, parameters, message
    # the basis
    ("tension", OF_FABRIC, HOURGLASS, {}, "quad_basis.* not an HourglassBasis"),
    ("hourglass", WITH_NUMBER, PLAIN, {}, r"requires a basis HourglassBasis\(mesh\)"),
    ("isotropic_hourglass", (1.0,), PLAIN, {}, r"requires a basis HourglassBasis"),
    ("out_of_plane", (), IN_SPACE, C_S, "basis HourglassBasis"),
    ("mean_tension", OF_FABRIC, PLAIN, E_D, "requires a MeanBasis or a MacroBasis"),
    (
        "tension",
        OF_FABRIC,
        EDGES,
        {},
        "must be of elements, such as .*, not a FacetBasis",
    ),
    ("shear_continuity", WITH_NUMBER, TWO_POINTS, {}, "JumpBasis.mesh., not a Displ"),
    # the element and its order
    ("tension", OF_FABRIC, SCALAR, {}, "displacement with two or three components"),
    ("tension", OF_FABRIC, WITHOUT_VECTOR, {}, "with two or three components"),
    ("hourglass", WITH_NUMBER, BIQUADRATIC, {}, r"ElementVector\(ElementQuad1\(\)\)"),
    ("tension", OF_FABRIC, FLUX, {}, "displacement with two or three components"),
    ("shear", OF_FABRIC, FOUR, {}, "displacement with two or three components"),
    ("tension", OF_FABRIC, SOLID, {}, "in the plane, not MeshHex1"),
    ("tension", OF_FABRIC, CONSTANT, {}, "ElementQuad0 has no gradient"),
    # missing parameters
    ("shear_continuity", WITH_NUMBER, JUMPS, {"u": None}, "parameter 'u'"),
    ("mean_tension", OF_FABRIC, MEANS, {}, "requires the parameter 'E_d'"),
    ("hourglass", OF_FABRIC, HOURGLASS, {}, "requires the parameter 'C_s'"),
    ("hourglass_rate", WITH_NUMBER, HOURGLASS, {}, "parameter '(last|moment)'"),
    # shapes and values
    ("tension", OF_FABRIC, PLAIN, {"u": U[:-2]}, "u must have 50 real numbers"),
    ("tension", OF_FABRIC, PLAIN, {"u": U.reshape(-1, 2)}, r"not shape \(25, 2\)"),
    ("tension", OF_FABRIC, PLAIN, {"u": tuple(U)}, "u must be a DOF vector.* tuple"),
    ("shear", OF_FABRIC, PLAIN, {"u": ONE_INFINITE}, "u must be finite: 1 of its 50"),
    ("tension", OF_FABRIC, PLAIN, {"u": NOT_FINITE}, "u must be finite: 64 of its 64"),
    ("shear", OF_FABRIC, PLAIN, {"u": U + 0j}, "u must have 50 real.*complex"),
    ("tension", OF_FABRIC, PLAIN, {"u": ON_PART}, "u has the shape .* 16 elements"),
    ("tension", OF_FABRIC, PLAIN, {"u": FLAT_IN_SPACE}, "u has 3 components, but .* 2"),
    ("hourglass", WITH_NUMBER, HOURGLASS, {"u": OF_GAUSS}, "and u on this basis"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": np.ones(N)}, r"C_s must have .*\(16,"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": np.ones((3, 1))}, "C_s has the shape"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": -1.0}, "C_s must be >= 0"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": np.nan}, "C_s must be finite: 1 of"),
    ("mean_tension", OF_FABRIC, MEANS, {"E_d": 1.0}, r"E_d must have .*\(2, n_el"),
    ("hourglass_rate", WITH_NUMBER, HOURGLASS, SHORT, "last must have 50 real"),
    ("tension", OF_FABRIC, PLAIN, {"tension": np.ones((N, 1))}, "tension must have"),
    # the fabric
    ("tension", (1e4,), PLAIN, {}, r"tension requires a Fabric such as .*not 10000"),
    ("hourglass", (FABRIC, -1.0), HOURGLASS, {}, "C_s must be a number >= 0, not -1"),
    ("hourglass", (FABRIC, "auto"), HOURGLASS, {}, "C_s must be a number >= 0"),
    ("isotropic_hourglass", (np.ones(3),), HOURGLASS, {}, "stiffness must be a number"),
    ("shear_continuity", (FABRIC, None), JUMPS, {}, "C_j must be a number"),
    ("tension", (Fabric(0.0, 1.0),), PLAIN, {}, "no tension stiffness"),
    ("shear", (Fabric(1.0, np.ones(5)),), PART, {}, "shear: 5 values for 16 elements"),
    ("tension", (Fabric(1.0, warp=TOO_MANY),), PLAIN, {}, "warp: 20 vectors for 16"),
    # directions as parameters
    ("tension", OF_FABRIC, PLAIN, {"warp": np.ones(7)}, r"or a DOF vector.*\(7,\)"),
    ("shear", OF_FABRIC, PLAIN, {"weft": np.ones((2, 3, 1))}, "weft has the shape"),
    ("shear", OF_FABRIC, IN_SPACE, {"warp": IN_SPACE.zeros() + 1}, "warp must lie in"),
    ("tension", OF_FABRIC, PLAIN, {"warp": U}, "warp must be a non-zero"),
    ("tension", OF_FABRIC, PLAIN, {"weft": U + [1, 0] * 25}, "parallel"),
]


@pytest.mark.parametrize(("name", "arguments", "basis", "parameters", "text"), MISUSES)
@pytest.mark.parametrize("form", ["residual", "tangent", "energy"])
def test_one_line_names_the_basis_or_the_parameter(
    form, name, arguments, basis, parameters, text
):
    if "tension" in parameters and form != "tangent":
        pytest.skip("only the tangent has this parameter")
    u = 0.01 * np.random.default_rng(1).standard_normal(basis.N)
    given = {"u": u, **parameters}
    if given["u"] is None:
        del given["u"]
    with pytest.raises(ValueError, match=text) as error:
        asm(getattr(getattr(forms, name)(*arguments), form), basis, **given)
    assert "\n" not in str(error.value)


def test_asm_of_all_forms_of_a_term_asks_for_one():
    with pytest.raises(ValueError, match=r"asm assembles one form: pass forms.energy"):
        asm(forms.tension(FABRIC), PLAIN, u=U)


@pytest.mark.parametrize("part", ["residual", "tangent", "energy"])
def test_a_displacement_in_place_of_a_basis_is_refused(part):
    form = getattr(forms.tension(FABRIC), part)
    for arguments in ((PLAIN, U), (U,)):
        with pytest.raises(ValueError, match=r"u=u\): got an ndarray in place of a ba"):
            asm(form, *arguments)
    for basis, kind in ((None, "a NoneType"), (MESH, "a MeshQuad1")):
        with pytest.raises(ValueError, match=f"got {kind} in place of a basis"):
            asm(form, basis, u=U)


def test_a_tangent_on_two_bases_needs_the_same_unknowns_and_elements():
    tangent = forms.tension(FABRIC).tangent
    again = quad_basis(MESH, CENTRE)
    difference = asm(tangent, PLAIN, again, u=U) - asm(tangent, PLAIN, u=U)
    assert abs(difference).max() < 1e-9
    with pytest.raises(ValueError, match="got 50 and 75 unknowns, 16 and 16 elem"):
        asm(tangent, PLAIN, IN_SPACE, u=U)
    with pytest.raises(ValueError, match="50 and 50 unknowns, 3 and 16 elements"):
        asm(tangent, PART, PLAIN, u=U)


def test_forms_on_bases_of_different_classes_do_not_add():
    with pytest.raises(ValueError, match="assembled before they are added"):
        forms.tension(FABRIC) + forms.shear_continuity(FABRIC, 1.0)


def test_a_function_that_returns_forms_is_not_a_form():
    with pytest.raises(TypeError, match=r"^tension\(fabric\): too many.* for asm$"):
        asm(forms.tension, PLAIN, u=U)


def test_a_mesh_with_positions_that_are_not_finite_is_refused():
    p = MESH.p.copy()
    p[0, 3] = np.nan
    broken = quad_basis(MeshQuad(p, MESH.t), CENTRE)
    for form in forms.shear(FABRIC):
        with pytest.raises(ValueError, match="positions that are not finite"):
            asm(form, broken, u=U)


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (HourglassBasis, "HourglassBasis requires a mesh of quadri.*, not a MeshTri1"),
        (JumpBasis, "JumpBasis requires a mesh of quadrilaterals, not a MeshTri1"),
        (MacroBasis, r"MacroBasis\(split\(mesh\)\), not a MeshTri1"),
        (lambda mesh: MacroBasis(MESH), r"requires a split mesh.*, not a MeshQuad1"),
        (
            lambda mesh: quad_basis(mesh, CENTRE),
            "quad_basis requires .* a MeshTri1",
        ),
        (lambda mesh: quad_basis(PLAIN, CENTRE), "quadrilaterals, not a Displ"),
        (lambda mesh: triangle_basis(MESH), "triangle_basis .*triangles, not a MeshQ"),
    ],
)
def test_a_basis_names_the_mesh_that_it_requires(build, text):
    with pytest.raises(ValueError, match=text):
        build(MeshTri())


@pytest.mark.parametrize(
    ("name", "arguments", "basis"),
    [("tension", OF_FABRIC, IN_SPACE), ("hourglass", WITH_NUMBER, HOURGLASS)],
)
def test_a_basis_without_elements_contributes_nothing(name, arguments, basis):
    empty, u = basis.with_elements(np.empty(0, int)), np.ones(basis.N)
    energy, f, K = (asm(x, empty, u=u) for x in getattr(forms, name)(*arguments))
    assert energy == 0
    assert f.shape == (basis.N,)
    assert not f.any()
    assert K.shape == (basis.N, basis.N)
    assert not K.nnz


@pytest.mark.parametrize("part", ["residual", "tangent", "energy"])
def test_bases_of_other_points_are_refused(part):
    with pytest.raises(ValueError, match="2×2 points: omit the quadrature"):
        HourglassBasis(MESH, VECTOR, quadrature=CENTRE)
    triangles = Basis(MeshTri(), ElementVector(ElementTriP1()))
    form = getattr(forms.hourglass(FABRIC, 1.0), part)
    with pytest.raises(ValueError, match=r"requires a basis HourglassBasis"):
        asm(form, triangles, u=triangles.zeros())
    macro = MacroBasis(split(MESH))
    form = getattr(forms.mean_tension(FABRIC), part)
    with pytest.raises(ValueError, match=r"E_d has the shape \(2, 64, 1\).* 16 elem"):
        asm(form, macro, u=macro.zeros(), E_d=np.ones((2, 64, 1)))


@pytest.mark.parametrize("swapped", [False, True])
def test_a_second_field_with_macro_elements_is_refused_with_the_way_out(swapped):
    line = "MacroBasis has the displacement alone: for a second field use a basis such"
    macro = MacroBasis(split(MESH))
    other = Basis(macro.mesh, ElementQuad1(), quadrature=CENTRE)
    product = other * macro if swapped else macro * other
    for form in forms.mean_tension(FABRIC):
        with pytest.raises(ValueError, match=line):
            asm(form, product, u=np.zeros(product.N), E_d=np.ones((2, N, 1)))
    with pytest.raises(ValueError, match=f"not an element: a {line}"):
        macro.with_element(VECTOR * ElementQuad1())
