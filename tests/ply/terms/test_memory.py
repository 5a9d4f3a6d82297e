"""What plies remember of terms of one's own."""

import numpy as np
import pytest
from helpers import wobble
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import dot
from sprung_plies import CONDITIONS, SPRINGS, Drag, Spring, plain

from skfem_textile import Forms, FormTerm, LoadStepper, MatrixTerm, Mixed, OnePoint
from skfem_textile.solve.states import NoEquilibriumError

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


def test_plies_with_and_without_a_term_remember_apart():
    ply = plain(OnePoint())
    sprung = ply.with_terms(FormTerm("springs", SPRINGS, ply.basis))
    before = ply.memories["stabilisation"].parameters["C_s"].copy()
    sprung.commit(0.05 * wobble(ply, 1))
    np.testing.assert_array_equal(
        ply.memories["stabilisation"].parameters["C_s"], before
    )
