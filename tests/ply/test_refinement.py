"""Plies refined at given elements, and at jumps of the shear angle."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Macro,
    MatrixTerm,
    MeshError,
    OnePoint,
    Ply,
    Quadratic,
    marked,
    refine,
    shear_angle_jumps,
    split,
)
from skfem_textile.mesh.bases import node_dofs
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.selection import named_nodes, with_named_nodes
from skfem_textile.mesh.splitting import cut, refine_triangles
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle

FORMULATIONS = [Macro(), OnePoint(), Full(), Quadratic(), Quadratic(80.0)]
few = settings(max_examples=20, phases=[Phase.explicit, Phase.generate])


def sheet(seed=1):
    """Triangles with names of sides, an inner line, halves and two nodes."""
    mesh = rectangle(3.0, 2.0, (4, 3), "delaunay", 0.2, seed)
    inner = np.setdiff1d(np.arange(mesh.nfacets), mesh.boundary_facets())[::3]
    x = mesh.p[0, mesh.t].mean(axis=0)
    mesh = mesh.with_boundaries({"inner": inner}).with_subdomains(
        {"left": np.flatnonzero(x < 1.5), "right": np.flatnonzero(x >= 1.5)}
    )
    return with_named_nodes(mesh, {"pins": np.array([0, 7])})


def areas(mesh):
    (a, b, c), (d, e, f) = mesh.p[:, mesh.t]
    return np.abs((b - a) * (f - d) - (c - a) * (e - d)) / 2


def smallest_angle(mesh):
    x = mesh.p[:, mesh.t]
    one, other = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    turn = np.abs(one[0] * other[1] - one[1] * other[0])
    return np.arctan2(turn, (one * other).sum(axis=0)).min()


def lengths(mesh, edges):
    ends = mesh.p[:, mesh.facets[:, edges]]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)


def arbitrary(ply, seed=1):
    """A displacement that is linear in each of the user's triangles."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.02, 0.02, (2, ply.users_mesh.nvertices))


def linear_between(ply, vertices):
    """Values at the user's nodes as a displacement of a ply that splits triangles."""
    mesh, u = ply.users_mesh, ply.basis.zeros()
    x = ply.nodes
    cells = mesh.element_finder()(*x)
    xi = mesh.mapping().invF(x[:, :, None], cells)[:, :, 0]
    weights = np.array([1 - xi[0] - xi[1], xi[0], xi[1]])
    u[node_dofs(ply.basis)] = (vertices[:, mesh.t[:, cells]] * weights).sum(axis=1)
    return u


@few
@given(seed=st.integers(0, 10**6), rounds=st.integers(1, 4))
def test_refined_meshes_are_sound_and_keep_names_and_angles(seed, rounds):
    rng, mesh = np.random.default_rng(seed), sheet(seed)
    flattest = smallest_angle(mesh)
    for _ in range(rounds):
        elements = rng.choice(mesh.nelements, rng.integers(1, 6), replace=False)
        refined = refine_triangles(mesh, elements)
        new, old = refined.mesh, mesh
        check_mesh(new)
        np.testing.assert_array_equal(new.p[:, : old.nvertices], old.p)
        middles = old.p[:, refined.ends].mean(axis=1)
        np.testing.assert_array_equal(new.p[:, old.nvertices :], middles)
        whole = np.bincount(refined.parent, areas(new))
        np.testing.assert_allclose(whole, areas(old), rtol=1e-12)
        parts = np.bincount(refined.parent)
        assert (parts[elements] == 4).all()
        assert set(new.boundaries) == set(old.boundaries)
        for name, edges in old.boundaries.items():
            new_edges = new.boundaries[name]
            assert np.unique(new_edges).size == new_edges.size
            total = lengths(new, new_edges).sum()
            assert total == pytest.approx(lengths(old, edges).sum(), rel=1e-12)
        for side, axis, at in (("left", 0, 0.0), ("top", 1, 2.0)):
            ends = new.p[axis, new.facets[:, new.boundaries[side]]]
            np.testing.assert_array_equal(ends, at)
        for name, numbers in old.subdomains.items():
            inside = np.isin(refined.parent, numbers)
            np.testing.assert_array_equal(np.flatnonzero(inside), new.subdomains[name])
        np.testing.assert_array_equal(named_nodes(new)["pins"], [0, 7])
        mesh = new
    assert smallest_angle(mesh) > 0.49 * flattest


