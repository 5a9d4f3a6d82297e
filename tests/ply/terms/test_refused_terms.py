"""Terms of one's own that are refused, each with its name."""

import numpy as np
import pytest
from skfem import BilinearForm, CellBasis, MeshQuad

from skfem_textile import Forms, FormTerm, MatrixTerm, VectorTerm
from tests.helpers.sprung_plies import ELEMENT, SPRINGS, Spring, plain


def test_a_tangent_that_couples_what_it_does_not_say_is_refused():
    ply = plain()
    sprung = ply.with_terms(Spring(ply.basis.N, couples=()))
    with pytest.raises(ValueError, match="'spring': its tangent couples nodes"):
        sprung.tangent(ply.basis.zeros())


def test_a_tangent_that_is_not_symmetric_is_refused():
    ply = plain()
    lopsided = Forms(*SPRINGS[:2], BilinearForm(lambda u, v, w: u[0] * v[1]))
    for term in (
        FormTerm("wind", lopsided, ply.basis),
        MatrixTerm("wind", np.triu(np.ones((ply.basis.N, ply.basis.N)))),
    ):
        with pytest.raises(ValueError, match="'wind': its tangent is not symmetric"):
            ply.with_terms(term)


def test_terms_of_another_ply_or_name_are_refused():
    ply, N = plain(), plain().basis.N
    other, odd = CellBasis(MeshQuad(), ELEMENT), object()
    for term, complaint in (
        (FormTerm("a", SPRINGS, other), "its basis is not one of the displacement"),
        (MatrixTerm("a", np.eye(3)), "its matrix must be"),
        (VectorTerm("a", np.full(N, np.nan)), "its vector must be"),
        (VectorTerm("a", np.ones(N), role="force"), "role must be one of"),
        (VectorTerm("shear", np.ones(N)), "two terms are named 'shear'"),
        (3.0, "is no term: it has no name"),
        (VectorTerm, "is no term: it is a class"),
        (VectorTerm("", np.ones(N)), "name must be some text"),
        (FormTerm("a", SPRINGS, None), "its basis is not one of the displacement"),
        (FormTerm("a", SPRINGS, ply.basis, parameters=odd), "its parameters have no"),
    ):
        with pytest.raises(ValueError, match=complaint):
            ply.with_terms(term)


def test_a_basis_of_other_places_or_cells_is_refused():
    """However many unknowns it has: the numbers of the nodes are what counts."""
    ply = plain()
    turned = MeshQuad(ply.mesh.p[:, ::-1], ply.mesh.nvertices - 1 - ply.mesh.t)
    for mesh in (ply.mesh.scaled(10.0), turned):
        term = FormTerm("springs", SPRINGS, CellBasis(mesh, ELEMENT))
        with pytest.raises(ValueError, match="its basis is not one of"):
            ply.with_terms(term)
    copied = MeshQuad(ply.mesh.p.copy(), ply.mesh.t.copy())
    ply.with_terms(FormTerm("springs", SPRINGS, CellBasis(copied, ELEMENT)))


WRONG_PARTS = {
    "energy of numbers": ("energy", lambda own, u: u, "its energy must be one real"),
    "column": ("residual", lambda own, u: own[:, None], "its residual must be"),
    "one number": ("residual", lambda own, u: 0.0, "its residual must be"),
    "complex": ("residual", lambda own, u: own + 0j, "its residual must be"),
    "small": ("tangent", lambda own, u: own[:-2, :-2], "its tangent must be"),
    "not finite": ("residual", lambda own, u: own * np.nan, "its residual is not fin"),
    "broken": ("energy", lambda own, u: u.nothing, "its energy fails: AttributeError"),
    "ten times": ("energy", lambda own, u: 10 * own, "its energy changes by"),
    "negative": ("tangent", lambda own, u: -own, "its residual changes by"),
}


@pytest.mark.parametrize("wrong", WRONG_PARTS.values(), ids=WRONG_PARTS)
def test_parts_of_a_term_that_do_not_fit_are_refused_with_its_name(wrong):
    part, change, complaint = wrong

    class Wrong(Spring):
        pass

    own = getattr(Spring, part)
    setattr(Wrong, part, lambda self, u, t, p: change(own(self, u, t, p), u))
    ply = plain()
    with pytest.raises(ValueError, match=f"term 'spring': {complaint}"):
        ply.with_terms(Wrong(ply.basis.N))
