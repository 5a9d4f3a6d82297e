"""A form on the wrong basis, or with wrong parameters, is refused in one line."""

import numpy as np
import pytest
from skfem import (
    Basis,
    ElementHex1,
    ElementLineP1,
    ElementQuad0,
    ElementQuad1,
    ElementQuadRT0,
    ElementTriP1,
    ElementVector,
    FacetBasis,
    MeshHex,
    MeshLine,
    MeshQuad,
    MeshTri,
    asm,
)

from skfem_textile import (
    CENTRE,
    Fabric,
    HourglassBasis,
    JumpBasis,
    Linear,
    MeanBasis,
    forms,
    quad_basis,
    split,
)
from skfem_textile.mesh.bases import MacroBasis

FABRIC, MESH = Fabric(1e3, shear=0.1), MeshQuad().refined(2)
N, VECTOR = MESH.nelements, ElementVector(ElementQuad1())
PLAIN, SCALAR = quad_basis(MESH, CENTRE), Basis(MESH, ElementQuad1())
IN_SPACE = quad_basis(MESH, CENTRE, 3)
HOURGLASS, JUMPS = HourglassBasis(MESH), JumpBasis(MESH)
MEANS = MeanBasis(MESH, VECTOR)
EDGES = FacetBasis(MESH, VECTOR)
CONSTANT = Basis(MESH, ElementVector(ElementQuad0()))
WITHOUT_VECTOR = Basis(MESH, ElementQuad1() * ElementQuad1())
FLUX = Basis(MESH, ElementQuadRT0())
FOUR = Basis(MESH, ElementVector(ElementQuad1(), 4))
SOLID = Basis(MeshHex(), ElementVector(ElementHex1()))
LINE = Basis(MeshLine(), ElementVector(ElementLineP1(), 2))
PART = PLAIN.with_elements(np.arange(3))
C_S, E_D = {"C_s": np.ones((N, 1))}, {"E_d": np.ones((2, N, 1))}
MOMENT = {"moment": np.zeros((N, 1)), "last": PLAIN.zeros()}
U = PLAIN.zeros()
ON_PART = PART.interpolate(U)
TOO_MANY = np.ones((2, N + 4))