def test_named_inner_edges_keep_their_position():
    mesh = sheet()
    refined = refine_triangles(mesh, np.arange(0, mesh.nelements, 2)).mesh
    ends = mesh.p[:, mesh.facets[:, mesh.boundaries["inner"]]]
    a, b = ends.swapaxes(0, 1)
    middles = refined.p[:, refined.facets[:, refined.boundaries["inner"]]].mean(axis=1)
    for point in middles.T:
        along = (point - a.T) @ (b - a) / np.sum((b - a) ** 2, axis=0)
        share = np.diag(along)
        error = a + share * (b - a) - point[:, None]
        on = (np.linalg.norm(error, axis=0) < 1e-12) & (share > 0) & (share < 1)
        assert on.any()


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
def test_linear_fields_in_the_triangles_are_transferred_exactly(formulation):
    ply = Ply(sheet(), Fabric(1e3, 1.0), formulation)
    vertices = arbitrary(ply)
    finer = refine(ply, [0, 3, 4])
    carried = finer.carry(linear_between(ply, vertices))
    new = np.hstack([vertices, vertices[:, finer.ends].mean(axis=1)])
    np.testing.assert_allclose(carried, linear_between(finer.ply, new), atol=1e-15)


@pytest.mark.parametrize("by", ["element", "region", "direction"])
def test_the_parts_of_an_element_have_its_fabric(by):
    mesh, rng = sheet(), np.random.default_rng(2)
    n = mesh.nelements
    fabric = {
        "element": Fabric((rng.uniform(1e3, 2e3, n), 1e3), rng.uniform(1, 2, n)),
        "region": {"left": Fabric(1e3, 1.0), "right": Fabric(3e3, 5.0, (1, 2))},
        "direction": Fabric(1e3, 1.0, warp=rng.uniform(0.5, 1, (2, n)), weft=(-1, 1)),
    }[by]
    ply = Ply(mesh, fabric, Full())
    for further in (ply, ply.with_terms(Force("right", (0.1, 0.0)))):
        finer = refine(further, rng.choice(n, 5, replace=False))
        finer = refine(finer.ply, [0, 1]), finer
        u = linear_between(ply, arbitrary(ply))
        carried = finer[0].carry(finer[1].carry(u))
        expected, computed = further.energies(u), finer[0].ply.energies(carried)
        assert computed.keys() == expected.keys()
        for name, energy in expected.items():
            assert computed[name] == pytest.approx(energy, rel=1e-10), name


def test_a_refined_ply_is_solved_with_the_conditions_of_the_first():
    ply = Ply(sheet(), Fabric(1e3, 1.0))
    pull = {"left": Condition("left"), "right": Condition("right", 0.02, (1, 0))}
    for one in (ply, refine(ply, np.arange(6)).ply):
        result = LoadStepper(one, pull, 1).run()
        X = one.nodes[:, one.nodes[0] == 3.0]
        assert X.shape[1] >= 7
        nodes = one.nodal(result.u)[0, one.nodes[0] == 3.0]
        np.testing.assert_allclose(nodes, 0.02)


def test_elements_are_numbers_or_one_bool_for_each():
    ply = Ply(sheet(), Fabric(1e3, 1.0))
    n = ply.users_mesh.nelements
    which = np.arange(n) % 5 == 0
    sizes = {
        refine(ply, elements).ply.mesh.nelements
        for elements in (which, np.flatnonzero(which), np.flatnonzero(which).tolist())
    }
    assert len(sizes) == 1
    assert refine(ply, []).ply.users_mesh.nelements == n
    for wrong, message in (
        ([n], f"from 0 to {n - 1}"),
        ([-1], f"from 0 to {n - 1}"),
        ([0.5], "numbers or one bool"),
        ([True], "numbers or one bool"),
        ([[0, 1]], "numbers or one bool"),
    ):
        with pytest.raises(ValueError, match=message):
            refine(ply, wrong)


