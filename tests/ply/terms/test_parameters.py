"""Parameters of terms: immutable values, which plies do not hold."""

import pickle
from copy import deepcopy

import numpy as np
import pytest

from skfem_textile import (
    FormTerm,
    LoadStepper,
    Macro,
    MatrixTerm,
    Newton,
    OnePoint,
    Quadratic,
    Values,
)
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers import wobble
from tests.helpers.sprung_plies import CONDITIONS, SPRINGS, Spring, drag, plain

WITH_PARAMETERS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "rate": OnePoint(1.0, "rate"),
    "mean": Quadratic(80.0),
}
every_formulation = pytest.mark.parametrize(
    "formulation", WITH_PARAMETERS.values(), ids=WITH_PARAMETERS
)


def copied(parameters):
    """The arrays of parameters, by names of term and value."""
    return {
        (term, name): array.copy()
        for term, values in parameters.items()
        for name, array in values.items()
    }


def assert_unchanged(parameters, before):
    now = copied(parameters)
    assert now.keys() == before.keys()
    for key, array in before.items():
        np.testing.assert_array_equal(now[key], array)


@pytest.mark.parametrize("role", ["internal", "load"])
def test_plies_that_share_a_term_do_not_influence_each_other(role):
    ply = plain()
    term = drag(ply, role=role)
    first, u = ply.with_terms(term), wobble(ply, 1)
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


def test_plies_with_and_without_a_term_have_the_same_parameters():
    ply = plain(OnePoint())
    sprung, u = ply.with_terms(FormTerm("springs", SPRINGS, ply.basis)), wobble(ply, 1)
    before = copied(ply.parameters_at_rest)
    updated = sprung.updated(sprung.parameters_at_rest, 0.05 * u)
    assert_unchanged(ply.parameters_at_rest, before)
    energies = [each.energies(u, 1.0, updated) for each in (ply, sprung)]
    assert energies[0]["stabilisation"] == energies[1]["stabilisation"]


@every_formulation
def test_updates_return_new_values_and_change_nothing(formulation):
    ply = plain(formulation)
    ply = ply.with_terms(drag(ply))
    rest = ply.parameters_at_rest
    before = copied(rest)
    u, v = wobble(ply, 1), wobble(ply, 2)
    updated, advanced = ply.updated(rest, u), ply.advanced(rest, u)
    assert advanced is not rest
    assert (updated is not rest) == (formulation != OnePoint(1.0, "rate"))
    seen = copied(updated), copied(advanced)
    ply.advanced(ply.updated(advanced, v), v)
    assert_unchanged(rest, before)
    assert_unchanged(updated, seen[0])
    assert_unchanged(advanced, seen[1])
    assert ply.parameters_at_rest is rest


@every_formulation
def test_parameters_without_a_change_are_returned_as_they_are(formulation):
    ply = plain(formulation)
    rest, u = ply.parameters_at_rest, wobble(ply, 1)
    assert ply.updated(rest, ply.basis.zeros()) is rest
    updated = ply.updated(rest, u)
    assert ply.updated(updated, u) is updated
    again = ply.advanced(updated, u)
    assert (again is updated) == (formulation != OnePoint(1.0, "rate"))


@every_formulation
def test_parameters_cannot_be_changed_in_place(formulation):
    ply = plain(formulation)
    ply = ply.with_terms(drag(ply))
    rest, u = ply.parameters_at_rest, wobble(ply, 1)
    for parameters in (rest, ply.updated(rest, u), ply.advanced(rest, u)):
        for term, values in parameters.items():
            with pytest.raises(TypeError, match="item assignment"):
                parameters[term] = values
            for name, array in values.items():
                with pytest.raises(TypeError, match="item assignment"):
                    values[name] = array
                with pytest.raises(ValueError, match="read-only"):
                    array[...] = 0.0


def test_values_are_copies_of_arrays_that_can_be_changed():
    array = np.zeros(3)
    values = Values({"last": array})
    array += 1.0
    assert not values["last"].any()
    assert Values({"last": values["last"]})["last"] is values["last"]


@pytest.mark.parametrize("copy", [deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copied_parameters_are_equal(copy):
    ply = plain(Macro())
    parameters = ply.updated(ply.parameters_at_rest, wobble(ply, 1))
    assert_unchanged(copy(parameters), copied(parameters))


@pytest.mark.parametrize("depends_on_steps", [False, True])
def test_parameters_are_advanced_once_for_every_converged_state(depends_on_steps):
    """At rest too, and not by steps that fail: here one in two does at first."""
    ply = plain(OnePoint())
    ply = ply.with_terms(drag(ply, depends_on_steps))
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
def test_a_run_changes_nothing_in_a_ply(formulation):
    """Energies and forces at any parameters are the same before and after it."""
    ply = plain(formulation)
    ply = ply.with_terms(drag(ply))
    u, rest = wobble(ply, 1), ply.parameters_at_rest
    other = ply.updated(ply.advanced(rest, wobble(ply, 2)), wobble(ply, 2))

    def numbers():
        return [
            [ply.energy(u, t, p), ply.energies(u, t, p), ply.residual(u, t, p).tolist()]
            for t in (0.0, 1.0)
            for p in (None, rest, other)
        ]

    before, held = numbers(), copied(rest)
    first = LoadStepper(ply, CONDITIONS, 2).run()
    assert numbers() == before
    assert ply.parameters_at_rest is rest
    assert_unchanged(rest, held)
    second = LoadStepper(ply, CONDITIONS, 2).run()
    np.testing.assert_array_equal(second.u, first.u)
    assert second.history() == first.history()


def test_a_ply_without_parameters_has_none():
    ply = plain()
    assert dict(ply.parameters_at_rest) == {}
    assert ply.advanced(ply.parameters_at_rest, wobble(ply, 1)) is (
        ply.parameters_at_rest
    )
