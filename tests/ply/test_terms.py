"""User-defined terms: contributions, parameters, and rejected definitions."""

import pickle
from copy import deepcopy
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import diags
from skfem import CellBasis, FacetBasis, InteriorFacetBasis, MeshQuad, asm

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    FormTerm,
    Full,
    LoadStepper,
    Macro,
    MatrixTerm,
    Newton,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    Term,
    VectorTerm,
    shear,
)
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers import assert_derivatives, defined, distorted, random_u
from tests.helpers.plies import CONDITIONS, ELEMENT, SPRINGS, Spring, drag_term, plain

# User-defined terms: energies, forces and tangent, and runs with them


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
    sprung, u = ply.with_terms(term), random_u(ply, 1)
    energy = sprung.energies(u, t)["springs"]
    assert energy > 0
    assert sprung.energy(u, t) == pytest.approx(ply.energy(u, t) + energy)
    more = sprung.residual(u, t) - ply.residual(u, t)
    np.testing.assert_allclose(more, term.residual(u, t), atol=1e-9)
    stiffer = sprung.tangent(u, t) - ply.tangent(u, t)
    np.testing.assert_allclose(stiffer @ u, more, atol=1e-9)  # springs are linear


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_ply_without_stiffness_carries_a_sheet_and_a_band_of_fabric(dimension):
    """A fabric on a subdomain, a sheet on all, and a second fabric on two elements."""
    parts = {"band": np.array([0, 3]), "bare": np.array([1, 2, 4, 5])}
    mesh = distorted(1).with_subdomains(parts)
    fabrics = {"band": Fabric(1e3, 0.5), "bare": Fabric(0.0)}
    ply = Ply(mesh, fabrics, OnePoint(), dimension=dimension)
    more = shear(Fabric(0.0, Sin2(2.0), warp=(2, 1)))
    some = ply.basis.with_elements(np.array([2, 5]))
    bonded = ply.with_terms(
        FormTerm("sheet", SPRINGS, CellBasis(ply.mesh, ply.basis.elem)),
        FormTerm("more", more, some),
    )
    assert bonded.terms[-1].kernel is not None
    u = random_u(ply, 1)
    assert_derivatives(bonded, u, random_u(ply, 2))
    expected = asm(defined(more).energy, some, u=u)
    assert bonded.energies(u)["more"] == pytest.approx(expected, rel=1e-12)
    away = np.setdiff1d(np.arange(ply.basis.N), ply.basis.element_dofs[:, [0, 3]])
    assert not ply.residual(u)[away].any()


@pytest.mark.parametrize("named", [False, True])
def test_a_user_defined_class_is_a_term(named):
    ply = plain()
    last = ply.nodes.shape[1] - 1
    couples = (np.array([[0], [last]]),) if named else None
    spring = Spring(ply.basis.N, couples)
    sprung, u = ply.with_terms(spring), random_u(ply, 1)
    K = (sprung.tangent(u) - ply.tangent(u)).toarray()
    np.testing.assert_allclose(K, spring.K.toarray(), atol=1e-9)
    matrix = ply.with_terms(MatrixTerm("spring", spring.K))
    assert abs(matrix.tangent(u) - sprung.tangent(u)).max() < 1e-9
    assert matrix.energy(u) == pytest.approx(sprung.energy(u))


def test_terms_of_a_ply_are_immutable():
    ply = plain()
    with pytest.raises(AttributeError):
        ply.terms = ()
    with pytest.raises(AttributeError):
        ply.terms.append(None)


def test_a_run_uses_all_terms_with_their_roles(tmp_path):
    ply = plain(Full())
    force = np.zeros(ply.basis.N)
    force[1::2] = 1e-3
    terms = (
        FormTerm("springs", SPRINGS, BASES["a boundary"](ply.mesh)),
        FormTerm("held", SPRINGS, ply.basis, role="stabilisation"),
        VectorTerm("lift", force),
    )
    loaded = ply.with_terms(*terms)
    whole = LoadStepper(loaded, CONDITIONS, 2).run()
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

    stepper = LoadStepper(loaded, CONDITIONS, 2, checkpoint=tmp_path, on_step=stop)
    with pytest.raises(KeyboardInterrupt):
        stepper.run()
    resumed = LoadStepper(loaded, CONDITIONS, 2, checkpoint=tmp_path).run(resume=True)
    np.testing.assert_array_equal(resumed.u, whole.u)
    assert resumed.states[-1].potentials == state.potentials
    with pytest.raises(ValueError, match="belongs to another run"):
        LoadStepper(ply, CONDITIONS, 2, checkpoint=tmp_path).run(resume=True)


# Parameters of terms: immutable values, which plies do not store


WITH_PARAMETERS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "rate": OnePoint(1.0, "rate"),
    "mean": Quadratic(80.0),
}
every_formulation = pytest.mark.parametrize(
    "formulation", WITH_PARAMETERS.values(), ids=WITH_PARAMETERS
)


@pytest.mark.parametrize("role", ["internal", "load"])
def test_plies_that_share_a_term_do_not_influence_each_other(role):
    ply = plain()
    term = drag_term(ply, role=role)
    first, u = ply.with_terms(term), random_u(ply, 1)
    advanced = first.advanced(first.parameters_at_rest, u)
    np.testing.assert_array_equal(advanced["drag"]["last"], u)
    assert LoadStepper(first, CONDITIONS, 2).run().converged
    for second in (
        first,
        first.with_terms(MatrixTerm("none", 0 * Spring(ply.basis.N).K)),
        ply.with_terms(term),
    ):
        assert not second.parameters_at_rest["drag"]["last"].any()
        assert second.energies(u)["drag"] == first.energies(u)["drag"]
        assert second.energies(u, 1.0, advanced)["drag"] == 0.0