def test_plies_that_cannot_be_refined_are_rejected():
    fabric, quads = Fabric(1e3, 1.0), rectangle(3, 2, (3, 2), "aligned")
    with pytest.raises(MeshError, match="before it is split"):
        refine(Ply(split(sheet()), fabric), [0])
    assert refine(Ply(cut(quads), fabric), [0]).ply.users_mesh.nelements > 12
    ply = Ply(sheet(), fabric)
    springs = MatrixTerm("springs", ply.tangent(ply.basis.zeros()))
    with pytest.raises(ValueError, match="term 'springs' is tied to the mesh"):
        refine(ply.with_terms(springs), [0])


def test_jumps_are_differences_of_the_shear_angle_across_an_edge():
    """One of two triangles shears by γ."""
    mesh = MeshTri(np.array([[0.0, 2, 0, 2], [0, 0, 1, 1]]), [[0, 1], [1, 2], [2, 3]])
    ply = Ply(mesh, Fabric(1e3, 1.0), Full())
    vertices = np.zeros((2, 4))
    vertices[0, 3] = 0.1
    u = linear_between(ply, vertices)
    gamma = ply.shear_angle(u).mean(axis=1)
    jump = np.ptp([gamma[ply.parent == i].mean() for i in range(2)])
    np.testing.assert_allclose(shear_angle_jumps(ply, u), np.sqrt(5) * jump)
    still = linear_between(ply, np.array([[0.1, 0.3], [0.0, 0.05]]) @ mesh.p)
    np.testing.assert_allclose(shear_angle_jumps(ply, still), 0.0, atol=1e-12)


def test_the_fewest_elements_with_the_share_are_marked():
    eta = np.array([1.0, 0.0, 3.0, 2.0])
    assert marked(eta, 9 / 14).tolist() == [2]
    assert marked(eta, 0.65).tolist() == [2, 3]
    assert marked(eta, 1.0).tolist() == [2, 3, 0]
    assert marked(np.zeros(3)).tolist() == []
    for share in (0.0, 1.1, np.nan):
        with pytest.raises(ValueError, match="share must be above 0"):
            marked(eta, share)


def extension(degrees):
    theta = np.radians(degrees)
    return bias_extension(
        "delaunay", (4, 8), jitter=0.25, warp=theta, weft=np.pi - theta
    )


def rounds(scene, unknowns, elements):
    """Position errors by number of unknowns in each refinement round."""
    ply, errors = Ply(scene.mesh, Fabric(1e6, 0.5, scene.warp, scene.weft)), {}
    while unknowns >= ply.basis.N:
        result = LoadStepper(ply, scene.conditions, 4).run()
        error = ply.nodal(result.u) - scene.displacement(ply.nodes, 1.0)
        errors[int(ply.basis.N)] = np.sqrt(np.mean(np.sum(error**2, axis=0)))
        ply = refine(ply, elements(ply, result.u)).ply
    return errors


def all_elements(ply, u):
    return np.arange(ply.users_mesh.nelements)


def elements_at_jumps(ply, u):
    return marked(shear_angle_jumps(ply, u), 0.3)


@pytest.mark.long
def test_refinement_at_kinks_needs_three_quarters_of_the_unknowns():
    scene = extension(45.0)
    uniform, adaptive = (
        rounds(scene, 6400, all_elements),
        rounds(scene, 4800, elements_at_jumps),
    )
    assert max(uniform) > 6300
    assert min(adaptive.values()) < uniform[max(uniform)]


@pytest.mark.long
@pytest.mark.parametrize("degrees", [30.0, 45.0])
def test_refinement_at_kinks_needs_half_of_the_unknowns(degrees):
    scene = extension(degrees)
    uniform, adaptive = (
        rounds(scene, 25000, all_elements),
        rounds(scene, 12500, elements_at_jumps),
    )
    assert max(uniform) > 24000
    assert adaptive[max(adaptive)] < 0.9 * uniform[max(uniform)]


