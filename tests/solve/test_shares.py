"""Artificial fractions of energy, work and reactions, and their reports.

The limits in `skfem_textile.solve.verdict` are a tenth of energy and work, and a
quarter of the nodal forces of a reaction.
"""

from functools import cache

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    LoadStepper,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    Sin2,
    drape,
    equilibrium_near,
)
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes import Case, bias_extension, strip, trellis
from skfem_textile.scenes.trellis import picture_frame
from tests.helpers import derivative, random_u
from tests.helpers.intervals import without_interval

# Elements across, before quadrilaterals of macro-elements are split in four, and how
# they are generated from the quadrilaterals of a scene.
FORMULATIONS = {
    "one": (OnePoint(), 1, lambda mesh: mesh),
    "macro": (Macro(), 2, split),
    "macro triangles": (Macro(), 2, lambda mesh: split(cut(mesh))),
    "mean": (Quadratic(80.0), 1, cut),
}

SCENES = {bias_extension: 2, strip: 1.5, trellis: 1, picture_frame: 1}


def case(scene, name, across=16, E=1e4, G=0.5, formulation=None, steps=1):
    """A scene with so many elements along its short side."""
    settings, parts, made = FORMULATIONS[name]
    size = across // parts, round(SCENES[scene] * across) // parts
    specimen = scene(made(scene(size=size).mesh))
    fabric = Fabric(E, G, specimen.warp, specimen.weft)
    formulation = formulation or settings
    return Case(scene=specimen, fabric=fabric, formulation=formulation, steps=steps)


def reported(caplog):
    return [r.getMessage() for r in caplog.records if " contribut" in r.getMessage()]


def largest(result, of):
    return max(max(state.shares[of].values()) for state in result.states)


def energy_of_deviations(ply, u, E_d, points):
    """Σ ½ E_d (λ − λ̄)² A, λ̄ the mean over the points of an element of the stiffness.

    ``points`` has for each element of ``E_d``, shape (2, n, 1), the indices of its
    points in the ply, numbered element by element.
    """
    stretch, area = np.exp(ply.fibre_strain(u)).reshape(2, -1), ply.basis.dx.ravel()
    energy = 0.0
    for k, members in enumerate(points):
        mean = np.average(stretch[:, members], axis=1, weights=area[members])
        error = (stretch[:, members] - mean[:, None]) ** 2 @ area[members]
        energy += 0.5 * E_d[:, k, 0] @ error
    return energy


@pytest.mark.parametrize("name", ["macro", "macro triangles", "mean"])
def test_the_deviation_is_the_part_of_the_tension_that_E_d_scales(name):
    """Energy and forces, against sums over the points of the ply."""
    ply = case(trellis, name, 4, E=1e6, G=Sin2(0.5)).ply()
    parameters = ply.updated(ply.parameters_at_rest, random_u(ply, 1))
    u, du = random_u(ply, 2), random_u(ply, 3, 1.0)
    deviations = [p for p in ply.parts(u, 1.0, parameters) if p.role == "deviation"]
    ((_, energy, forces),) = deviations
    E_d = parameters["tension"]["E_d"]
    assert np.ptp(E_d) > 1.0
    n_points = ply.basis.dx.shape[1]
    element = np.arange(ply.basis.dx.size) // n_points
    whole = ply.mesh.parent[element] if name != "mean" else element
    points = [np.flatnonzero(whole == k) for k in range(E_d.shape[1])]

    def expected(x):
        return energy_of_deviations(ply, x, E_d, points)

    assert energy == pytest.approx(expected(u), rel=1e-9)
    assert forces @ du == pytest.approx(derivative(expected, u, du, 1e-6), rel=1e-6)


@pytest.mark.parametrize("name", FORMULATIONS)
def test_parts_add_up_to_energy_and_forces(name):
    ply = case(trellis, name, 4).ply()
    parameters = ply.updated(ply.parameters_at_rest, random_u(ply, 1))
    arguments = random_u(ply, 2), 1.0, parameters
    roles, energies, forces = zip(*ply.parts(*arguments), strict=True)
    assert sum(energies) == pytest.approx(ply.energy(*arguments), rel=1e-12)
    error = sum(forces) - ply.residual(*arguments)
    assert np.abs(error).max() < 1e-12 * max(np.abs(f).max() for f in forces)
    assert ("deviation" in roles) == (name != "one")
    assert ("stabilisation" in roles) == (name != "mean")


@pytest.mark.parametrize(
    ("across", "E", "share"),
    [
        (8, 1e4, 0.09),
        *(pytest.param(16, E, 0.06, marks=pytest.mark.slow) for E in (1e2, 1e8)),
    ],
)
@pytest.mark.parametrize("name", FORMULATIONS)
def test_ordinary_bias_extension_passes(caplog, name, across, E, share):
    result = case(bias_extension, name, across, E=E).run()
    assert not reported(caplog)
    assert 0.005 < largest(result, "energy") < share
    assert largest(result, "work") < share
    assert largest(result, "top_reaction") < 0.2


