"""A form on the wrong basis, or without its parameters, is refused in one line."""

import numpy as np
import pytest
from skfem import Basis, ElementQuad1, ElementVector, FacetBasis, MeshQuad, asm

import skfem_textile
from skfem_textile import (
    CENTRE,
    Fabric,
    HourglassBasis,
    JumpBasis,
    MeanBasis,
    forms,
    quad_basis,
)

FABRIC, MESH = Fabric(1e3, shear=0.1), MeshQuad().refined(2)
PLAIN, SCALAR = quad_basis(MESH, CENTRE), Basis(MESH, ElementQuad1())
HOURGLASS = HourglassBasis(MESH)
MEANS = MeanBasis(MESH, ElementVector(ElementQuad1()))
EDGES = FacetBasis(MESH, ElementVector(ElementQuad1()))
C_S = {"C_s": np.ones((MESH.nelements, 1))}
E_D = {"E_d": np.ones((2, MESH.nelements, 1))}
MOMENT = {"moment": np.zeros((MESH.nelements, 1)), "last": PLAIN.zeros()}

MISUSES = [
    # form, its arguments, a basis, parameters, message
    ("tension", (FABRIC,), HOURGLASS, {}, "quad_basis.* not an HourglassBasis"),
    ("shear", (FABRIC,), HOURGLASS, {}, "quad_basis.* not an HourglassBasis"),
    ("shear_continuity", (FABRIC, 1.0), HOURGLASS, {}, "not an HourglassBasis"),
    ("hourglass", (FABRIC, 1.0), PLAIN, {}, r"requires a basis HourglassBasis\(mesh\)"),
    ("hourglass_rate", (FABRIC, 1.0), PLAIN, MOMENT, r"requires a basis HourglassB"),
    ("isotropic_hourglass", (1.0,), PLAIN, {}, r"requires a basis HourglassBasis"),
    ("out_of_plane", (), quad_basis(MESH, CENTRE, 3), C_S, "basis HourglassBasis"),
    ("shear_continuity", (FABRIC, 1.0), PLAIN, {}, r"requires a basis JumpBasis"),
    ("mean_tension", (FABRIC,), PLAIN, E_D, "requires a MeanBasis or a MacroBasis"),
    ("mean_tension", (FABRIC,), MEANS, {}, "requires the parameter 'E_d'"),
    ("hourglass", (FABRIC,), HOURGLASS, {}, "requires the parameter 'C_s'"),
    (
        "hourglass_rate",
        (FABRIC, 1.0),
        HOURGLASS,
        {},
        "requires the parameter '(last|moment)'",
    ),
    ("tension", (FABRIC,), SCALAR, {}, "displacement with two or three components"),
    ("shear", (FABRIC,), SCALAR, {}, "displacement with two or three components"),
    ("hourglass", (FABRIC, 1.0), SCALAR, {}, "with two or three components"),
    ("tension", (FABRIC,), EDGES, {}, "integral over elements.* not a FacetBasis"),
    ("shear", (FABRIC,), EDGES, {}, "integral over elements.* not a FacetBasis"),
]


@pytest.mark.parametrize(("name", "arguments", "basis", "parameters", "text"), MISUSES)
@pytest.mark.parametrize("form", ["residual", "tangent", "energy"])
@pytest.mark.parametrize("module", [forms, skfem_textile], ids=["forms", "top"])
def test_the_message_names_the_basis_or_the_parameter(
    module, form, name, arguments, basis, parameters, text
):
    function = getattr(module, name, getattr(forms, name))
    u = 0.01 * np.random.default_rng(1).standard_normal(basis.N)
    with pytest.raises(ValueError, match=text):
        asm(getattr(function(*arguments), form), basis, u=u, **parameters)


@pytest.mark.parametrize(
    ("name", "basis"),
    [
        ("tension", PLAIN),
        ("shear", PLAIN),
        ("hourglass", HOURGLASS),
        ("mean_tension", MEANS),
        ("shear_continuity", JumpBasis(MESH)),
    ],
)
@pytest.mark.parametrize("form", ["residual", "tangent", "energy"])
@pytest.mark.parametrize("module", [forms, skfem_textile], ids=["forms", "top"])
def test_a_form_without_displacement_asks_for_it(module, form, name, basis):
    arguments = (
        (FABRIC, 1.0) if name in ("hourglass", "shear_continuity") else (FABRIC,)
    )
    forms_of = getattr(module, name)(*arguments)
    with pytest.raises(ValueError, match=r"requires the parameter 'u'"):
        asm(getattr(forms_of, form), basis)
