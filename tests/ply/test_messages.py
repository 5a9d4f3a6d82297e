"""Messages about plies: stiffnesses, fibre ends, loads and further terms."""

from functools import cache

import numpy as np
import pytest
from skfem import BilinearForm, CellBasis, MeshHex, MeshQuad, MeshTri2

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Force,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    Macro,
    MatrixTerm,
    OnePoint,
    Ply,
    Pressure,
    Quadratic,
    Traction,
    VectorTerm,
    split,
)
from skfem_textile.solve.conditions import Constraints
from tests.helpers import distorted, refused
from tests.helpers.plies import ELEMENT, SPRINGS, SQUARES, Spring, plain, ply_on

MESH = MeshQuad().refined(1).with_defaults()


def moved(node, by):
    p = MESH.p.copy()
    p[:, node] += by
    return MeshQuad(p, MESH.t)


@pytest.mark.parametrize("formulation", [Full(), Macro(), Quadratic()], ids=repr)
def test_a_mesh_is_refused_with_the_numbers_of_the_user(formulation):
    """Also if it is to be split or cut; other defects are in `tests.mesh`."""
    centre = int(np.argmin(np.abs(MESH.p - 0.5).sum(axis=0)))
    for mesh, text in (
        (MeshHex(), "must be a skfem.MeshQuad or a skfem.MeshTri .*, not MeshHex1"),
        (moved(centre, np.nan), r"1 node\(s\) have coordinates that are not finite: 8"),
        (moved(centre, 0.8), r"1 quadrilateral\(s\) are inverted or degenerate: 2"),
    ):
        refused(lambda m=mesh: Ply(m, Fabric(), formulation), text)


def bent(**ends):
    """A ply with stiff fibres in bending that end so."""
    inside = np.flatnonzero(MESH.f2t[1] >= 0)
    named = {"same": MESH.boundaries["left"], "middle": inside}
    mesh, fabric = MESH.with_boundaries(named), Fabric(bending=(1.0, 1.0))
    return lambda: Ply(mesh, fabric, OnePoint(), fibre_ends=ends)


def fabric(**arguments):
    return lambda: Ply(MESH, Fabric(**arguments))


def of(formulation, *arguments):
    return lambda: formulation(*arguments)


def ply(*formulation, **options):
    return lambda: Ply(MESH, Fabric(), *formulation, **options)


def held(where):
    """Conditions on quadratic triangles."""
    return lambda: Constraints(ply_on(SQUARES).basis, {"c": Condition(where)})


NOT_NEGATIVE = "deviation must be a finite number >= 0"
PLIES = [
    (of(OnePoint, -1.0), ">= 0 or 'auto', got -1.0"),
    (of(OnePoint, "much"), ">= 0 or 'auto', got 'much'"),
    (of(Macro, np.nan), ">= 0 or 'auto', got nan"),
    (of(OnePoint, np.ones((2, 2))), "got .*1. 1."),
    (of(OnePoint, "auto", "rate"), "stabilisation='auto' requires kind='energy'"),
    (of(Macro, "auto", (400.0, -1.0)), NOT_NEGATIVE),
    (of(Quadratic, np.nan), NOT_NEGATIVE),
    (of(Macro, "auto", 400.0), "deviation must be a pair"),
    (of(Macro, "auto", (1.0, 2.0, 3.0)), "deviation must be a pair"),
    (fabric(bending=1.0), "bending must be a pair"),
    (fabric(bending=(1.0,)), "bending must be a pair"),
    (fabric(bending=(1.0, -1.0)), "bending of weft must be a finite number >= 0"),
    (fabric(bending=(np.nan, 1.0)), "bending of warp must be a finite number >= 0"),
    (fabric(bending=(np.ones((2, 2)), 1.0)), "bending of warp must be"),
    (fabric(bending=(np.ones(3), 1.0)), "bending of warp: 3 values for 4 elements"),
    (fabric(twist=-1.0), "twist must be a finite number"),
    (fabric(twist=np.ones(3)), "twist: 3 values for 4 elements"),
    (bent(nowhere="clamped"), "no boundary 'nowhere'"),
    (bent(left="glued"), "must be clamped, mirror or a function.* not 'glued'"),
    (bent(left=lambda t: (0.0, t, 0.0)), "rotation of 'left' must be an angle"),
    (bent(left="clamped", same="mirror"), "shares edges with another"),
    (bent(middle="clamped"), "inside the ply"),
    (ply(fibre_ends="clamped"), "must be a mapping"),
    (ply(dimension=4), r"dimension must be 2 .* or 3"),
    (ply(dimension="3"), r"dimension must be 2 .* or 3"),
    (ply(OnePoint(1.0, "rate"), dimension=3), "kind rate requires a ply in the plane"),
    (lambda: ply_on(split(MeshQuad()).refined()), "refined, restricted or renumbered"),
    (lambda: ply_on(MeshTri2()), "a skfem.MeshTri with straight edges, not MeshTri2$"),
    (held(SQUARES.p[1] == 0), "'c': .*one bool for each of the 81 nodes of ply.nodes"),
    (held([0, 81]), "'c': .*node numbers must be from 0 to 80"),
]


@pytest.mark.parametrize(("call", "text"), PLIES)
def test_a_ply_is_refused(call, text):
    refused(call, text)


