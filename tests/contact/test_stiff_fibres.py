"""Plies of stiff fibres between tools, slack or deep: they converge, in any steps."""

from functools import cache

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, Ply, Tool, drape
from skfem_textile.scenes import Case, hemisphere_forming
from skfem_textile.solve import newton


def formed(fabric, steps=1, **options):
    """Result of a hemisphere with fibres at 45°."""
    scene = hemisphere_forming("aligned", fibres=np.pi / 4, **options)
    stiffness, bending = fabric
    directions = scene.warp, scene.weft
    fabric = Fabric(stiffness, 0.1, *directions, bending=(bending, bending))
    return Case(scene=scene, fabric=fabric, steps=steps).run()


@cache
def slack(travel, bending=0.2):
    """Result of a ply without tension at its edges, and hardly any bending."""
    options = {"radius": 60.0, "size": (4, 4), "tension": 0.0}
    sides = {"width": 240.0, "height": 240.0}
    return formed((3e5, bending), travel=travel, **options, **sides)


@pytest.mark.dear("alone finds increments that may not stretch rotating fibres")
def test_a_slack_ply_is_formed_and_its_other_states_are_announced():
    """Without tension at its edges the ply wrinkles, in one of many ways.

    Increments may stretch rotating fibres for a while: if each has to decrease the
    energy, they are far shorter and more.
    """
    result = slack(26.0)
    assert result.converged
    assert result.states[-1].verdict.negative_pivots == 0
    assert not result.path_resolved
    assert result.linear_solves < 200


def test_near_the_equilibrium_every_increment_reduces_the_residual():
    """Increments determine the contact forces, which updates leave as they are."""
    scene = hemisphere_forming("aligned", size=(4, 4), travel=20.0)
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    state = Case(scene=scene, fabric=fabric, steps=1).run().states[-1]
    near = np.array([x for x in state.residuals if x < 1.0])
    assert len(near) >= 4
    assert (near[1:] < 0.2 * near[:-1]).all()


@pytest.mark.slow
def test_an_iteration_whose_energy_stays_high_returns_to_the_start(monkeypatch):
    """It continues from a displacement before, with an increment that descends.

    Where no halved increment does, the whole one is applied.
    """
    starts, descends, reached = [], [], []
    halved, moved = newton.Line.halved, newton.Problem.moved

    def recorded(line):
        du = halved(line)
        starts.append(line.at.u)
        descends.append(
            line.problem.energy(line.at.u + du, line.at.parameters) < line.energy
        )
        return du

    def recorded_move(problem, u, du):
        reached.append(moved(problem, u, du))
        return reached[-1]

    monkeypatch.setattr(newton, "_WATCHED", 1)
    monkeypatch.setattr(newton.Line, "halved", recorded)
    monkeypatch.setattr(newton.Problem, "moved", recorded_move)
    assert slack.__wrapped__(30.0).converged
    assert len(starts) > 5
    assert all(any(np.array_equal(u, x) for x in reached) for u in starts)
    assert np.mean(descends) > 0.9


def test_moving_edges_pull_a_ply_over_a_tool():
    """In one step, although the motion of the edges increases the energy."""
    mesh = MeshQuad().refined(2).translated((-0.5, -0.5)).scaled(100.0)
    ball = Tool(drape.Sphere(60.0, (0, 0, -60.5)), name="ball")
    fabric = Fabric(1e3, shear=0.1, bending=(1.0, 1.0))
    ply = Ply(mesh.with_defaults(), fabric, terms=[ball], dimension=3)
    down = (None, None, -10.0)
    edges = {name: Condition(name, down) for name in ("left", "right")}
    held = {"x": Condition("left", (0.0, None, None)), **edges}
    held["y"] = Condition("bottom", (None, 0.0, None))
    result = LoadStepper(ply, held, steps=1).run()
    assert result.states[-1].displacements["right"][2] == pytest.approx(-10.0)
    assert result.states[-1].reactions["ball"][2] > 0
    assert result.linear_solves < 100


def test_a_slack_ply_that_is_hardly_touched_converges():
    """Its free corners have almost no stiffness, and gaps have less."""
    result = slack(0.2, bending=0.15)
    assert result.converged
    assert len(result.states) == 2
    assert result.linear_solves < 100


@pytest.mark.slow
def test_stiff_fibres_have_the_same_state_in_any_steps():
    """The stiffnesses of macro-elements converge at the state, whatever its path."""
    options = {"radius": 43.2554, "fillet": 8.9256, "travel": 47.0892}
    sides = {"width": 180.689, "height": 180.689, "size": (4, 4), "tension": 1.0}
    fabric = 430064.0, 41.7925
    few, more = (formed(fabric, n, **options, **sides) for n in (3, 6))
    assert 1.0 not in few.unresolved
    off = few.ply.shear_angle(few.u) - more.ply.shear_angle(more.u)
    assert np.degrees(np.abs(off).max()) < 0.01
    force, again = (x.states[-1].reactions["punch"][2] for x in (few, more))
    assert force == pytest.approx(again, rel=2e-4)
