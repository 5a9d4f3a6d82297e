"""A holder presses with its pressure times the area of the ply within its outline."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Fabric, Holder, OnePoint, Ply, Quadratic, Tool, drape
from skfem_textile.scenes.rectangle import rectangle

PRESSURE, PLANE = 0.005, drape.Plane((0.0, 0.0, 0.15))


def square(n):
    s = np.linspace(-80.0, 80.0, n + 1)
    return MeshQuad.init_tensor(s, s)


def box(x_0, x_1, y_0, y_1):
    return np.array([[x_0, x_1, x_1, x_0], [y_0, y_0, y_1, y_1]], dtype=float)


def circle(radius):
    t = np.linspace(0.0, 2.0 * np.pi, 41)
    return radius * np.array([np.cos(t), np.sin(t)])


def area(corners):
    """By the sum over edges, of a polygon whose edges do not cross."""
    x, y = corners
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def forces(mesh, *outlines, formulation=None, u=None, **options):
    """Total force of a holder within each outline."""
    holders = [
        Holder(
            **{"surface": PLANE, "pressure": PRESSURE, "side": -1} | options,
            outline=outline,
            name=f"holder {i}",
        )
        for i, outline in enumerate(outlines)
    ]
    ply = Ply(
        *(mesh.with_defaults(), Fabric(1e3, 0.1, bending=(5.0, 5.0))),
        *(() if formulation is None else (formulation,)),
        terms=[Tool(PLANE, side=-1, name="die"), *holders],
        dimension=3,
    )
    u = ply.basis.zeros() if u is None else u(ply).T.ravel()
    terms = [term for term in ply.terms if term.name.startswith("holder")]
    values = [term.parameters.updated(p, u, 1.0) for term in terms for p in [{}]]
    pairs = zip(terms, values, strict=True)
    return [term.forces(u, 1.0, p).sum() for term, p in pairs]


@pytest.mark.parametrize("n", [4, 9, 16])
def test_a_ring_is_exact_on_any_mesh(n):
    ring = np.hstack([circle(200.0), circle(60.0)])
    (force,) = forces(square(n), ring)
    assert force == pytest.approx(PRESSURE * (160**2 - area(circle(60.0))), rel=1e-9)


@pytest.mark.parametrize("formulation", [OnePoint(), Quadratic(100)], ids=repr)
@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
def test_irregular_meshes_and_their_formulations_are_exact(formulation, kind):
    mesh = rectangle(160.0, 160.0, (7, 7), kind, 0.3, 2).translated((-80.0, -80.0))
    outline = [[-31.0, 93.0, 22.0, -47.0], [-52.0, 3.0, 61.0, 44.0]]
    inside = forces(mesh, outline, formulation=formulation)
    everything = forces(mesh, None, formulation=formulation)
    clipped = np.array([[-31.0, 80.0, 80.0, 22.0, -47.0], [0, 0, 0, 61.0, 44.0]])
    clipped[1, :3] = -52.0, -52.0 + 55 * 111 / 124, 3.0 + 58 * 13 / 71
    assert inside == pytest.approx([PRESSURE * area(clipped)], rel=1e-9)
    assert everything == pytest.approx([PRESSURE * 160.0**2], rel=1e-9)


@pytest.mark.parametrize("n", [8, 9])
def test_segments_that_share_edges_add_up(n):
    """Also where their edges pass through nodes."""
    quarters = (box(0, 100, 0, 100), box(-100, 0, 0, 100))
    quarters += (box(-100, 0, -100, 0), box(0, 100, -100, 0))
    assert forces(square(n), *quarters) == pytest.approx([32.0] * 4, rel=1e-9)


def test_the_share_is_of_the_undeformed_area_at_the_present_position():
    """A ply is stretched to twice its width, half of which is inside."""

    def moved(ply):
        return np.array([ply.nodes[0] + 80.0, 0 * ply.nodes[0], 0 * ply.nodes[0]])

    assert forces(square(5), box(0, 160, -90, 90), u=moved) == pytest.approx([64.0])


def test_an_outline_moves_with_its_holder():
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def motion(t):
        return turn, (20.0, 10.0, 0.0)

    expected = [PRESSURE * 50.0 * 30.0]
    found = forces(square(6), box(-25, 25, -15, 15), motion=motion)
    assert found == pytest.approx(expected, rel=1e-9)