def test_quadrilaterals_have_jumps():
    mesh = MeshQuad().refined(2)
    ply = Ply(mesh, Fabric(1e3, 1.0))
    u = ply.basis.zeros()
    u[node_dofs(ply.basis)] = np.array(
        [np.maximum(ply.nodes[1] - 0.5, 0), 0 * ply.nodes[0]]
    )
    eta = shear_angle_jumps(ply, 0.1 * u)
    y = mesh.p[1, mesh.t].mean(axis=0)
    np.testing.assert_array_equal(eta > 1e-9, np.abs(y - 0.5) < 0.2)


def test_quadrilaterals_are_refined_through_their_triangles():
    """Parents, fabric, names and displacements are those at the quadrilaterals."""
    mesh = rectangle(3.0, 2.0, (4, 3), "irregular", 0.2)
    x, n = mesh.p[0, mesh.t].mean(axis=0), mesh.nelements
    mesh = mesh.with_subdomains({"left": np.flatnonzero(x < 1.5)})
    mesh = with_named_nodes(mesh, {"pins": np.array([0, 7])})
    stiffness = np.random.default_rng(2).uniform(1e3, 2e3, n)
    ply = Ply(mesh, Fabric(stiffness, stiffness / 1e3), Full())
    finer = refine(ply, [2, 3])
    new = finer.ply.users_mesh
    parts = np.bincount(finer.parent)
    assert (parts >= 2).all()
    assert (parts[[2, 3]] == 8).all()
    triangles = cut(mesh)
    whole = np.bincount(triangles.parent, areas(triangles))
    np.testing.assert_allclose(np.bincount(finer.parent, areas(new)), whole)
    E = finer.ply.fabric.at().tensions.laws[0].stiffness.ravel()
    np.testing.assert_array_equal(E, stiffness[finer.parent[finer.ply.parent]])
    inside = np.isin(finer.parent, mesh.subdomains["left"])
    np.testing.assert_array_equal(np.flatnonzero(inside), new.subdomains["left"])
    np.testing.assert_array_equal(named_nodes(new)["pins"], [0, 7])
    linear = np.array([[0.1, 0.3], [0.0, 0.05]])
    u = ply.basis.zeros()
    u[node_dofs(ply.basis)] = linear @ ply.nodes
    nodes = finer.ply.nodal(finer.carry(u))
    np.testing.assert_allclose(nodes, linear @ finer.ply.nodes, atol=1e-14)


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
@pytest.mark.parametrize("quads", [True, False])
def test_a_finer_ply_has_four_parts_per_element_and_its_names(formulation, quads):
    mesh = rectangle(3.0, 2.0, (4, 3), "irregular", 0.2) if quads else sheet()
    ply = Ply(mesh, Fabric(1e3, 1.0), formulation)
    linear = np.array([[0.1, 0.3], [0.0, 0.05]])
    u = ply.basis.zeros()
    u[node_dofs(ply.basis)] = linear @ ply.nodes
    parameters = ply.updated(ply.parameters_at_rest, u)
    finer = ply.finer()
    carried, theirs, tension = finer.carry(u, parameters)
    assert finer.ply.mesh.nelements == 4 * ply.mesh.nelements
    np.testing.assert_array_equal(np.bincount(finer.parent), 4)
    nodes = finer.ply.nodal(carried)
    np.testing.assert_allclose(nodes, linear @ finer.ply.nodes, atol=1e-14)
    before = ply.energies(u, 1.0, parameters)
    after = finer.ply.energies(carried, 1.0, theirs)
    for name, energy in before.items():
        assert after[name] == pytest.approx(energy, rel=1e-9, abs=1e-12), name
    acting = finer.ply.predicted_tension(carried, 0 * carried, theirs)
    np.testing.assert_allclose(tension, finer.ply.arranged(acting), rtol=1e-6)
    assert theirs.keys() == parameters.keys() == finer.ply.parameters_at_rest.keys()
    for name, values in theirs.items():
        for key, array in values.items():
            assert array.shape == finer.ply.parameters_at_rest[name][key].shape
            mean = parameters[name][key].mean()
            assert array.mean() == pytest.approx(mean, rel=1e-6)
    for name, edges in ply.mesh.boundaries.items():
        total = lengths(finer.ply.mesh, finer.ply.mesh.boundaries[name]).sum()
        assert total == pytest.approx(lengths(ply.mesh, edges).sum(), rel=1e-12)
