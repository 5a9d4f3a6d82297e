"""Nonlinear examples of scikit-fem with forms of a fabric in place of theirs.

Examples 36 and 51 of scikit-fem 12 have a displacement as their unknown.  Each test
repeats the structure of one of them in its own words: the bases, the loop and the way
to solve.  What differs besides the forms is named.  Equilibrium is the same as with a
load stepper.
"""

from itertools import pairwise

import numpy as np
from scipy.sparse import block_diag, bmat
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad0,
    ElementQuad1,
    ElementVector,
    FacetBasis,
    Functional,
    LinearForm,
    MeshLine,
    MeshQuad,
    asm,
    condense,
    enforce,
    solve,
)
from skfem.helpers import ddot, det, grad, identity
from skfem.supermeshing import elementwise_quadrature, intersect

from skfem_textile import (
    CENTRE,
    Condition,
    Fabric,
    Forms,
    FormTerm,
    HourglassBasis,
    LoadStepper,
    OnePoint,
    Ply,
    Term,
    VectorTerm,
    hourglass,
    quad_basis,
    shear,
    tension,
)

C_S = 0.2  # N/mm


def terms_of(fabric, basis):
    """The element of Hamila & Boisse: forms and their bases."""
    corners = HourglassBasis(basis.mesh)
    return [
        *((tension(fabric), basis), (shear(fabric), basis)),
        (hourglass(fabric, C_S), corners),
    ]


def total(terms, part, u):
    """Sum of energies, residuals or tangents."""
    return sum(asm(getattr(forms, part), basis, u=u) for forms, basis in terms)


def assert_quadratic(increments):
    """The order of convergence from the last three increments above round-off."""
    assert increments[-1] < 1e-10
    x = np.log([a for a in increments if a > 1e-14][-3:])
    assert (x[2] - x[1]) / (x[1] - x[0]) > 1.6


K_A = 100.0  # N/mm, stiffness against changes of area


def cofactor(G):
    """Derivative of det G."""
    return np.array([[G[1, 1], -G[1, 0]], [-G[0, 1], G[0, 0]]])


def of_area(w):
    """Change of the area per reference area, det F − 1, and its derivative."""
    F = grad(w["u"]) + identity(w["u"])
    return det(F) - 1, cofactor(F)


def test_example_36_blocks_of_displacement_and_pressure():
    """The elastomer is a coating that holds the area; the fabric replaces its μF.

    The pressure is constant in an element, so that p = κ (det F − 1) with one point.
    """
    fabric = Fabric(10.0, 0.5, warp=(1, 1), weft=(-1, 1))
    mesh = MeshQuad().refined(2).with_defaults()
    basis = {
        "u": Basis(mesh, ElementVector(ElementQuad1()), quadrature=CENTRE),
        "p": Basis(mesh, ElementQuad0(), quadrature=CENTRE),
    }
    terms = terms_of(fabric, basis["u"])
    a1 = LinearForm(lambda v, w: w["p"] * ddot(of_area(w)[1], grad(v)))
    a2 = LinearForm(lambda q, w: (of_area(w)[0] - w["p"] / K_A) * q)
    b11 = BilinearForm(lambda u, v, w: w["p"] * ddot(cofactor(grad(u)), grad(v)))
    b12 = BilinearForm(lambda p, v, w: p * ddot(of_area(w)[1], grad(v)))
    b22 = BilinearForm(lambda p, q, w: -p * q / K_A)

    u, p, n = basis["u"].zeros(), basis["p"].zeros(), basis["u"].N
    fixed = {"top": "u^2", "bottom": "u^2", "left": "u^1"}
    D = [basis["u"].get_dofs(edge).all(along) for edge, along in fixed.items()]
    u[D[0]] = 0.1
    free = basis["u"].complement_dofs(np.hstack(D))
    free = np.hstack([free, n + np.arange(basis["p"].N)])
    increments = []
    for _ in range(12):
        w = {"u": basis["u"].interpolate(u), "p": basis["p"].interpolate(p)}
        K11 = total(terms, "tangent", u) + asm(b11, basis["u"], **w)
        K12 = asm(b12, basis["p"], basis["u"], **w)
        K22 = asm(b22, basis["p"], **w)
        f1 = total(terms, "residual", u) + asm(a1, basis["u"], **w)
        f = np.concatenate([f1, asm(a2, basis["p"], **w)])
        K = bmat([[K11, K12], [K12.T, K22]], "csr")
        du, dp = np.split(solve(*condense(K, -f, I=free)), [n])
        u, p = u + du, p + dp
        increments.append(np.linalg.norm(du))
        if increments[-1] < 1e-10:
            break
    assert_quadratic(increments)

    def stiffness(u, v, w):
        change, H = of_area(w)
        second = change * ddot(cofactor(grad(u)), grad(v))
        return K_A * (ddot(H, grad(u)) * ddot(H, grad(v)) + second)

    coating = Forms(
        Functional(lambda w: 0.5 * K_A * of_area(w)[0] ** 2),
        LinearForm(lambda v, w: K_A * of_area(w)[0] * ddot(of_area(w)[1], grad(v))),
        BilinearForm(stiffness),
    )
    term = FormTerm("coating", coating, basis["u"])
    ply = Ply(mesh, fabric, OnePoint(C_S), [term])
    conditions = {
        "pulled": Condition("top", 0.1, direction=(0, 1)),
        "below": Condition("bottom", 0.0, direction=(0, 1)),
        "beside": Condition("left", 0.0, direction=(1, 0)),
    }
    expected = LoadStepper(ply, conditions, steps=1).run().states[-1].u
    np.testing.assert_allclose(u, expected, atol=1e-10)


