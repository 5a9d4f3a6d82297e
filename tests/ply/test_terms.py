"""Terms of one's own: energies, forces and tangent, and what is refused."""

import numpy as np
import pytest
from helpers import derivative, distorted, wobble
from scipy.sparse import csr_matrix
from skfem import (
    BilinearForm,
    CellBasis,
    ElementQuad1,
    ElementVector,
    FacetBasis,
    Functional,
    InteriorFacetBasis,
    LinearForm,
    MeshQuad,
)
from skfem.helpers import dot

from skfem_textile import (
    Condition,
    Fabric,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    MatrixTerm,
    Mixed,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    Term,
    VectorTerm,
    forms,
)
from skfem_textile.mesh.splitting import cut
from skfem_textile.ply.kernels.kernel import ShearKernel
from skfem_textile.solve.states import NoEquilibriumError

SPRINGS = Forms(
    Functional(lambda w: 0.5 * (1 + w["t"]) * dot(w["u"], w["u"])),
    LinearForm(lambda v, w: (1 + w["t"]) * dot(w["u"], v)),
    BilinearForm(lambda u, v, w: (1 + w["t"]) * dot(u, v)),
)
ELEMENT = ElementVector(ElementQuad1())
CONDITIONS = {
    "clamp": Condition("bottom"),
    "pull": Condition("top", 0.3, direction=(1, 0)),
}


def plain(formulation=None):
    mesh = distorted(1).with_defaults()
    mesh = mesh.with_subdomains({"some": np.arange(5)})
    return Ply(mesh, Fabric(1e3, 0.5), formulation or OnePoint(1.0))


BASES = {
    "cells": lambda mesh: CellBasis(mesh, ELEMENT),
    "a subdomain": lambda mesh: CellBasis(mesh, ELEMENT, elements="some"),
    "a boundary": lambda mesh: FacetBasis(mesh, ELEMENT, facets="top"),
    "interior facets": lambda mesh: InteriorFacetBasis(mesh, ELEMENT),
}


@pytest.mark.parametrize("basis", BASES.values(), ids=BASES)
@pytest.mark.parametrize("t", [0.0, 0.7])
def test_a_term_adds_its_energy_forces_and_tangent_on_any_basis(basis, t):
    ply = plain()
    term = FormTerm("springs", SPRINGS, basis(ply.mesh))
    sprung, u, du = ply.with_terms(term), wobble(ply, 1), wobble(ply, 2)
    energy = sprung.energies(u, t)["springs"]
    assert energy > 0
    assert sprung.energy(u, t) == pytest.approx(ply.energy(u, t) + energy)
    more = sprung.residual(u, t) - ply.residual(u, t)
    np.testing.assert_allclose(more, term.residual(u, t), atol=1e-9)
    assert derivative(lambda x: sprung.energy(x, t), u, du) == pytest.approx(
        sprung.residual(u, t) @ du
    )
    np.testing.assert_allclose(
        derivative(lambda x: sprung.residual(x, t), u, du),
        sprung.tangent(u, t=t) @ du,
        atol=1e-5 * abs(sprung.tangent(u, t=t)).max(),
    )


def test_a_term_of_quadratic_triangles_sees_all_their_nodes():
    mesh = cut(distorted(1)).with_defaults()
    ply = Ply(mesh, Fabric(1e3, 0.5), Quadratic())
    springs = FormTerm("springs", SPRINGS, FacetBasis(mesh, ply.basis.elem))
    sprung, u, du = ply.with_terms(springs), wobble(ply, 1), wobble(ply, 2)
    np.testing.assert_allclose(
        derivative(sprung.residual, u, du), sprung.tangent(u) @ du, atol=1e-3
    )


def test_a_kernel_gives_the_same_numbers_as_its_forms():
    ply, further = plain(), Fabric(1e3, Sin2(2.0))
    u = wobble(ply, 3)
    own = [
        ply.with_terms(FormTerm("more", forms.shear(further), ply.basis, kernel))
        for kernel in (None, ShearKernel(further))
    ]
    slow, fast = own
    assert fast.energy(u) == pytest.approx(slow.energy(u), rel=1e-12)
    np.testing.assert_allclose(fast.residual(u), slow.residual(u), atol=1e-9)
    assert abs(fast.tangent(u) - slow.tangent(u)).max() < 1e-9


class Spring(Term):
    """A spring between two nodes, with no more than a term needs."""

    name, role = "spring", "internal"

    def __init__(self, N, couples=None):
        ends = np.zeros((1, N))
        ends[0, 0], ends[0, -2] = -1.0, 1.0
        self.K = csr_matrix(3.0 * ends.T @ ends)
        self._couples = couples

    def energy(self, u, t):
        return 0.5 * u @ (self.K @ u)

    def residual(self, u, t):
        return self.K @ u

    def tangent(self, u, t):
        return self.K

    def couples(self):
        return self._couples


@pytest.mark.parametrize("named", [False, True])
def test_a_class_of_ones_own_is_a_term(named):
    ply = plain()
    last = ply.nodes.shape[1] - 1
    couples = (np.array([[0], [last]]),) if named else None
    spring = Spring(ply.basis.N, couples)
    sprung, u = ply.with_terms(spring), wobble(ply, 1)
    K = (sprung.tangent(u) - ply.tangent(u)).toarray()
    np.testing.assert_allclose(K, spring.K.toarray(), atol=1e-9)
    matrix = ply.with_terms(MatrixTerm("spring", spring.K))
    assert abs(matrix.tangent(u) - sprung.tangent(u)).max() < 1e-9
    assert matrix.energy(u) == pytest.approx(sprung.energy(u))


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
    other, odd = CellBasis(MeshQuad(), ELEMENT), Drag(ply.basis)
    odd.depends_on = "stat"
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
        (FormTerm("a", SPRINGS, ply.basis, memory=object()), "memory has no parameter"),
        (FormTerm("a", SPRINGS, ply.basis, memory=odd), "'stat': choose of state"),
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
    setattr(Wrong, part, lambda self, u, t: change(own(self, u, t), u))
    ply = plain()
    with pytest.raises(ValueError, match=f"term 'spring': {complaint}"):
        ply.with_terms(Wrong(ply.basis.N))