@pytest.mark.parametrize("name", FORMULATIONS)
@pytest.mark.parametrize("scene", [strip, trellis])
def test_ordinary_runs_of_other_scenes_pass(caplog, scene, name):
    result = case(scene, name, 8, steps=1).run()
    assert not reported(caplog)
    for of in result.states[-1].shares:
        assert largest(result, of) < (0.2 if "reaction" in of else 0.06)


@cache
def fine_load(name):
    """Of a bias extension with 12 elements across, over the exact load."""
    fine = case(bias_extension, name, 12)
    return fine.summary(without_interval(fine.run()))["load_over_exact"]


@pytest.mark.parametrize(
    ("name", "formulation"),
    [("one", lambda k: OnePoint(4.0 * k)), ("mean", lambda k: Quadratic(100.0 * k))],
)
@pytest.mark.parametrize("times", [1, 3, 30])
def test_a_tenth_of_the_energy_is_a_tenth_of_the_load(caplog, name, formulation, times):
    """With increasing stiffness the load rises by no less than the share."""
    wrong = case(bias_extension, name, 8, formulation=formulation(times))
    load = wrong.summary(without_interval(wrong.run()))["load_over_exact"]
    too_much = load / fine_load(name) - 1
    warned = bool(reported(caplog))
    assert warned == (times > 1)
    assert warned == (too_much > 0.1)


@pytest.mark.parametrize(
    "name",
    ["one", "macro", pytest.param("macro triangles", marks=pytest.mark.slow), "mean"],
)
def test_the_artificial_share_without_shear_stiffness_is_nearly_one(caplog, name):
    """No fabric term resists: 58° instead of the prescribed 40°."""
    this = case(bias_extension, name, 8, G=0.0, steps=3)
    summary = this.summary(without_interval(this.run()))
    role = "deviation" if name == "mean" else "stabilisation"
    assert summary["converged"]
    assert summary["max_shear_angle_deg"] > 50
    assert summary[f"energy_share_of_{role}"] > 0.8
    assert summary[f"work_share_of_{role}"] > 0.7
    assert "% of energy" in reported(caplog)[0]
    assert reported(caplog)[0].endswith(
        "the fabric has no shear stiffness, so specify one"
    )


@pytest.mark.parametrize("name", FORMULATIONS)
def test_the_artificial_share_of_a_homogeneous_state_is_zero(caplog, name):
    """Without shear stiffness its energy and forces are round-off."""
    result = case(picture_frame, name, 16, G=0.0).run()
    assert not reported(caplog)
    for of in ("energy", "work"):
        assert largest(result, of) < 1e-4
    assert largest(result, "top_reaction") < 0.1


def test_reactions_due_to_stabilisation_are_reported(caplog):
    """One corner of a square is moved along the other family, which is soft."""
    mesh = MeshQuad().with_defaults()
    ply = Ply(mesh, Fabric((1e-3, 1e-3), 1e-3), OnePoint(10.0))
    conditions = {
        "others": Condition(lambda X: X.sum(axis=0) < 2),
        "corner": Condition(lambda X: X.sum(axis=0) == 2, (0.0, 0.1)),
    }
    result = LoadStepper(ply, conditions, 1).run()
    assert result.states[-1].shares["corner_reaction"]["stabilisation"] > 0.9
    assert "% of corner_reaction" in reported(caplog)[0]


def test_a_load_is_not_an_internal_part():
    ply = case(trellis, "macro", 4).ply()
    loaded, u = ply.with_terms(Force("top", (0.0, 1.0))), random_u(ply, 2)
    energies = [[part.energy for part in each.parts(u)] for each in (ply, loaded)]
    assert energies[0] == energies[1]


def held_at_a_node(refinements):
    """A ply of macro-elements on a torus, with two nodes fixed along it."""
    tool, c, s = drape.Torus(120.0, 50.0, (0, 0, -170), (0, 1, 0)), 0.956, 0.292
    fabric = Fabric(2e4, 0.2, (c, s), (-s, c), bending=(40.0, 60.0))
    mesh = MeshQuad().refined(refinements).translated((-0.5, -0.5)).scaled(80.0)
    ply = Ply(mesh, fabric, dimension=3)
    middle, side = (
        np.abs(ply.nodes.T - at).sum(axis=1).argmin() for at in ([0, 0], [40, 0])
    )
    conditions = {
        "tool": OnSurface(tool),
        "middle": Condition([middle], (0.0, 0.0, None)),
        "side": Condition([side], (None, 0.0, None)),
    }
    start = drape.displacement(ply.nodes, drape.exponential_map(tool, ply.nodes))
    return equilibrium_near(ply, conditions, start)


@pytest.mark.dear("two meshes show that the share remains on the finer one")
def test_forces_at_fixed_nodes_are_no_reason_to_reject_a_state():
    """Deviations cause much of its force, which a finer mesh hardly changes."""
    coarse, fine = held_at_a_node(3), held_at_a_node(4)
    share, finer = (s.shares["middle_reaction"]["deviation"] for s in (coarse, fine))
    assert share > 0.4
    assert 0.3 < finer < share
    assert coarse.shares["energy"]["deviation"] < 0.01
    force, of_finer = (s.reactions["middle"][1] for s in (coarse, fine))
    assert of_finer == pytest.approx(force, rel=1e-3)