class Contact(Term):
    """Contact of example 51: penalty on the overlap of two bands at facing facets."""

    name, role, line_search = "contact", "internal", True

    def __init__(self, facets):
        self.facets = facets

    def energy(self, u, t, p=None):
        return asm(Functional(lambda w: 1e2 * overlap(w) ** 2), self.facets, x=u)

    def residual(self, u, t, p=None):
        form = LinearForm(lambda v, q, w: 2e2 * overlap(w) * (v[1] - q[1]))
        return asm(form, self.facets, x=u)

    def tangent(self, u, t, p=None):
        def form(u, p, v, q, w):
            return 2e2 * (overlap(w) < 0) * (u[1] - p[1]) * (v[1] - q[1])

        return asm(BilinearForm(form), self.facets, x=u)

    def couples(self):
        return [self.facets.element_dofs[::2] // 2]


def overlap(w):
    upper, lower = w["x"]
    return np.minimum(0.25 + upper[1] - lower[1], 0.0)


def facing(meshes, moved):
    """Facets of two meshes, in pairs of parts that face each other when moved."""
    edges = zip(moved, ("bottom", "top"), strict=True)
    lines, facets = zip(
        *(
            mesh.trace(edge, mtype=MeshLine, project=lambda p: np.array(p[0]))
            for mesh, edge in edges
        ),
        strict=True,
    )
    common, *parts = intersect(*lines)
    upper, lower = (
        FacetBasis(
            *(mesh, ElementVector(ElementQuad1())),
            quadrature=elementwise_quadrature(line, common, part),
            facets=numbers[part],
        )
        for mesh, line, numbers, part in zip(meshes, lines, facets, parts, strict=True)
    )
    return upper * lower


def test_example_51_contact_of_two_bodies():
    """Two bands of fabric; the penalty is differentiated by hand instead of by JAX.

    The factor 0.95 of its increments leaves a twentieth of the error.
    """
    fabric = Fabric(2.0, 0.5)
    meshes = [
        MeshQuad.init_tensor(np.linspace(0, 5, n), np.linspace(y, y + 0.25, 3))
        for n, y in ((6, 0.0), (5, -0.5))
    ]
    meshes = [mesh.with_defaults() for mesh in meshes]
    bases = [quad_basis(mesh, CENTRE) for mesh in meshes]
    terms = [terms_of(fabric, basis) for basis in bases]
    n = bases[0].N
    force = asm(LinearForm(lambda v, w: 5e-2 * v[0] + 1e-2 * v[1]), bases[1])
    force = np.concatenate([np.zeros(n), force])
    upper, lower = (basis.get_dofs({"left", "right"}).all() for basis in bases)
    u, moved, increments = np.zeros(n + bases[1].N), meshes, []
    for _ in range(40):
        contact = Contact(facing(meshes, moved))
        of_bands = list(zip(terms, np.split(u, [n]), strict=True))
        K = block_diag([total(band, "tangent", x) for band, x in of_bands], "csr")
        f = np.concatenate([total(band, "residual", x) for band, x in of_bands])
        f += contact.residual(u, 1.0) - force
        K += contact.tangent(u, 1.0)
        du = solve(*enforce(K, -f, D=np.concatenate([upper, n + lower])))
        u = u + 0.95 * du
        increments.append(np.linalg.norm(du))
        if increments[-1] < 1e-11:
            break
        moved = [
            mesh.translated(x[basis.nodal_dofs])
            for mesh, basis, x in zip(meshes, bases, np.split(u, [n]), strict=True)
        ]
    assert increments[-1] < 1e-11
    assert all(b < 0.06 * a for a, b in pairwise(increments[-4:]))
    assert overlap({"x": contact.facets.interpolate(u)}).min() < 0

    one, other = meshes
    both = MeshQuad(
        np.hstack([one.p, other.p]), np.hstack([one.t, other.t + one.nvertices])
    )
    load = VectorTerm("load", force)
    ply = Ply(both, fabric, OnePoint(C_S), [contact, load])
    held = {"ends": Condition(lambda x: (x[0] == 0) | (x[0] == 5))}
    stepper = LoadStepper(ply, held, steps=1, initial_guess=u)
    expected = stepper.run().states[-1].u
    np.testing.assert_allclose(u, expected, atol=1e-10)
