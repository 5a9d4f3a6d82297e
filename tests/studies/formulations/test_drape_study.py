"""The study of drapes: surfaces, outcomes and parts."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import drape
from studies.formulations.drape import chebyshev
from studies.formulations.drape import extremes as judging
from studies.formulations.drape.cases import FLAT, FORMULATIONS
from studies.formulations.drape.extremes import (
    SURFACES,
    Drape,
    Extreme,
    Mirrored,
    draped,
)

ON_SPHERE = Extreme("", "sphere", False, cells=4)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", SURFACES)
def test_derivatives_of_surfaces_agree_with_differences(name, mirrored):
    surface = Mirrored(SURFACES[name]) if mirrored else SURFACES[name]
    x, h = np.random.default_rng(0).uniform(5, 60, (3, 4)), 1e-5
    steps = h * np.eye(3)[:, :, None]
    slope, bend = (
        np.array([(f(x + s) - f(x - s)) / (2 * h) for s in steps])
        for f in (surface.level, surface.gradient)
    )
    np.testing.assert_allclose(surface.gradient(x), slope, atol=1e-7)
    np.testing.assert_allclose(surface.hessian(x), bend.swapaxes(0, 1), atol=1e-7)
    assert surface.level(np.zeros((3, 1))) == pytest.approx(0)


def test_an_accurate_drape_and_its_mirror_image_are_right():
    row = judging.judged(replace(ON_SPHERE, mirrored=True))
    assert row["outcome"] == judging.RIGHT
    assert row["off_mirror"] < 1e-6


def test_states_out_of_equilibrium_are_wrong(monkeypatch):
    """The initial guess along geodesics, and a slightly moved state, are wrong."""
    right = draped(ON_SPHERE)
    x = drape.exponential_map(right.surface, right.ply.nodes)
    start = replace(right.state, u=drape.displacement(right.ply.nodes, x))
    turned = right.positions + 1e-3 * np.sin(right.positions / 20)
    moved = judging.onto(right.surface, turned)
    moved = replace(right.state, u=drape.displacement(right.ply.nodes, moved))
    for state in (start, moved):
        wrong = Drape(right.ply, right.conditions, right.surface, state)
        monkeypatch.setattr(judging, "draped", lambda *_, wrong=wrong, **__: wrong)
        monkeypatch.setattr(judging, "_against_finer", lambda *_: {})
        row = judging.judged(ON_SPHERE)
        assert row["outcome"] == judging.WRONG
        assert "no stable equilibrium" in row["reason"]


def test_a_drape_that_differs_from_the_net_is_wrong_unless_reported(monkeypatch):
    monkeypatch.setattr(judging, "_against_net", lambda *_: {"off_net": 30.0})
    monkeypatch.setattr(judging, "_warnings", lambda *_: "")
    row = judging.judged(ON_SPHERE)
    assert row["outcome"] == judging.WRONG
    assert "differs from the net by 30.0°" in row["reason"]
    monkeypatch.setattr(judging, "_warnings", lambda *_: "wrinkles")
    assert judging.judged(ON_SPHERE)["outcome"] == judging.TOLD


def test_macro_elements_without_stabilisation_out_of_plane_differ_by_that_alone():
    ply, *_ = chebyshev.problem(FORMULATIONS[FLAT], 2)
    whole, *_ = chebyshev.problem(FORMULATIONS["macro"], 2)
    assert {*whole.roles} - {*ply.roles} == {"out_of_plane"}
    assert {*ply.roles} < {*whole.roles}