@every_formulation
def test_updates_return_new_values_unless_nothing_changes(formulation):
    ply = plain(formulation)
    ply = ply.with_terms(drag_term(ply))
    rest, u = ply.parameters_at_rest, random_u(ply, 1)
    updated = ply.updated(rest, u)
    assert ply.advanced(rest, u) is not rest
    has_rates = formulation == OnePoint(1.0, "rate")
    assert (updated is not rest) != has_rates
    assert ply.updated(updated, u) is updated
    assert ply.parameters_at_rest is rest


@every_formulation
def test_parameters_cannot_be_changed_in_place(formulation):
    ply = plain(formulation)
    ply = ply.with_terms(drag_term(ply))
    rest, u = ply.parameters_at_rest, random_u(ply, 1)
    for parameters in (rest, ply.updated(rest, u), ply.advanced(rest, u)):
        for term, values in parameters.items():
            with pytest.raises(TypeError, match="item assignment"):
                parameters[term] = values
            for name, array in values.items():
                with pytest.raises(TypeError, match="item assignment"):
                    values[name] = array
                with pytest.raises(ValueError, match="read-only"):
                    array[...] = 0.0


@pytest.mark.parametrize("copy", [deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copied_parameters_are_equal(copy):
    ply = plain(Macro())
    parameters = ply.updated(ply.parameters_at_rest, random_u(ply, 1))
    copied = copy(parameters)
    assert copied.keys() == parameters.keys()
    assert all(copied[name].same_as(values) for name, values in parameters.items())


@pytest.mark.parametrize("depends_on_steps", [False, True])
def test_parameters_are_advanced_once_for_every_converged_state(depends_on_steps):
    """Including the state at rest, but not for failing steps: one in two fails here."""
    ply = plain(OnePoint())
    ply = ply.with_terms(drag_term(ply, depends_on_steps))
    refused = iter([True, False, True])

    class Moody(Newton):
        def solve(self, *arguments):
            if next(refused, False):
                raise NoEquilibriumError("not today")
            return super().solve(*arguments)

    result = LoadStepper(ply, CONDITIONS, 4, method=Moody()).run()
    assert result.steps_cut == 2
    used = [state.parameters["drag"] for state in result.states]
    assert [p["times"][0] for p in used] == list(range(len(result.states)))
    for values, state in zip(used[1:], result.states[:-1], strict=True):
        np.testing.assert_array_equal(values["last"], state.u)


@every_formulation
def test_a_run_does_not_modify_a_ply(formulation):
    """Energies and forces at any parameters are the same before and after it."""
    ply = plain(formulation)
    ply = ply.with_terms(drag_term(ply))
    u, rest = random_u(ply, 1), ply.parameters_at_rest
    other = ply.updated(ply.advanced(rest, random_u(ply, 2)), random_u(ply, 2))

    def numbers():
        return [
            [ply.energy(u, t, p), ply.energies(u, t, p), ply.residual(u, t, p).tolist()]
            for t in (0.0, 1.0)
            for p in (None, rest, other)
        ]

    before = numbers()
    first = LoadStepper(ply, CONDITIONS, 1).run()
    assert numbers() == before
    assert ply.parameters_at_rest is rest
    second = LoadStepper(ply, CONDITIONS, 1).run()
    np.testing.assert_array_equal(second.u, first.u)
    assert second.history() == first.history()


# Further terms at the last state of a run


class LargeSpring(Term):
    """A foundation that is inconsistent beyond 1 mm."""

    role, name = "internal", "spring"

    def __init__(self, energy=1.0, force=1.0, curl=0.0):
        self.energy_factor, self.force_factor, self.curl = energy, force, curl

    def energy(self, u, t, p):
        return 0.005 * float(u @ u) * (self.energy_factor if self._far(u) else 1.0)

    def residual(self, u, t, p):
        f = 0.01 * u
        if self._far(u):
            f = self.force_factor * f + self.curl * (np.roll(u, 1) - np.roll(u, -1))
        return f

    def tangent(self, u, t, p):
        return diags(np.full(len(u), 0.01)).tocsr()

    def _far(self, u):
        return np.abs(u).max() > 1


@pytest.mark.parametrize(
    ("spring", "part"),
    [
        (LargeSpring(), ""),
        (LargeSpring(energy=2.0), "energy"),
        (LargeSpring(force=3.0), "energy"),
        (LargeSpring(curl=0.02), "energy"),
        (LargeSpring(energy=3.0, force=3.0), "residual"),
    ],
)
def test_terms_are_checked_at_the_last_state(spring, part, caplog):
    mesh = MeshQuad.init_tensor(np.linspace(0, 30, 3), np.linspace(0, 60, 5))
    ply = Ply(mesh.with_defaults(), Fabric(2e3, 0.3, (1, 1), (-1, 1)), terms=[spring])
    ends = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 5.0))}
    result = LoadStepper(ply, ends, 1).run()
    last = [x for x in result.warnings if x.startswith("at load factor 1, term 'spr")]
    assert bool(last) == bool(part)
    assert all(f"its {part} changes by" in x and x in caplog.text for x in last)
    assert result.summary().get("warnings", []) == result.warnings


def test_terms_of_the_package_are_not_evaluated_again(monkeypatch):
    ply = Ply(MeshQuad().refined(1), Fabric(1e4), terms=[BodyForce((0.0, 1.0))])
    monkeypatch.setattr(type(ply.further_terms[0]), "energy", None)
    at_rest = SimpleNamespace(
        u=ply.basis.zeros(), load_factor=1.0, parameters=ply.parameters_at_rest
    )
    assert ply.contradictions([at_rest]) == []