class Drag:
    """A memory: drawn to the last converged displacement."""

    work, depends_on = 0.0, "path"

    def __init__(self, basis):
        self.basis = basis
        self.begin()

    def begin(self):
        self.parameters = {"last": self.basis.zeros()}

    def commit(self, u):
        self.parameters = {"last": u.copy()}
        return True

    def restore(self, parameters, work):
        self.parameters = parameters


DRAG = Forms(
    Functional(lambda w: 0.5 * dot(w["u"] - w["last"], w["u"] - w["last"])),
    LinearForm(lambda v, w: dot(w["u"] - w["last"], v)),
    BilinearForm(lambda u, v, w: dot(u, v)),
)


@pytest.mark.parametrize("role", ["internal", "load"])
def test_plies_that_share_a_term_remember_apart(role):
    ply = plain()
    term = FormTerm("drag", DRAG, ply.basis, role=role, memory=Drag(ply.basis))
    first, u = ply.with_terms(term), wobble(ply, 1)
    first.commit(u)
    for second in (
        first.with_terms(MatrixTerm("none", 0 * Spring(ply.basis.N).K)),
        ply.with_terms(term),
    ):
        assert np.abs(second.memories["drag"].parameters["last"]).max() == 0.0
    np.testing.assert_array_equal(first.memories["drag"].parameters["last"], u)
    assert LoadStepper(first, CONDITIONS, 2).run().converged


class Count(Drag):
    """Tells how often it was committed, and changes its arrays in place."""

    def begin(self):
        super().begin()
        self.parameters["times"] = self.basis.zeros()

    def commit(self, u):
        self.parameters["last"][:] = u
        self.parameters["times"] += 1.0
        return True


@pytest.mark.parametrize("depends_on", ["path", "steps"])
def test_a_memory_is_committed_once_for_every_state(depends_on):
    """At rest too, and not by steps that fail: here one in two does at first."""
    ply = plain(OnePoint())
    term = FormTerm("drag", DRAG, ply.basis, memory=Count(ply.basis))
    term.memory.depends_on = depends_on
    ply = ply.with_terms(term)
    seen = []

    def see(state):
        seen.append(ply.memories["drag"].parameters["times"][0])

    refused = iter([True, False, True])

    class Moody(Mixed):
        def iterates(self, *arguments):
            if next(refused, False):
                raise NoEquilibriumError("not today")
            return super().iterates(*arguments)

    stepper = LoadStepper(ply, CONDITIONS, 4, strategies=[Moody()], on_step=see)
    result = stepper.run()
    assert result.steps_cut == 2
    assert seen == list(range(1, len(result.states)))


def test_what_a_ply_remembered_stays_what_it_was():
    ply = plain(OnePoint())
    ply = ply.with_terms(FormTerm("drag", DRAG, ply.basis, memory=Count(ply.basis)))
    before = ply.remembered
    for seed in (1, 2):
        ply.remembered = before
        ply.commit(wobble(ply, seed))
        assert not before["drag"][0]["last"].any()


def test_terms_of_a_ply_cannot_be_changed_behind_its_back():
    ply = plain()
    with pytest.raises(AttributeError):
        ply.terms = ()
    with pytest.raises(AttributeError):
        ply.terms.append(None)


def test_plies_with_and_without_a_term_remember_apart():
    ply = plain(OnePoint())
    sprung = ply.with_terms(FormTerm("springs", SPRINGS, ply.basis))
    before = ply.memories["stabilisation"].parameters["C_s"].copy()
    sprung.commit(0.05 * wobble(ply, 1))
    np.testing.assert_array_equal(
        ply.memories["stabilisation"].parameters["C_s"], before
    )


def test_a_run_knows_all_terms_and_their_roles(tmp_path):
    ply = plain(Full())
    force = np.zeros(ply.basis.N)
    force[1::2] = 1e-3
    terms = (
        FormTerm("springs", SPRINGS, BASES["a boundary"](ply.mesh)),
        FormTerm("held", SPRINGS, ply.basis, role="stabilisation"),
        VectorTerm("lift", force),
    )
    loaded = ply.with_terms(*terms)
    whole = LoadStepper(loaded, CONDITIONS, 4).run()
    state = whole.states[-1]
    assert list(state.potentials) == ["lift"]
    assert {"springs", "held"} < set(state.energies)
    summary = whole.summary()
    assert summary["springs_energy"] == state.energies["springs"]
    assert summary["lift_potential"] == pytest.approx(-force @ state.u)
    inside = sum(state.energies.values())
    assert summary["energy"] == pytest.approx(inside)

    def stop(state):
        if state.load_factor > 0.4:
            raise KeyboardInterrupt

    stepper = LoadStepper(loaded, CONDITIONS, 4, checkpoint=tmp_path, on_step=stop)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    resumed = LoadStepper(loaded, CONDITIONS, 4, checkpoint=tmp_path).run(resume=True)
    np.testing.assert_array_equal(resumed.u, whole.u)
    assert resumed.states[-1].potentials == state.potentials
    with pytest.raises(ValueError, match="is of another run"):
        LoadStepper(ply, CONDITIONS, 4, checkpoint=tmp_path).run(resume=True)
