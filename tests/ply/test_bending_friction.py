"""Bending laws with friction: derivatives, loops, and strips that are let go."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Bilinear,
    Condition,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    OnePoint,
    Ply,
    Polynomial,
    Programme,
    Quadratic,
    WithFriction,
)
from tests.helpers import assert_derivatives, distorted_for, random_u

LENGTH, WIDTH = 100.0, 5.0
FULL = Full()
FRICTION = [0.02, 0.05], [0.002, 0.01]
LAW = WithFriction(Linear(6.0), *FRICTION)
KNEE = WithFriction(Bilinear(6.0, 0.01, 2.0), *FRICTION)
ONE_SIDED = WithFriction(Polynomial((6.0, 20.0, 500.0)), *FRICTION)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("formulation", [Full(), Quadratic()], ids=lambda x: x.name)
@pytest.mark.parametrize("law", [KNEE, ONE_SIDED], ids=["symmetric", "one-sided"])
def test_residual_and_tangent_are_derivatives_after_slip(law, formulation, dimension):
    mesh = distorted_for(formulation, 1).with_defaults()
    fabric = Fabric(1e3, 1.0, (2, 1), (-1, 3), bending=(law, 2.0))
    ply = Ply(mesh, fabric, formulation, dimension=dimension)
    p = ply.advanced(ply.parameters_at_rest, random_u(ply, 1, 0.1))
    u = random_u(ply, 2, 0.1)
    assert ply.energy_lost(u, 1.0, p)["bending"] > 0
    (term,) = (x for x in ply.terms if x.name == "bending")
    assert ply.energy(u, 1.0, p, [term]) != ply.energy(u, 1.0, None, [term])
    assert_derivatives(ply, u, random_u(ply, 3, 0.1), p, 5e-7, rel=1e-5)


def strip_of(law, dimension=3, n=16, formulation=FULL):
    """A strip along x whose warp has a bending law."""
    mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, n + 1), np.array([0, WIDTH]))
    fabric = Fabric(1e4, 1.0, bending=(law, 0.0))
    ends = {"left": "clamped"} if dimension == 3 else {}
    mesh = mesh.with_defaults()
    return Ply(mesh, fabric, formulation, dimension=dimension, fibre_ends=ends)


def lifted(ply, kappa):
    """Displacement of the strip onto a parabola of the curvature κ at its clamp."""
    x, _ = ply.nodes
    u = np.zeros((3, x.size))
    u[2] = 0.5 * kappa * x**2
    return u.T.ravel()


def test_energy_lost_in_bending_is_the_area_of_the_loop():
    ply, n, peak = strip_of(KNEE), 60, 0.03
    there = np.linspace(0.0, peak, n + 1)
    path = np.concatenate([there, there[-2::-1], -there[1:], -there[-2::-1], there[1:]])
    (term,) = (x for x in ply.terms if x.name == "bending")
    p, work, lost = ply.parameters_at_rest, [], []
    for kappa in path:
        u, rate = lifted(ply, kappa), lifted(ply, 1.0)
        work.append(ply.residual(u, 1.0, p, [term]) @ rate)
        lost.append(ply.energy_lost(u, 1.0, p)["bending"])
        p = ply.advanced(p, u)
    area = np.trapezoid(work[n:], path[n:])
    assert lost[-1] - lost[n] == pytest.approx(area, rel=1e-3)


def bent(law, levels, steps, until=1.0, **others):
    """Load stepper of a clamped strip whose end is lifted through levels."""
    ply = strip_of(law)
    conditions = {
        "left": Condition("left"),
        "side": Condition("bottom", (None, 0.0, None)),
        "right": Condition(
            "right", (None, None, 20.0), factor=Programme(levels), until=until
        ),
    }
    return LoadStepper(ply, conditions, steps * len(levels), **others)


def test_a_strip_that_is_let_go_is_flat_without_friction_only():
    tips = []
    for law in KNEE.law, KNEE:
        states = bent(law, [1.0, 1.0], 4, until=0.5).run().states
        assert states[4].displacements["right"][2] == pytest.approx(20.0)
        tips.append(states[-1].displacements["right"][2])
    flat, left = tips
    assert abs(flat) < 1e-6 * LENGTH
    assert left > 1.0


class Killed(BaseException):
    """Ends a run like a signal."""


def test_a_killed_run_resumes_bit_for_bit(tmp_path):
    def kill(state):
        if state.load_factor > 0.6:
            raise Killed

    whole = bent(LAW, [1.0, -0.3], 3).run()
    with pytest.raises(Killed):
        bent(LAW, [1.0, -0.3], 3, checkpoint=tmp_path / "run", on_step=kill).run()
    again = bent(LAW, [1.0, -0.3], 3, checkpoint=tmp_path / "run").run(resume=True)
    for one, other in zip(whole.states, again.states, strict=True):
        assert np.array_equal(one.u, other.u)
        assert one.energy_lost == other.energy_lost
        p = other.parameters["bending"]
        assert one.parameters["bending"].same_as(p)


def test_friction_of_regions_acts_where_it_is():
    mesh = strip_of(6.0).mesh.with_subdomains(
        {"near": np.arange(8), "far": np.arange(8, 16)}
    )
    fabrics = {"near": Fabric(1e4, 1.0, bending=(LAW, 0.0)), "far": Fabric(1e4, 1.0)}
    ply = Ply(mesh, fabrics, OnePoint(), dimension=3)
    slip = ply.advanced(ply.parameters_at_rest, lifted(ply, 0.02))["bending"]
    assert slip["warp slip"].any(axis=(0, 2))[:7].all()
    everywhere = strip_of(LAW, formulation=OnePoint())
    u = lifted(ply, 0.02)
    whole, near = (x.energy_lost(u)["bending"] for x in (everywhere, ply))
    assert 0.5 * whole < near < 0.8 * whole
