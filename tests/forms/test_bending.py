"""Bending stiffness of fibres."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation
from skfem import MeshQuad, MeshTri

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
    Traction,
)
from skfem_textile.fabric.kinematics import rotated
from skfem_textile.forms.bending import (
    EndEdges,
    edges_with_fibres,
    end_edges,
    excluded_components,
)
from skfem_textile.forms.bending_laws import Moments, _ratio
from skfem_textile.scenes.elastica import hanging
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent
from tests.helpers import distorted, random_u, zero_modes
from tests.helpers.plies import (
    CURVED,
    SIDE,
    D,
    every_formulation,
    inclined,
    lifted,
    square,
)

# Bending stiffness: fibres at rest, elements, regions, rejected values


@every_formulation
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_homogeneous_motion_does_not_bend_curved_fibres(formulation, dimension):
    fabric = Fabric(50.0, 0.5, **CURVED, bending=(3.0, 1.0))
    ply = Ply(distorted(1, jitter=0.2), fabric, formulation, dimension=dimension)
    H = np.random.default_rng(3).standard_normal((dimension, 2))
    u = (H @ ply.nodes).T.ravel()
    wave = ply.energies(random_u(ply, 2, 0.1))["bending"]
    assert ply.energies(u)["bending"] < 1e-12 * wave


def test_directions_as_a_field_and_per_element_give_the_same_bending():
    """Fibres along circles, as a field and as one direction in each element."""
    mesh = rectangle(10, 10, (16, 16), "irregular", 0.2, 1)

    def warp(x):
        return np.stack([20 + x[1], -x[0]]) / np.hypot(20 + x[1], x[0])

    def weft(x):
        return rotated(warp(x))

    centres, (x, y) = mesh.p[:, mesh.t].mean(axis=1), mesh.p
    by_field, by_element = (
        Ply(mesh, Fabric(1e4, 0.0, *A, bending=(D, 0.0)), Full(), dimension=3)
        for A in ((warp, weft), (warp(centres), weft(centres)))
    )
    u = lifted(by_field, 0.01 * x**2 + 0.02 * x * y - 0.01 * y**2)
    energy = by_field.energies(u)["bending"]
    assert by_element.energies(u)["bending"] == pytest.approx(energy, rel=1e-12)
    c, s = warp(centres)
    curvature = 0.02 * c**2 + 0.04 * c * s - 0.02 * s**2
    area = by_field.basis.dx.sum(axis=1)
    assert energy == pytest.approx(0.5 * D * (area * curvature**2).sum(), rel=0.02)


def test_each_family_and_element_has_a_separate_stiffness():
    """½ D κ² of a cylinder, up to the area beside the ends of the fibres."""
    mesh = square(4, side=8.0).with_subdomains({"all": np.arange(16)})
    x, y = mesh.p
    for of_warp in (2.0, np.full(16, 2.0)):
        fabric = Fabric(bending=(of_warp, 3.0))
        for chosen in (fabric, {"all": fabric}):
            ply = Ply(mesh, chosen, Full(), dimension=3)
            for shape, stiffness in ((x**2, 2.0), (y**2, 3.0), (x * y, 0.0)):
                energy = ply.energies(lifted(ply, 0.5 * 0.1 * shape))["bending"]
                assert energy == pytest.approx(64 * 0.5 * stiffness * 0.01, abs=1e-12)


def test_stiffness_per_element_acts_in_its_element():
    mesh = square(16, side=8.0)
    left = mesh.p[0, mesh.t].mean(axis=0) < 4
    ply = Ply(mesh, Fabric(bending=(np.where(left, 1.0, 5.0), 0.0)), Macro())
    u = ply.basis.zeros()
    u[1::2] = 0.05 * ply.nodes[0] ** 2
    assert ply.energies(u)["bending"] == pytest.approx(32 * 0.5 * 0.01 * 6, rel=0.02)


def test_plies_with_terms_keep_bending_and_its_ends():
    mesh = MeshTri().refined(2).scaled(10.0).with_defaults()
    fabric = Fabric(bending=(np.linspace(1, 2, mesh.nelements), 3.0))
    ends = {"left": "clamped", "bottom": "mirror"}
    ply = Ply(mesh, fabric, Macro(), dimension=3, fibre_ends=ends)
    other = ply.with_terms(BodyForce((0, 0, 1.0)))
    assert other.fibre_ends == ends
    energy = other.energies(lifted(other, 0.05 * other.nodes[0] ** 2))["bending"]
    assert energy == pytest.approx(100 * 0.5 * 1.5 * 0.01, rel=0.15)


# Twist: its stiffness, and zero modes without it


def test_twist_is_defined_per_element_and_region():
    mesh = square(4, side=8.0).with_subdomains({"all": np.arange(16)})
    values = np.where(mesh.p[0, mesh.t].mean(axis=0) < 4, 1.0, 3.0)
    fabric = Fabric(twist=values)
    for chosen in (fabric, {"all": fabric}):
        for formulation in (Full(), Macro()):
            ply = Ply(mesh, chosen, formulation, dimension=3)
            u = lifted(ply, 0.1 * ply.nodes.prod(axis=0))
            energy = ply.energies(u)["bending"]
            assert energy == pytest.approx(64 * 0.5 * 2.0 * 0.01, rel=1e-12)


@every_formulation
@pytest.mark.parametrize("degrees", [0, 45])
def test_the_twist_energy_of_a_saddle_is_exact(formulation, degrees):
    """½ D_t c² per area of z = c x y, rotated with the fibres and in space."""
    fabric = Fabric(50.0, **inclined(degrees), twist=3.0)
    ply = Ply(square(8, side=8.0), fabric, formulation, dimension=3)
    turn = Rotation.from_rotvec((0.3, -1.0, 0.7)).as_matrix()
    s, t = np.array([fabric.warp, fabric.weft]) @ ply.nodes
    u = turn @ [*ply.nodes, 0.1 * s * t] - [*ply.nodes, 0 * s]
    energy = ply.energies(u.T.ravel())["bending"]
    assert energy == pytest.approx(64 * 0.5 * 3.0 * 0.01, rel=1e-10)


@every_formulation
def test_only_rigid_motions_are_free_with_a_twist_stiffness(formulation):
    fabric = Fabric(1e3, 1.0, bending=(1.0, 1.0), twist=0.1)
    made = OnePoint(0.0) if isinstance(formulation, OnePoint) else formulation
    halves = 2 if isinstance(formulation, Macro) else 1
    ply = Ply(square(4 // halves, 0.2, 10.0), fabric, made, dimension=3)
    assert zero_modes(ply.tangent(ply.basis.zeros())) == 6


# Plates: the deflection of simply supported squares


def plate(mesh, degrees, formulation, held, ends=None):
    """Deflection under p sin sin relative to the exact one; pinned where fixed."""
    fabric = Fabric(1e4, 0.1, **inclined(degrees), bending=(D, D))
    ply = Ply(mesh, fabric, formulation, dimension=3, fibre_ends=ends)
    x, y = ply.nodes
    shape = np.sin(np.pi * x / SIDE) * np.sin(np.pi * y / SIDE)
    load = BodyForce(
        lambda X: (
            np.stack([0 * X[0], 0 * X[0], *np.sin(np.pi * X / SIDE)[:1]])
            * np.sin(np.pi * X[1] / SIDE)
        )
    )
    f = load.on(ply.basis).vector[2::3]
    free = np.flatnonzero(~held(x, y))
    w = np.zeros(len(x))
    bending = next(term for term in ply.terms if term.name == "bending")
    K = bending.matrix[2::3, 2::3].tocsr()  # of the displacement along z
    w[free] = spsolve(K[free][:, free].tocsc(), f[free])
    families = 2 if degrees % 90 == 0 else 4
    return w * families * D * (np.pi / SIDE) ** 4 - shape


def on_sides(x, y):
    return (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > SIDE - 1e-9)


@pytest.mark.parametrize(
    ("formulation", "degrees", "bound"),
    [(OnePoint(), 0, 0.02), (Quadratic(), 45, 0.012)],
)
def test_a_supported_plate_is_of_second_order(formulation, degrees, bound):
    coarse, fine = (
        np.abs(plate(square(n, 0.2), degrees, formulation, on_sides)).max()
        for n in (8, 16)
    )
    assert fine < bound
    assert coarse / fine > 3


def test_planes_of_symmetry_replace_the_other_half():
    """A quarter of the plate."""
    ends = {"right": "mirror", "top": "mirror"}

    def held(x, y):
        return np.minimum(x, y) < 1e-9

    def off(n):
        mesh = square(n, side=SIDE / 2).with_defaults()
        return np.abs(plate(mesh, 45, OnePoint(), held, ends)).max()

    assert off(8) < 0.04
    assert off(4) > 2.5 * off(8)


# Cantilevers against the elastica


def cantilever(n, alpha, weight, formulation):
    """Tip over the length after a single step, and the number of steps taken."""
    mesh = MeshQuad.init_tensor(np.linspace(0, SIDE, n + 1), np.linspace(0, 20, 3))
    load = (0.0, 0.0, alpha * D / SIDE**2)
    loads = [Traction("right", load)]
    if weight:
        loads = [BodyForce((0.0, 0.0, alpha * D / SIDE**3))]
    ply = Ply(
        *(mesh.with_defaults(), Fabric(1e4, 0.1, bending=(D, D)), formulation, loads),
        dimension=3,
        fibre_ends={"left": "clamped"},
    )
    conditions = {"left": Condition("left")}
    result = LoadStepper(ply, conditions, 1, solver="superlu").run()
    tip = ply.nodes[0] > SIDE - 1e-9
    x, _, z = ply.nodal(result.u)[:, tip].mean(axis=1) / SIDE
    return np.array([1 + x, z]), len(result.states) - 1


@pytest.mark.parametrize(
    ("formulation", "halved", "alpha", "weight", "bound"),
    [
        (OnePoint(), 1, 8.0, True, 1e-3),
        pytest.param(Macro(), 2, 10.0, False, 1e-3, marks=pytest.mark.slow),
        pytest.param(Macro(), 2, 1.0, False, 2e-4, marks=pytest.mark.slow),
    ],
)
def test_a_cantilever_converges_to_the_elastica_in_one_step(
    formulation, halved, alpha, weight, bound
):
    shape = hanging(*((alpha, 0.0) if weight else (0.0, alpha)))
    exact = np.array([shape.x[-1], -shape.z[-1]])
    (coarse, _), (fine, steps) = (
        cantilever(n // halved, alpha, weight, formulation) for n in (16, 32)
    )
    assert steps == 1
    assert abs(fine[1] - exact[1]) < bound
    assert (np.abs(coarse - exact) > 3.3 * np.abs(fine - exact)).all()


# Strips between rotating clamps: circles


def arc(n, formulation, jitter, slope):
    """A strip whose clamps rotate by ± slope: its last state relative to the circle."""
    halves = 2 if isinstance(formulation, Macro) else 1
    size = n // halves, 2 // halves
    mesh = rectangle(SIDE, 20.0, size, "irregular", jitter, 1)
    ends = {
        "left": lambda t: (0.0, -t * slope, 0.0),
        "right": lambda t: (0.0, t * slope, 0.0),
    }
    fabric = Fabric(1e4, 0.1, bending=(D, D))
    ply = Ply(mesh, fabric, formulation, dimension=3, fibre_ends=ends)
    held = {"left": Condition("left"), "right": Condition("right", (None, 0.0, 0.0))}
    result = LoadStepper(ply, held, 2, solver="superlu").run()
    assert result.path_resolved
    state = result.states[-1]
    x, _, z = ply.nodal(state.u)
    tip = x[ply.nodes[0] > SIDE - 1e-9].mean() / SIDE
    exact = 0.5 * D * (2 * slope / SIDE) ** 2 * SIDE * 20.0
    return np.array(
        [
            state.energies["bending"] / exact - 1,
            tip - (np.sin(slope) / slope - 1),
            z.max() / SIDE - (1 - np.cos(slope)) / (2 * slope),
        ]
    )


@pytest.mark.parametrize(
    ("formulation", "bound", "slope", "jitter"),
    [
        (OnePoint(), 3e-3, 2.5, 0.2),
        pytest.param(Macro(), 3e-3, 2.5, 0.2, marks=pytest.mark.slow),
        pytest.param(Quadratic(), 6e-3, 2.5, 0.2, marks=pytest.mark.slow),
        pytest.param(Macro(), 3e-3, 0.1, 0.0, marks=pytest.mark.slow),
    ],
)
def test_rotating_clamps_bend_a_strip_to_a_circle(formulation, bound, slope, jitter):
    """Moment 2 D φ/L: energy, end and height."""
    coarse, fine = (arc(n, formulation, jitter, slope) for n in (16, 32))
    assert np.abs(fine).max() < bound
    assert np.abs(coarse).max() > 2 * np.abs(fine).max()


@every_formulation
def test_forces_of_rotating_clamps_are_derivatives_of_the_energy(formulation):
    """In the plane, where the fibres along an edge do not end."""
    fabric = Fabric(50.0, 0.5, bending=(3.0, 1.0), twist=0.5)
    ends = {"left": "clamped", "right": lambda t: 0.5 * t, "top": "mirror"}
    mesh = square(2, 0.2, 10.0)
    ply = Ply(mesh, fabric, formulation, fibre_ends=ends)
    u, du = random_u(ply, 3, 0.1), random_u(ply, 4, 1e-4)
    for t in (0.0, 0.7):
        rise = ply.energies(u + du, t)["bending"] - ply.energies(u - du, t)["bending"]
        assert rise == pytest.approx(2 * ply.residuals(u, t)["bending"] @ du, rel=1e-8)
    assert ply.energies(u, 0.7)["bending"] != ply.energies(u, 0.0)["bending"]
    turned, plain = (
        Ply(mesh, fabric, formulation, fibre_ends=ends | {"right": end})
        for end in (lambda t: 0.0, "clamped")
    )
    expected = pytest.approx(plain.energies(u, 1.0)["bending"], rel=1e-12)
    assert turned.energies(u, 1.0)["bending"] == expected


def test_a_strip_between_rotating_clamps_has_the_energy_of_an_arc():
    def off(n, formulation):
        mesh = rectangle(SIDE, 20.0, (n, 4), "irregular", 0.0, 1)
        ends = {"left": lambda t: -0.5 * t, "right": lambda t: 0.5 * t}
        fabric = Fabric(1e4, 0.1, bending=(D, 0.0))
        ply = Ply(mesh, fabric, formulation, fibre_ends=ends)
        X, Y = ply.nodes
        angle = X / SIDE - 0.5
        arc = [SIDE * np.sin(angle) - X, -SIDE * np.cos(angle) + 0 * Y]
        energy = ply.energies(np.array(arc).T.ravel(), 1.0)["bending"]
        return energy / (0.5 * D * 20.0 / SIDE) - 1

    for formulation in (Full(), Quadratic()):
        assert abs(off(32, formulation)) < 1e-3
        assert abs(off(16, formulation)) > 3.5 * abs(off(32, formulation))


# Compressed plies: buckling with and without bending


IN_PLANE = {
    "left": Condition("left"),
    "right": Condition("right"),
    "plane": Condition(lambda X: X[0] > -1, (None, None, 0.0)),
}


def critical_tension(n, stiffness, conditions, guess):
    """Tension at which fibres along x, compressed evenly, become unstable."""
    E = 1e5
    fabric = Fabric(E, 0.1, bending=(stiffness, stiffness))
    ply = Ply(square(n).with_defaults(), fabric, OnePoint(), dimension=3)
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named("superlu")).at(1.0)
    low, high = 1.9 * guess, 0.0  # without a middle the initial guess is singular
    for _ in range(14):
        u, middle = ply.basis.zeros(), (low + high) / 2
        u[::3] = np.expm1(middle / E) * ply.nodes[0]
        stable = Tangent.at(problem, u, ply.parameters_at_rest).definite
        low, high = (low, middle) if stable else (middle, high)
    return high


@pytest.mark.parametrize(("n", "stiffness"), [(4, 0.0), (16, 100.0)])
def test_a_net_buckles_in_its_plane_at_its_shear_and_bending_stiffness(n, stiffness):
    """T = −(G + D (π/L)²), −G without bending (Rosen)."""
    exact = -(0.1 + stiffness * (np.pi / SIDE) ** 2)
    computed = critical_tension(n, stiffness, IN_PLANE, exact)
    assert computed == pytest.approx(exact, rel=5e-3)


def test_a_ply_fixed_all_round_buckles_out_of_its_plane():
    """T = −2 D (π/L)²."""
    sides = ("left", "right", "bottom", "top")
    conditions = {side: Condition(side) for side in sides}
    exact = -2 * 1000.0 * (np.pi / SIDE) ** 2
    computed = critical_tension(16, 1000.0, conditions, exact)
    assert computed == pytest.approx(exact, rel=1e-2)


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_edges_have_outward_normals_and_the_fibres_that_end_there(angle):
    turn = Rotation.from_euler("z", angle).as_matrix()[:2, :2]
    mesh = MeshQuad.init_tensor(np.arange(3.0), np.arange(4.0))
    middle = mesh.p.mean(axis=1)
    mesh = MeshQuad(turn @ mesh.p, mesh.t)
    A = np.tile(turn @ [[1.0], [0.0]], mesh.nelements)
    edges = edges_with_fibres(mesh, A, mesh.boundary_facets())
    ends = mesh.p[:, mesh.facets[:, edges.facets]]
    assert edges.length == pytest.approx(1.0)
    along = ends[:, 1] - ends[:, 0]
    assert (edges.N * along).sum(axis=0) == pytest.approx(0.0, abs=1e-12)
    out = ends.mean(axis=1) - (turn @ middle)[:, None]
    assert ((edges.N * out).sum(axis=0) > 0.9).all()
    assert end_edges(mesh, A, edges.facets).facets.size == 2 * 3


@pytest.mark.parametrize(("angle", "crossing"), [(3e-7, 6), (3e-6, 10)])
def test_fibres_along_an_edge_do_not_end_there(angle, crossing):
    """Up to round-off; at a larger angle they do."""
    mesh = MeshQuad.init_tensor(np.arange(3.0), np.arange(4.0))
    A = np.tile([[np.cos(angle)], [np.sin(angle)]], mesh.nelements)
    assert end_edges(mesh, A, mesh.boundary_facets()).facets.size == crossing


def test_a_kink_between_two_triangles_has_an_exact_energy():
    """L²D/4|K| of the mean curvatures L/2|K|, and a fifth of the least penalty."""
    p = np.array([[0.0, 0.0, 3.0, -3.0], [-1.0, 1.0, 0.0, 0.0]])
    mesh = MeshTri(p, np.array([[0, 0], [1, 1], [2, 3]]))
    ply = Ply(mesh, Fabric(bending=(D, 0.0)), Quadratic(), dimension=3)
    energy = ply.energies(lifted(ply, np.maximum(ply.nodes[0], 0.0)))["bending"]
    assert energy == pytest.approx((0.25 + 0.5 * 0.2 * 1.5) * D * 2.0**2 / 3.0)


@pytest.mark.parametrize(("angle", "rank"), [(2.4e-5, 1), (7.7e-5, 2)])
def test_nearly_parallel_planes_of_symmetry_exclude_one_component(angle, rank):
    mesh = MeshQuad()
    facets = np.flatnonzero((mesh.facets == 0).any(axis=0))
    N = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)]])
    mirrors = EndEdges(facets, N, N, np.ones(2))
    projector = excluded_components(mesh, mirrors.where([]), mirrors, 2)[0]
    assert np.trace(projector) == pytest.approx(rank)


def test_a_moment_over_a_curvature_of_rounding_is_the_tangent():
    moments = Moments(np.zeros(2), np.array([6.0, 6.0]), np.array([1.0, 1.0]))
    assert _ratio(moments, np.array([3e-13, 3e-12])) == pytest.approx([1.0, 2e12])
