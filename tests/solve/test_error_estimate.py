"""The error estimate: its value, and cases without one."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Macro,
    MatrixTerm,
    OnePoint,
    Ply,
    Quadratic,
    Tabulated,
)
from skfem_textile.mesh.selection import with_named_nodes
from skfem_textile.scenes import bias_extension, picture_frame
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve import error_estimate
from tests.helpers import arguments_of

MACRO = Macro()
FORMULATIONS = [MACRO, OnePoint(), Full(), Quadratic(20.0)]


def pulled(kind="irregular", formulation=MACRO, across=6, E=1e5, shear=0.5):
    scene = bias_extension(kind, (across, 2 * across))
    ply = Ply(scene.mesh, Fabric(E, shear, scene.warp, scene.weft), formulation)
    return LoadStepper(ply, scene.conditions, 2).run()


@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
def test_the_estimate_is_near_the_error_of_the_load(kind):
    """The load on an aligned graded mesh: `studies/adaptive/reference.py`."""
    result, exact = pulled(kind), 43.214
    error = abs(result.states[-1].reactions["top"][1] / exact - 1)
    assert error > 0.005
    assert 0.5 < result.estimated_error.load / error < 3


def test_a_mesh_that_represents_the_answer_has_no_error():
    scene = picture_frame("irregular", (4, 4), shear_angle=0.6)
    ply = Ply(scene.mesh, Fabric(1e4, 0.5, scene.warp, scene.weft))
    estimate = LoadStepper(ply, scene.conditions, 4).run().estimated_error
    assert estimate.load < 1e-4
    assert estimate.shear_angle < 1e-3
    assert not estimate.reason


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
def test_every_formulation_has_an_estimate(formulation, kind):
    summary = pulled(kind, formulation, across=6).summary()
    assert 0 < summary["estimated_load_error"] < 2
    assert 0 < summary["estimated_shear_angle_error_deg"] < 20
    assert summary["error_estimate"] == "by a finer mesh"


def test_the_estimate_changes_neither_ply_nor_states():
    result = pulled(across=4)
    state, ply = result.states[-1], result.ply
    u, arguments = result.u.copy(), arguments_of(state)
    energies, forces = ply.energies(*arguments), ply.residual(*arguments)
    assert result.estimated_error is result.estimated_error
    assert result.states[-1] is state
    np.testing.assert_array_equal(result.u, u)
    assert ply.energies(*arguments) == state.energies == energies
    np.testing.assert_array_equal(ply.residual(*arguments), forces)


def test_a_rotated_problem_has_the_same_estimate():
    estimates = []
    for angle in (0.0, 0.5):
        scene = bias_extension("irregular", (4, 8)).rotated(angle)
        ply = Ply(scene.mesh, Fabric(1e4, 0.5, scene.warp, scene.weft))
        result = LoadStepper(ply, scene.conditions, 2).run()
        estimates.append(result.estimated_error.load)
    assert estimates[0] == pytest.approx(estimates[1], rel=1e-3)


def square(fabric=None, formulation=MACRO):
    return Ply(
        MeshQuad().refined(2).with_defaults(), fabric or Fabric(1e3, 1.0), formulation
    )


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
def test_the_finer_mesh_has_the_fabric_of_each_element_or_subdomain(formulation):
    """With the same fabric everywhere the estimate is that for one fabric."""
    mesh = MeshTri().refined(2).with_defaults()
    mesh = mesh.with_subdomains({"a": lambda x: x[0] < 0.5, "b": lambda x: x[0] >= 0.5})
    warp, weft = (1.0, 1.0), (-1.0, 1.0)
    one = Fabric(1e3, 1.0, warp, weft)
    each = Fabric(1e3, 1.0, np.tile([[1.0], [1.0]], mesh.nelements), weft)
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 0.05))}
    plain, *others = (
        LoadStepper(Ply(mesh, fabric, formulation), held, 1).run().estimated_error
        for fabric in (one, each, {"a": one, "b": one})
    )
    for other in others:
        assert other.load == pytest.approx(plain.load, rel=1e-6)


def test_the_estimate_under_loads_refers_to_their_work():
    ply = square(Fabric(1e3, 5.0, (1, 1), (-1, 1))).with_terms(Force("top", (0.0, 0.5)))
    result = LoadStepper(ply, {"clamp": Condition("bottom")}, 4).run()
    assert 0 < result.estimated_error.load < 0.2


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("numbers", "condition 'top' selects nodes by number"),
        ("names", "condition 'top' selects nodes by number"),
        ("term", "term 'springs' is tied to the mesh"),
        ("rate", "term 'stabilisation' depends on the number of load steps"),
        ("still", "no moving condition carries a load"),
        ("large", "the ply has more than 10 unknowns"),
    ],
)
def test_the_summary_explains_a_missing_estimate(case, reason, monkeypatch):
    ply = square(formulation=OnePoint(5.0, kind="rate") if case == "rate" else Macro())
    top, value = "top", (0.05, 0.0)
    if case == "numbers":
        top = np.flatnonzero(ply.nodes[1] == 1.0)
    elif case == "names":
        nodes = {"upper": np.flatnonzero(ply.users_mesh.p[1] == 1.0)}
        ply = Ply(with_named_nodes(ply.users_mesh, nodes), Fabric(1e3, 1.0), Full())
        top = "upper"
    elif case == "term":
        springs = MatrixTerm("springs", 1e-3 * ply.tangent(ply.basis.zeros()))
        ply = ply.with_terms(springs)
    elif case == "still":
        value = (0.0, 0.0)
    elif case == "large":
        monkeypatch.setattr(error_estimate, "MOST_UNKNOWNS", 10)
    held = {"bottom": Condition("bottom"), "top": Condition(top, value)}
    summary = LoadStepper(ply, held, 2).run().summary()
    assert summary["estimated_load_error"] is None
    assert summary["estimated_shear_angle_error_deg"] is None
    assert summary["error_estimate"].startswith(f"none: {reason}")


def test_pins_at_single_nodes_are_kept_on_the_finer_mesh():
    ply = square()
    (corner,) = np.flatnonzero((ply.nodes == 0).all(axis=0))
    held = {
        "pin": Condition([corner]),
        "left": Condition("left", 0.0, (1, 0)),
        "right": Condition("right", 0.01, (1, 0)),
    }
    assert LoadStepper(ply, held, 2).run().estimated_error.load is not None


def test_a_failed_estimate_is_not_replaced_by_an_earlier_state(monkeypatch):
    result = pulled(across=4)
    find = error_estimate._update

    def moved(step, *arguments):
        if step.problem.load_factor == 1.0:
            raise error_estimate.NoEquilibriumError("no")
        return find(step, *arguments)

    monkeypatch.setattr(error_estimate, "_update", moved)
    summary = result.summary()
    assert summary["estimated_load_error"] is None
    assert summary["estimated_shear_angle_error_deg"] is None
    assert summary["error_estimate"] == (
        "none: no state was found near this one on a finer mesh: no; compare with a "
        "run at half the element size"
    )


def test_the_end_of_a_law_on_a_finer_mesh_is_reported():
    """The message is not about an infinite tangent."""
    plain = pulled(across=4)
    end = 1.001 * np.abs(plain.ply.shear_angle(plain.states[-1].u)).max()
    law = Tabulated([0.0, end], [0.0, 0.5 * end], odd=True)
    summary = pulled(across=4, shear=law).summary()
    assert (
        "this state is outside the domain of a law there" in summary["error_estimate"]
    )


def test_increments_beyond_the_end_of_a_law_are_shortened():
    """The estimate is close to the change with half the element size."""
    angles, moments = np.radians([0, 20, 40, 50]), [0, 0.02, 0.12, 0.9]
    fabric = Fabric(7e3, Tabulated(angles, moments, odd=True), (1, 1), (-1, 1))
    ply = Ply(rectangle(50, 100, (6, 12), "delaunay"), fabric, MACRO)
    held = {"clamp": Condition("bottom"), "pull": Condition("top", (0.0, 15.5))}
    coarse, fine = (LoadStepper(p, held, 6).run() for p in (ply, ply.finer().ply))
    force, finer = (r.states[-1].reactions["pull"][1] for r in (coarse, fine))
    assert 0.5 < coarse.estimated_error.load / abs(force / finer - 1) < 3


def test_a_load_that_is_round_off_has_no_error():
    def there_and_back(X, t):
        return 0.05 * np.array([np.zeros(X.shape[1]), np.full(X.shape[1], t * (1 - t))])

    held = {"bottom": Condition("bottom"), "top": Condition("top", there_and_back)}
    ply = square(Fabric(1e3, 1.0, (1, 1), (-1, 1)))
    estimate = LoadStepper(ply, held, 4).run().estimated_error
    assert estimate.load is None
    assert estimate.reason == "no moving condition carries a load"


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (MemoryError(), "there is not enough memory for a finer mesh"),
        (IndexError("out of\nbounds"), "IndexError: out of"),
    ],
)
def test_a_failed_estimate_loses_no_run(error, reason, monkeypatch):
    def fails(*_):
        raise error

    result = pulled(across=4)
    monkeypatch.setattr(Ply, "finer", fails)
    assert result.summary()["error_estimate"] == f"none: {reason}"