OF_FABRIC, WITH_NUMBER = (FABRIC,), (FABRIC, 1.0)
MISUSES = [
    # form, its arguments, a basis, parameters, message
    # the basis
    ("tension", OF_FABRIC, HOURGLASS, {}, "quad_basis.* not an HourglassBasis"),
    ("shear", OF_FABRIC, HOURGLASS, {}, "quad_basis.* not an HourglassBasis"),
    ("shear_continuity", WITH_NUMBER, HOURGLASS, {}, "not an HourglassBasis"),
    ("hourglass", WITH_NUMBER, PLAIN, {}, r"requires a basis HourglassBasis\(mesh\)"),
    ("hourglass_rate", WITH_NUMBER, PLAIN, MOMENT, r"requires a basis HourglassB"),
    ("isotropic_hourglass", (1.0,), PLAIN, {}, r"requires a basis HourglassBasis"),
    ("out_of_plane", (), IN_SPACE, C_S, "basis HourglassBasis"),
    ("shear_continuity", WITH_NUMBER, PLAIN, {}, r"requires a basis JumpBasis"),
    ("mean_tension", OF_FABRIC, PLAIN, E_D, "requires a MeanBasis or a MacroBasis"),
    ("tension", OF_FABRIC, EDGES, {}, "integral over elements.* not a FacetBasis"),
    ("shear", OF_FABRIC, EDGES, {}, "integral over elements.* not a FacetBasis"),
    # the element
    ("tension", OF_FABRIC, SCALAR, {}, "displacement with two or three components"),
    ("shear", OF_FABRIC, SCALAR, {}, "displacement with two or three components"),
    ("hourglass", WITH_NUMBER, SCALAR, {}, "with two or three components"),
    ("tension", OF_FABRIC, WITHOUT_VECTOR, {}, "with two or three components"),
    ("tension", OF_FABRIC, FLUX, {}, "displacement with two or three components"),
    ("shear", OF_FABRIC, FOUR, {}, "displacement with two or three components"),
    ("tension", OF_FABRIC, SOLID, {}, "in the plane, not MeshHex1"),
    ("shear", OF_FABRIC, LINE, {}, "in the plane, not MeshLine1"),
    # its order
    ("tension", OF_FABRIC, CONSTANT, {}, "ElementQuad0 has no gradient"),
    ("shear", OF_FABRIC, CONSTANT, {}, "ElementQuad0 has no gradient"),
    # missing parameters
    ("tension", OF_FABRIC, PLAIN, {"u": None}, "parameter 'u'"),
    ("shear", OF_FABRIC, PLAIN, {"u": None}, "parameter 'u'"),
    ("hourglass", WITH_NUMBER, HOURGLASS, {"u": None}, "parameter 'u'"),
    ("mean_tension", OF_FABRIC, MEANS, {"u": None, **E_D}, "parameter 'u'"),
    ("shear_continuity", WITH_NUMBER, JUMPS, {"u": None}, "parameter 'u'"),
    ("mean_tension", OF_FABRIC, MEANS, {}, "requires the parameter 'E_d'"),
    ("hourglass", OF_FABRIC, HOURGLASS, {}, "requires the parameter 'C_s'"),
    ("hourglass_rate", WITH_NUMBER, HOURGLASS, {}, "parameter '(last|moment)'"),
    # shapes
    ("tension", OF_FABRIC, PLAIN, {"u": U[:-2]}, "u must have 50 real numbers"),
    ("shear", OF_FABRIC, PLAIN, {"u": IN_SPACE.zeros()}, "u must have 50 real"),
    ("tension", OF_FABRIC, PLAIN, {"u": U.reshape(-1, 2)}, r"not shape \(25, 2\)"),
    ("tension", OF_FABRIC, PLAIN, {"u": U.tolist()}, "u must be a DOF vector.*list"),
    ("shear", OF_FABRIC, PLAIN, {"u": U + 0j}, "u must have 50 real.*complex"),
    ("tension", OF_FABRIC, PLAIN, {"u": ON_PART}, "u has the shape .* 16 elements"),
    ("tension", OF_FABRIC, PART, {"u": PLAIN.interpolate(U)}, "has 3 elements"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": np.ones(N)}, r"C_s must have .*\(16,"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": np.ones((3, 1))}, "C_s has the shape"),
    ("hourglass", OF_FABRIC, HOURGLASS, {"C_s": -1.0}, "C_s must be >= 0"),
    ("mean_tension", OF_FABRIC, MEANS, {"E_d": 1.0}, r"E_d must have .*\(2, n_el"),
    ("mean_tension", OF_FABRIC, MEANS, {"E_d": np.ones((N, 1))}, "E_d must have"),
    (
        *("hourglass_rate", WITH_NUMBER, HOURGLASS),
        *({**MOMENT, "last": U[1:]}, "last must have 50 real"),
    ),
    ("tension", OF_FABRIC, PLAIN, {"tension": np.ones((N, 1))}, "tension must have"),
    # the fabric
    ("tension", (1e4,), PLAIN, {}, r"tension requires a Fabric such as .*not 10000"),
    ("shear", (Fabric,), PLAIN, {}, "shear requires a Fabric"),
    ("mean_tension", ({"right": FABRIC},), MEANS, E_D, "requires a Fabric"),
    ("hourglass", (Linear(1.0), 1.0), HOURGLASS, {}, "requires a Fabric"),
    ("hourglass", (FABRIC, -1.0), HOURGLASS, {}, "C_s must be a number >= 0, not -1"),
    ("hourglass", (FABRIC, "auto"), HOURGLASS, {}, "C_s must be a number >= 0"),
    ("isotropic_hourglass", (np.ones(3),), HOURGLASS, {}, "stiffness must be a number"),
    ("shear_continuity", (FABRIC, None), JUMPS, {}, "C_j must be a number"),
    ("tension", (Fabric(0.0, 1.0),), PLAIN, {}, "no tension stiffness"),
    ("tension", (Fabric(np.ones(N + 4)),), PLAIN, {}, "tension of warp: 20 values for"),
    ("shear", (Fabric(1.0, np.ones(5)),), PART, {}, "shear: 5 values for 16 elements"),
    ("tension", (Fabric(1.0, warp=TOO_MANY),), PLAIN, {}, "warp: 20 vectors for 16"),
    (
        *("tension", (Fabric(1.0, warp=lambda x: 0 * x),), PLAIN),
        *({}, "warp must be a non-zero finite vector"),
    ),
    # directions as parameters
    ("tension", OF_FABRIC, PLAIN, {"warp": np.ones(7)}, r"or a DOF vector.*\(7,\)"),
    ("tension", OF_FABRIC, PLAIN, {"weft": (0.0, 1.0)}, r"weft must have.*\(2,\)"),
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
