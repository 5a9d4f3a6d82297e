"""Laws with a pole, and tension and loads at rest, give no silent errors."""

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    StepError,
    Tabulated,
)
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes.elastica import hanging
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.newton import within_laws
from skfem_textile.solve.states import Equilibrium, NoEquilibriumError
from skfem_textile.solve.verdict import CHECKS, Trial
from tests.helpers import Locking, Pretensioned
from tests.helpers.tools import problem_of


def pulled(formulation, prepare, pull, law, steps, size=(2, 4), **options):
    mesh = prepare(rectangle(50, 100, size, "irregular"))
    ply = Ply(mesh, Fabric(1e4, law, (1, 1), (-1, 1)), formulation)
    held = {"clamp": Condition("bottom"), "pull": Condition("top", (0, pull))}
    return LoadStepper(ply, held, steps, **options)


SQUARE = MeshQuad().refined(1).with_defaults()
FORMULATIONS = {
    "full": (Full(), lambda mesh: mesh),
    "one point": (OnePoint(), lambda mesh: mesh),
    "macro": (Macro(), split),
    "quadratic": (Quadratic(20.0), cut),
}


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_locking_angle_is_never_exceeded(formulation):
    """9 mm are more than the cloth can shear: its fibres must stretch."""
    result = pulled(*FORMULATIONS[formulation], 9.0, Locking(0.5, 0.3), 2).run()
    assert_below(0.3, result)
    assert all(state.verdict.stable for state in result.states)


def assert_below(angle, result):
    for state in result.states:
        assert np.isfinite(list(state.energies.values())).all()
        assert np.abs(result.ply.shear_angle(state.u)).max() < angle


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        (
            False,
            r"shear angle is -.*°, and the domain of its law ends at 0° .*odd=True",
        ),
        (True, "and the domain of its law ends at 50°"),
    ],
)
def test_a_message_names_the_law_that_ends_and_its_argument(odd, message):
    shear = Tabulated(np.radians([0, 20, 40, 50]), [0, 0.02, 0.12, 0.9], odd=odd)
    stepper = pulled(*FORMULATIONS["macro"], 20.0, shear, 2, max_halvings=0)
    with pytest.raises(StepError, match=message) as caught:
        stepper.run()
    error = caught.value
    assert error.quantity == "shear_angle"
    angles = np.abs(error.result.ply.shear_angle(error.result.u)).max(axis=1)
    assert error.elements.size
    assert angles[error.elements].min() >= np.quantile(angles, 0.5)


@pytest.mark.parametrize(
    "method", [pytest.param("newton", marks=pytest.mark.slow), "plain"]
)
def test_no_method_accepts_an_infinite_energy(method):
    """The first increment alone passes the pole, and so would a whole step."""
    options = {"method": method, "max_halvings": 0}
    try:
        result = pulled(
            *FORMULATIONS["macro"], 8.0, Locking(0.5, 0.1), 1, **options
        ).run()
    except StepError as error:
        result = error.result
    assert_below(0.1, result)


SLIDE = {
    "left": Condition("left", direction=(1, 0)),
    "bottom": Condition("bottom", direction=(0, 1)),
}


