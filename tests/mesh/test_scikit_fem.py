"""Internals of scikit-fem used by the package behave as expected."""

import re
from pathlib import Path

import numpy as np
import pytest
from skfem import (
    BilinearForm,
    CellBasis,
    ElementQuad1,
    ElementVector,
    Functional,
    LinearForm,
    MeshQuad,
    asm,
)
from skfem.helpers import ddot, grad

import skfem_textile
from skfem_textile.mesh.scikit_fem import (
    OwnAssembly,
    matrix_entries,
    number_entries,
    set_element_dofs,
    set_positions,
    vector_entries,
    with_names,
)

MESH = MeshQuad().refined(1).with_defaults().with_subdomains({"part": np.array([1])})


@pytest.fixture
def basis():
    return CellBasis(MESH, ElementVector(ElementQuad1()), intorder=1)


def test_boundaries_and_subdomains_are_replaced_and_dropped():
    mesh = with_names(MESH, {"edge": np.array([2, 0])}, None)
    assert mesh.boundaries.keys() == {"edge"}
    assert mesh.boundaries["edge"].tolist() == [2, 0]
    assert mesh.subdomains is None
    assert with_names(mesh, None, MESH.subdomains).boundaries is None
    assert MESH.boundaries.keys() == {"left", "bottom", "right", "top"}
    assert mesh.restrict([0]).boundaries.keys() == {"edge"}
    same = MeshQuad(MESH.p, MESH.t, MESH.boundaries, MESH.subdomains)  # in this order
    assert same.boundaries is MESH.boundaries
    assert same.subdomains is MESH.subdomains


def test_elements_of_a_basis_accept_other_unknowns_and_positions(basis):
    reversed_dofs, x = basis.element_dofs[::-1].copy(), np.ones((2, 4, 1))
    set_element_dofs(basis, reversed_dofs[:4])
    assert basis.Nbfun == 4
    assert basis.element_dofs is not basis.dofs.element_dofs
    np.testing.assert_array_equal(basis.element_dofs, reversed_dofs[:4])
    set_positions(basis, x)
    np.testing.assert_array_equal(np.asarray(basis.default_parameters()["x"]), x)
    used = asm(LinearForm(lambda v, w: w["x"][0] * v[0]), basis)
    assert set(np.flatnonzero(used)) <= set(reversed_dofs[:4].ravel())


def number(basis, energy, u):
    return number_entries(asm(energy, basis, u=u))


def vector(basis, residual, u):
    f = residual.elemental(basis, u=u).data
    return vector_entries(basis, f.reshape(basis.Nbfun, -1))


def matrix(basis, tangent, u):
    K = tangent.elemental(basis, u=u).data
    return matrix_entries(basis, K.reshape(basis.Nbfun, basis.Nbfun, -1))


@pytest.mark.parametrize(
    ("kind", "function", "entries"),
    [
        (Functional, lambda w: w["u"][0] ** 2, number),
        (LinearForm, lambda v, w: ddot(grad(w["u"]), grad(v)), vector),
        (BilinearForm, lambda u, v, w: ddot(grad(u), grad(v)), matrix),
    ],
)
def test_a_form_assembles_its_entries_or_its_function(basis, kind, function, entries):
    class Own(OwnAssembly, kind):
        def entries(self, ubasis, vbasis, parameters):
            assert ubasis is basis
            assert parameters["u"] is u
            return self.params["entries"]

    form, u = kind(function), np.arange(basis.N) / basis.N
    expected = asm(form, basis, u=u)
    for computed in (entries(basis, form, u), None):
        assembled = asm(Own(form, entries=computed), basis, u=u)
        assert type(assembled) is type(expected)
        assert np.max(abs(assembled - expected)) <= 1e-14 * np.max(abs(expected))


@pytest.mark.parametrize("threads", [0, 2])
def test_a_form_checks_its_parameters_and_selects_fields(threads):
    class Last(OwnAssembly):
        def entries(self, ubasis, vbasis, parameters):
            return None

        def checked(self, basis, parameters):
            return {"factor": 3.0, **parameters}

        def taken(self, fields):
            return fields[-1:]

    class LastOf(Last, LinearForm):
        pass

    class LastOfBoth(Last, BilinearForm):
        pass

    class Total(Last, Functional):
        pass

    both = CellBasis(MESH, ElementVector(ElementQuad1()) * ElementQuad1(), intorder=2)
    scalar = CellBasis(MESH, ElementQuad1(), intorder=2)
    x, last = np.arange(both.N) / both.N, both.split_indices()[1]
    f = asm(LastOf(lambda v, w: w["factor"] * w["x_h"] * v), both, x_h=x)
    expected = asm(LinearForm(lambda v, w: 3 * w["x_h"] * v), scalar, x_h=x[last])
    np.testing.assert_allclose(f[last], expected)
    assert np.count_nonzero(f) == last.size
    mass = LastOfBoth(lambda u, v, w: w["factor"] * u * v, nthreads=threads)
    K, M = asm(mass, both), asm(BilinearForm(lambda u, v, w: 3 * u * v), scalar)
    np.testing.assert_allclose(K.toarray()[np.ix_(last, last)], M.toarray())
    assert K.count_nonzero() == M.count_nonzero()
    total = Total(lambda w: w["factor"] * w["x_h"])
    assert total.elemental(both, x_h=x).sum() == pytest.approx(asm(total, both, x_h=x))


def test_no_other_module_uses_private_names_of_scikit_fem():
    private = (
        r"\b_(boundaries|subdomains|assemble|kernel|normalize_asm_kwargs|element_dofs|"
        r"global_coordinates|J)\b"
    )
    deep = r"^ *(from|import) skfem\.(?!helpers\b)"
    files = Path(skfem_textile.__file__).parent.rglob("*.py")
    found = re.compile(f"{private}|{deep}", re.MULTILINE)
    assert {file.name for file in files if found.search(file.read_text())} == {
        "scikit_fem.py"
    }
