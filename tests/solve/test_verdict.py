import logging
from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    OnePoint,
    Ply,
    StepError,
    TensionOnly,
    Tool,
)
from skfem_textile.drape import Plane
from skfem_textile.scenes import strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.checkpoint import Replay
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY
from skfem_textile.solve.verdict import _discretisation_checks, _energy_checks
from tests.helpers import arguments_of
from tests.helpers.intervals import without_interval
from tests.helpers.pulled import pulled


def run(formulation, steps, mesh="irregular", E=1e4, G=0.0, size=None, **options):
    scene = strip(mesh, *[size] if size else [])
    ply = Ply(scene.mesh, Fabric(E, G), formulation)
    return LoadStepper(ply, scene.conditions, steps, **options).run()


def squeezed(**options):
    """Rods pushed together at their fixed ends: the straight state is in balance."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 0.1, 2))
    ply = Ply(mesh.with_defaults(), Fabric(100.0, 0.01), Full())
    ends = {"left": Condition("left"), "right": Condition("right", (-0.2, 0.0))}
    return LoadStepper(ply, ends, steps=1, **options)


def stiffness_of(result, scene):
    """Smallest eigenvalue of the tangent with a unit diagonal, densely."""
    free = LoadStepper(result.ply, scene.conditions).problem.constraints.free
    K = result.ply.tangent(*arguments_of(result.states[-1])).toarray()
    K = K[np.ix_(free, free)]
    return np.linalg.eigvalsh(K / np.sqrt(np.outer(K.diagonal(), K.diagonal())))[0]


def test_a_saddle_point_is_rejected_with_its_position():
    """Newton's method keeps a compressed rod straight beyond its buckling load."""
    text = r"unstable equilibrium: \d negative pivot"
    with pytest.raises(StepError, match=text) as error:
        squeezed(method="plain", max_halvings=0).run()
    assert error.value.elements.size
    assert error.value.result.states[-1].load_factor == 0.0


def test_a_check_may_be_changed_to_a_warning(caplog):
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        result = squeezed(method="plain", warn_only=["stability", "work"]).run()
    assert "load factor 1: unstable equilibrium" in caplog.text
    summary = without_interval(result).summary()
    assert summary["converged"]
    assert not summary["stable"]
    assert summary["negative_pivots"] > 0
    assert str(result).splitlines()[2].endswith("no")


@pytest.mark.parametrize(
    ("C_s", "steps"),
    [
        (1.0, 1),
        pytest.param(0.01, 8, marks=pytest.mark.slow),
        *(pytest.param(1.0, n, marks=pytest.mark.slow) for n in (10, 50, 100)),
    ],
)
def test_the_strip_ends_on_a_stable_state_from_any_number_of_steps(C_s, steps):
    """C_s = 1 has at least four equilibria, and not all are stable."""
    result = run(OnePoint(C_s), steps)
    assert result.states[-1].verdict.stable
    assert stiffness_of(result, strip()) > 0


@pytest.mark.parametrize(
    ("formulation", "most"),
    [
        (Full(), (8, 38)),
        (OnePoint(10.0), (30, 45)),  # indefinite in one step, and halved
    ],
)
def test_the_strip_takes_few_linear_solves(formulation, most):
    one, many = (run(formulation, steps) for steps in (1, 10))
    energies = [result.history()[-1]["energy"] for result in (one, many)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)
    assert one.linear_solves <= most[0]
    assert many.linear_solves <= most[1]


def test_stiff_fibres_do_not_change_the_shape():
    ends = [run(Full(), 1, E=E) for E in (1e6, 1e10)]
    change = np.abs(ends[1].u - ends[0].u).max()
    assert change < 1e-3 * np.abs(ends[0].u).max()


@pytest.mark.parametrize(
    ("steps", "E"),
    [
        (1, 1e10),
        *(
            pytest.param(n, E, marks=pytest.mark.slow)
            for n, E in [(1, 1e6), (5, 1e8), (20, 1e10)]
        ),
    ],
)
def test_stiff_fibres_with_shear_are_loaded_to_the_end(E, steps):
    size = (3, 6)
    result = run(OnePoint(5.0), steps, E=E, G=0.5, size=size)
    assert result.converged
    assert result.states[-1].verdict.stable
    assert stiffness_of(result, strip(size=size)) > 0
    assert result.ply.area_ratio(result.u, result.ply.fine_points).min() > 0


def test_an_element_that_folds_at_its_corner_is_named():
    """A corner of a square is pushed inwards and folds at 0.25.

    The element there keeps its area at its 2×2 points.
    """
    mesh = MeshQuad().refined(1)
    mesh = mesh.with_boundaries({"edge": mesh.boundary_facets()})
    pushed = Condition(
        "edge", lambda X, t: -0.3 * t * (X.sum(axis=0) == 2) * np.ones(X.shape)
    )
    ply = Ply(mesh, Fabric(10.0, 1.0), OnePoint(1.0))
    text = r"1 element\(s\) folded; the smallest det F is .*\(element \d\); try a large"
    with pytest.raises(StepError, match=text) as error:
        LoadStepper(ply, {"edge": pushed}, 4, max_halvings=3).run()
    (element,) = error.value.elements
    result = error.value.result
    nodes = result.ply.mesh.p[:, result.ply.mesh.t[:, element]]
    assert [1.0, 1.0] in nodes.T.tolist()
    assert 0 < result.states[-1].verdict.min_det_F < 0.08
    assert result.ply.area_ratio(result.u, result.ply.fine_points).min() > 0.1


