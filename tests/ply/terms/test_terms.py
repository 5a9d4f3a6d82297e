"""Terms of one's own: energies, forces and tangent, and runs with them."""

import numpy as np
import pytest
from skfem import CellBasis, FacetBasis, InteriorFacetBasis

from skfem_textile import (
    Fabric,
    FormTerm,
    Full,
    LoadStepper,
    MatrixTerm,
    Ply,
    Quadratic,
    Sin2,
    VectorTerm,
    forms,
)
from skfem_textile.mesh.splitting import cut
from skfem_textile.ply.kernels.kernel import ShearKernel
from tests.helpers import derivative, distorted, wobble
from tests.helpers.sprung_plies import CONDITIONS, ELEMENT, SPRINGS, Spring, plain

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


def test_terms_of_a_ply_cannot_be_changed_behind_its_back():
    ply = plain()
    with pytest.raises(AttributeError):
        ply.terms = ()
    with pytest.raises(AttributeError):
        ply.terms.append(None)


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