def test_fibres_in_tension_at_rest_are_equilibrated_before_the_load():
    """The first state reports the residual of the initial 66.6 N."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 20, 5), np.linspace(0, 40, 9))
    fabric = Fabric((1e3, Pretensioned(1e3, 3.33)), 1.0)
    ply = Ply(mesh.with_defaults(), fabric, Full())
    assert np.abs(ply.residual(ply.basis.zeros())).max() > 1
    result = LoadStepper(ply, SLIDE, 1).run()
    first = result.states[0]
    assert first.load_factor == 0
    assert first.linear_solves > 0
    assert first.residuals[-1] <= first.tolerance
    # The weft is free, so that it shortens until T = 0.
    stretch = np.exp(-3.33 / 1e3)
    top = ply.nodal(first.u)[1, ply.nodes[1] == 40]
    np.testing.assert_allclose(top, 40 * (stretch - 1), rtol=1e-6)
    assert result.states[-1].residuals[-1] <= result.states[-1].tolerance


def test_displacements_prescribed_at_rest_are_applied():
    ply = Ply(SQUARE, Fabric(10.0, 1.0), Full())
    pull = Condition("top", lambda X, t: 0.1 + t * 0.1 + 0 * X[0], (0, 1))
    held = {"clamp": Condition("bottom"), "pull": pull}
    states = LoadStepper(ply, held, 1).run().states
    lifts = [ply.nodal(state.u)[1, ply.nodes[1] == 1] for state in states]
    np.testing.assert_allclose(lifts, [[0.1] * 3, [0.2] * 3])


def test_a_negative_energy_is_not_taken_for_artificial(caplog):
    """Relaxing fibres release energy: T₀ ε is negative."""
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(Pretensioned(1e3, 10.0), 1.0), OnePoint())
    top = Condition("top", -0.005, direction=(0, 1))
    result = LoadStepper(ply, SLIDE | {"top": top}, 1).run()
    assert result.history()[-1]["energy"] < 0
    assert result.path_resolved
    assert not caplog.records


class Measured(Pretensioned):
    """A law that is defined in a range, with values beyond it."""

    domain = (-0.02, 0.01)


def stretched(ply, strain):
    """Uniform stretch along x."""
    u = ply.basis.zeros()
    u[0::2] = ply.nodes[0] * np.expm1(strain)
    return u


def sheared(ply, angle):
    """Rotation of the fibres along y by the shear angle."""
    u = ply.basis.zeros()
    u[0::2] = ply.nodes[1] * np.sin(angle)
    u[1::2] = ply.nodes[1] * (np.cos(angle) - 1)
    return u


@pytest.mark.parametrize(
    ("fabric", "moved", "low", "high"),
    [
        (Fabric((Measured(1e3, 0.0), 1e3), 1.0), stretched, -0.02, 0.01),
        (Fabric(1e3, Measured(1e3, 0.0)), sheared, -0.02, 0.01),
        (Fabric(1e3, Locking(0.5, 0.3)), sheared, -0.3, 0.3),  # no domain is stated
    ],
)
def test_an_increment_ends_within_the_domain(fabric, moved, low, high):
    ply = Ply(SQUARE, fabric, Full())
    problem = problem_of(ply, {"clamp": Condition("bottom")}).at(1.0)
    zero, p = ply.basis.zeros(), ply.parameters_at_rest
    for end in (low, high):
        inside, outside = (moved(ply, share * end) for share in (0.99, 1.01))
        assert problem.in_domain(inside, p)
        np.testing.assert_array_equal(within_laws(problem, zero, inside, p), inside)
        with np.errstate(invalid="ignore"):
            assert not problem.in_domain(outside, p)
            halved = within_laws(problem, zero, outside, p)
        np.testing.assert_array_equal(halved, 0.5 * outside)


def test_no_law_is_evaluated_beyond_its_domain():
    ply = Ply(SQUARE, Fabric(Measured(1e3, 0.0), 1.0), Full())
    held = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 0.05))}
    with pytest.raises(StepError, match=r"of a law.* strain is 0\.01,") as caught:
        LoadStepper(ply, held, 5, max_halvings=2).run()
    assert caught.value.quantity in ("warp_strain", "weft_strain")
    problem, u = LoadStepper(ply, held, 1).problem.at(1.0), 0.05 * ply.nodes.T.ravel()
    p = ply.parameters_at_rest
    beyond = Equilibrium(u, problem.residual(u, p), p, (), 0.0)  # of another method
    with pytest.raises(NoEquilibriumError, match=r"outside its domain: .* 0\.01"):
        Trial.of(problem, beyond, None).apply_checks(CHECKS)
    gentle = held | {"pull": Condition("top", (0, 0.009))}
    assert LoadStepper(ply, gentle, 2).run().converged


def test_a_ply_that_buckles_at_rest_has_no_resolved_path():
    """Fibres in compression buckle sideways before any load."""
    mesh = rectangle(10, 20, (3, 6), "irregular")
    ply = Ply(mesh, Fabric((1e3, Pretensioned(1e3, -3.0)), 1.0), OnePoint())
    held = {"bottom": Condition("bottom"), "top": Condition("top")}
    result = LoadStepper(ply, held, 1).run()
    assert np.abs(result.states[0].u).max() > 0.1
    assert not result.path_resolved


def strip(fabric, formulation, weight, factor, **ends):
    """A strip on an irregular mesh, 32 element edges long after any split."""
    halves = 2 if isinstance(formulation, Macro) else 1
    size = 32 // halves, 2 // halves
    mesh = rectangle(100.0, 20.0, size, "irregular", 0.25, 1)
    load = BodyForce((0.0, 0.0, -weight), factor)
    return Ply(mesh, fabric, formulation, [load], dimension=3, fibre_ends=ends)


@pytest.mark.parametrize(
    ("formulation", "weight"),
    [(OnePoint(), 8.0), pytest.param(Macro(), 100.0, marks=pytest.mark.slow)],
)
def test_a_heavy_cantilever_hangs_down_under_a_weight_at_rest(formulation, weight):
    """On the path of the weight, not of a fallback method."""
    fabric = Fabric(1e4, 0.1, bending=(10.0, 10.0))
    per_area = weight * 10.0 / 100.0**3
    ply = strip(fabric, formulation, per_area, 1.0, left="clamped")
    result = LoadStepper(ply, {"left": Condition("left")}, 1).run()
    tip = ply.nodes[0] > 100.0 - 1e-9
    exact = hanging(weight)
    for state in result.states:
        x, _, z = ply.nodal(state.u)[:, tip].mean(axis=1) / 100.0
        error = np.hypot(1 + x - exact.x[-1], z - exact.z[-1])
        assert error < 3e-3
    assert [state.load_factor for state in result.states] == [0.0, 1.0]
    assert result.path_resolved
    assert result.linear_solves == sum(s.linear_solves for s in result.states)


@pytest.mark.parametrize(
    "formulation", [OnePoint(), Macro()], ids=["one point", "macro"]
)
def test_an_irregular_sheet_without_bending_stiffness_is_a_catenary(formulation):
    """The initial stiffness against its weight is zero to first order."""
    weight, span = 1e-3, 0.8
    ply = strip(Fabric(1e4, 1.0), formulation, weight, 1.0)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right", ((span - 1) * 100.0, 0.0, 0.0)),
    }
    result = LoadStepper(ply, conditions, 2).run()
    c = brentq(lambda c: 2 * c * np.sinh(span / 2 / c) - 1, 0.05, 10.0)
    sag = c * (np.cosh(span / 2 / c) - 1)
    pull = result.states[-1].reactions["right"][0] / (weight * 20.0 * 100.0)
    assert pull == pytest.approx(c, rel=0.01)
    assert -ply.nodal(result.u)[2].min() / 100.0 == pytest.approx(sag, rel=0.01)
    assert result.states[0].verdict.stable


def test_an_unsupported_weight_is_rejected_at_rest():
    fabric = Fabric(1e4, 0.1, bending=(10.0, 10.0))
    ply = strip(fabric, OnePoint(), 1e-4, 1.0)
    held = {"left": Condition("left", (0.0, 0.0, None))}
    with pytest.raises(StepError, match=r"at load factor 0: .*at rest"):
        LoadStepper(ply, held, 1).run()