@pytest.mark.parametrize(
    ("ends", "along", "family"),
    [(("bottom", "top"), (0.0, 2.0), "weft"), (("left", "right"), (2.0, 0.0), "warp")],
)
def test_torn_fibres_are_rejected_by_family(ends, along, family):
    mesh = MeshQuad().refined(1).with_defaults()
    clamp, pull = ends
    conditions = {"clamp": Condition(clamp), "pull": Condition(pull, along)}
    ply = Ply(mesh, Fabric(10.0, 1.0), Full())
    with pytest.raises(StepError, match="the fibre strain reaches 1") as error:
        LoadStepper(ply, conditions, 4, max_halvings=0).run()
    assert error.value.quantity == f"{family}_strain"
    torn = LoadStepper(ply, conditions, 4, warn_only=["strain", "stability"]).run()
    assert torn.states[-1].verdict.mesh_fibre_strain == pytest.approx(np.log(3))


def last_step(value):
    """The trial of the only step of a run."""
    stepper = LoadStepper(*pulled(value), 1)
    replay, states = Replay(stepper.problem), stepper.run().states
    replay.last, _ = replay.repeated(states[0])
    return replay.repeated(states[1])[0]


@pytest.mark.parametrize(("share", "fails"), [(0.009, False), (0.011, True)])
def test_a_jump_is_a_per_cent_of_the_work_and_corners_of_the_energy(share, fails):
    """The energy rises by more or less than the work of the forces at the ends."""
    trial = last_step(0.02)
    low, high = sorted(trial.works)
    total = sum(trial.energies.values())
    for rise in (high + share * high, low - share * high):
        start = replace(trial.start, energies={"tension": total - rise})
        checks = _energy_checks(replace(trial, start=start))
        assert ("work" in dict(checks)) == fails
    energies = {"tension": (1 - share) * total, "corners": share * total}
    checks = dict(_discretisation_checks(replace(trial, energies=energies)))
    assert ("corners" in checks) == fails
    if fails:
        assert "contributes 1% of the energy" in str(checks["corners"])


def test_stiffening_fibres_may_be_stretched_without_limit():
    class Stiffening:
        def energy(self, x):
            return 5 * (np.cosh(2 * x) - 1)

        def value(self, x):
            return 10 * np.sinh(2 * x)

        def tangent(self, x):
            return 20 * np.cosh(2 * x)

    stepper = LoadStepper(*pulled(2.0, tension=Stiffening()), 4)
    assert stepper.run().states[-1].verdict.stable


def test_smooth_paths_are_resolved(caplog):
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        assert run(Full(), 4, size=(4, 6)).path_resolved
        # No force and no energy except round-off:
        assert run(Full(), 4, "aligned", size=(4, 6)).path_resolved
    assert not caplog.records


def test_a_compressed_rod_buckles_and_its_path_is_not_resolved(caplog):
    """No symmetry of the mesh keeps it at the saddle point."""
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        result = squeezed().run()
    assert result.states[-1].verdict.stable
    assert result.states[-1].verdict.max_fibre_strain < 0.05
    assert np.abs(result.ply.nodal(result.u)[1]).max() > 0.1  # sideways
    assert not without_interval(result).summary()["path_resolved"]
    (message,) = caplog.messages
    assert "the path was not resolved at load factor 0.007812:" in message
    assert "another number of steps" in message


def test_round_off_of_the_energy_is_no_jump():
    """A ply that lies on a table under its weight, after it sank by 10 mm."""
    mesh = MeshQuad().refined(2).scaled(100.0).translated((-50, -50))
    table = Tool(Plane((0.0, 0.0, -10.0)), side=1, name="table")
    ply = Ply(
        *(mesh, Fabric(5.8e3, 2.0, bending=(23.0, 23.0)), OnePoint()),
        terms=[table, BodyForce((0.0, 0.0, -4.5e-9), factor=1.0)],
        dimension=3,
    )
    centre, aside = (int(np.hypot(mesh.p[0] - x, mesh.p[1]).argmin()) for x in (0, 25))
    held = {
        "centre": Condition([centre], (0.0, 0.0, None)),
        "turn": Condition([aside], (None, 0.0, None)),
    }
    result = LoadStepper(ply, held, 3).run()
    assert len(result.states) == 4
    assert not any("work" in state.warnings for state in result.states)


def slack(travel, size=(1, 2), **options):
    """A strip of 50 mm by 100 mm whose fibres, along its sides, are pushed together."""
    fabric = Fabric(TensionOnly(Linear(1e4)), 0.1)
    ply = Ply(rectangle(50, 100, size, "irregular"), fabric)
    conditions = {"clamp": Condition("bottom"), "push": Condition("top", (0, -travel))}
    return LoadStepper(ply, conditions, steps=4, **options)


def test_slack_fibres_that_fold_up_are_reported(caplog):
    """exp(-1) of 100 mm is left at a travel of 63 mm."""
    with caplog.at_level(logging.WARNING, logger="skfem_textile"):
        result = slack(60.0).run()
        assert "slack" not in caplog.text
        assert result.ply.law_strain(result.u).min() == pytest.approx(np.log(0.4), 0.02)
        result = slack(90.0).run()
    assert result.states[-1].verdict.max_fibre_strain > 2.2
    text = "slack fibres shorten to 0.32 of their length in 8 element(s)"
    assert text in caplog.text


def test_slack_fibres_that_fold_up_can_be_refused():
    others = [name for name in DEFAULT_WARN_ONLY if name != "slack"]
    with pytest.raises(StepError, match=r"slack fibres shorten to .* compression"):
        slack(90.0, warn_only=others, max_halvings=0).run()