@cache
def square():
    return Ply(distorted(1).with_defaults(), Fabric(1e3, 1.0), Full())


N = plain().basis.N
LOPSIDED = Forms(*SPRINGS[:2], BilinearForm(lambda u, v, w: u[0] * v[1]))
OTHER = plain().mesh.scaled(10.0)
TURNED = MeshQuad(plain().mesh.p[:, ::-1], plain().mesh.nvertices - 1 - plain().mesh.t)
NO_BASIS = "its basis is not a basis of the displacement"


def springs(basis, **options):
    return FormTerm("a", SPRINGS, basis, **options)


TERMS = [
    (Traction("tpo", (1, 0)), "no boundary 'tpo'"),
    (Force("top", (1, np.nan)), "finite vector"),
    (Traction("top", "much"), "must be real-valued"),
    (Traction("top", lambda x: 1 / 0), "raised ZeroDivisionError"),
    (BodyForce(lambda x: x[0]), "finite vector"),
    (Force([999], (1, 0)), "node numbers must be from 0 to"),
    (Force("top", (0, 1), lambda t: 1 / (1 - t)), "'force on top': its factor raised"),
    (Force("top", (0, 1), lambda t: "2"), "'force on top': its factor must be real"),
    (Force("top", (0, 1), np.inf), "'force on top': its factor must be a finite"),
    (Pressure(1.0), r"Ply\(..., dimension=3\)"),
    (MatrixTerm("a", np.eye(3)), "its matrix must be"),
    (VectorTerm("a", np.full(N, np.nan)), "its vector must be"),
    (VectorTerm("a", np.ones(N), role="force"), "role must be one of"),
    (VectorTerm("shear", np.ones(N)), "other terms have the name 'shear'"),
    (3.0, "is not a term: it lacks name"),
    (VectorTerm, "is a class, not a term"),
    (VectorTerm("", np.ones(N)), "the name of a term must be a non-empty string"),
    (springs(None), NO_BASIS),
    (springs(CellBasis(OTHER, ELEMENT)), NO_BASIS),
    (springs(CellBasis(TURNED, ELEMENT)), NO_BASIS),
    (springs(square().basis, parameters=object()), "its parameters lack"),
    (FormTerm("wind", LOPSIDED, square().basis), "'wind': its tangent is not symm"),
    (MatrixTerm("wind", np.triu(np.ones((N, N)))), "'wind': its tangent is not symm"),
]


@pytest.mark.parametrize(("term", "text"), TERMS)
def test_a_load_or_term_is_refused(term, text):
    refused(lambda: square().with_terms(term), text)


def test_a_load_in_space_has_three_components_and_a_pressure_is_finite():
    ply = Ply(MESH, Fabric(), dimension=3)
    for term, text in (
        (Traction("top", (0.0, 1.0)), r"shape \(3,\)"),
        (Pressure(np.nan), "must be a finite number"),
        (Pressure(1.0, lambda t: np.nan), "its factor must be a finite number"),
    ):
        refused(lambda x=term: ply.with_terms(x), text)


def test_a_pressure_without_potential_is_refused():
    ply = Ply(MESH, Fabric(10.0, 1.0), terms=[Pressure(0.7)], dimension=3)
    sides, text = ("left", "right", "bottom", "top"), "load 'pressure': .*"
    free = {"left": Condition("left")}
    refused(lambda: LoadStepper(ply, free, 1), text + "free edge.s. of the boundary")
    lifted = {name: Condition(name, (None, None, 1.0)) for name in sides}
    refused(lambda: LoadStepper(ply, lifted, 1), text + "stay in the plane z = 0")
    LoadStepper(ply, {name: Condition(name, (0.0, 0.0, 1.0)) for name in sides}, 1)


# By part: how it differs from a spring, and what is said


WRONG_PARTS = {
    "energy of numbers": ("energy", lambda own, u: u, "its energy must be one real"),
    "one number": ("residual", lambda own, u: 0.0, "its residual must be"),
    "complex": ("residual", lambda own, u: own + 0j, "its residual must be"),
    "small": ("tangent", lambda own, u: own[:-2, :-2], "its tangent must be"),
    "not finite": ("residual", lambda own, u: own * np.nan, "its residual is not fin"),
    "broken": ("energy", lambda own, u: u.nothing, "its energy raised AttributeError"),
    "ten times": ("energy", lambda own, u: 10 * own, "its energy changes by"),
    "negative": ("tangent", lambda own, u: -own, "its residual changes by"),
}


@pytest.mark.parametrize("wrong", WRONG_PARTS.values(), ids=WRONG_PARTS)
def test_inconsistent_parts_of_a_term_are_refused_with_its_name(wrong):
    part, change, text = wrong

    class Wrong(Spring):
        pass

    method = getattr(Spring, part)
    setattr(Wrong, part, lambda self, u, t, p: change(method(self, u, t, p), u))
    refused(lambda: plain().with_terms(Wrong(N)), f"term 'spring': {text}")


def test_undeclared_coupling_of_a_tangent_is_refused():
    sprung = plain().with_terms(Spring(N, couples=()))
    text = "'spring': its tangent couples nodes"
    refused(lambda: sprung.tangent(np.zeros(N)), text)
