"""The study of forming: tools as triangles, outcomes and forces."""

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.scenes import hemisphere_forming
from studies.forming import triangles
from studies.forming.cases import _of_triangles
from studies.forming.study import outcome, outcomes

RNG = np.random.default_rng(7)
EDGE = 1.0
PUNCH = triangles.sphere(20.0, np.array([1.0, 2.0, -20.0]), EDGE)
DIE = triangles.die(22.0, 5.0, 0.5, EDGE)


def test_surfaces_of_triangles_are_the_exact_ones():
    """To a hundredth of an edge, with normals within a degree, away from the edges."""
    near = RNG.uniform(-0.3, 0.3, 500)
    polar, turn = RNG.uniform(0, 0.55 * np.pi, 500), RNG.uniform(0, 2 * np.pi, 500)
    n = np.array(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
    )
    on_sphere = (20 + near) * n + [[1.0], [2.0], [-20.0]]
    exact = drape.Die(22.0, 5.0, (0, 0, 0.5))
    r, z = RNG.uniform(21.5, 40.0, 500), RNG.uniform(0, 12, 500)
    beside = np.array([r * np.cos(turn), r * np.sin(turn), z])
    beside = beside - exact.level(beside) * exact.gradient(beside)
    for tool, surface, x in (
        (PUNCH, drape.Sphere(20.0, (1, 2, -20)), on_sphere),
        (DIE, exact, beside + near * exact.gradient(beside)),
    ):
        slope = np.linalg.norm(tool.gradient(x), axis=0)
        side = np.sign((tool.gradient(x) * surface.gradient(x)).sum(axis=0))
        assert (side == side[0]).all()
        off = side * tool.level(x) / slope - surface.level(x)
        assert np.abs(off).max() < 0.05 * EDGE
        assert np.median(np.abs(off)) < 0.01 * EDGE
        cosine = (tool.gradient(x) / slope * surface.gradient(x)).sum(axis=0)
        assert np.degrees(np.arccos(np.abs(cosine).clip(0, 1))).max() < 5


@pytest.mark.parametrize("tool", [PUNCH, DIE], ids=["punch", "die"])
def test_points_far_away_are_on_the_side_of_the_nearest_vertex(tool):
    """As far as the tool, which ends at its edges, can touch them."""
    x = RNG.uniform(-60, 60, (3, 4000))
    x = x[:, tool.beyond_edges(x) == 0]
    side, _ = tool.far_away(x)
    quadrics = tool._quadrics
    height, _ = quadrics._heights(x, quadrics._tree.query(x.T)[1])
    assert (side * height >= 0).all()
    assert (np.abs(height[side != 0]) > EDGE).all()
    assert (side != 0).mean() > 0.3


def test_the_study_replaces_punch_and_die_only():
    scene = hemisphere_forming(radius=20.0, fillet=5.0, travel=10.0)
    punch, die, holder = _of_triangles(scene).tools
    assert isinstance(punch.surface, drape.TriangleMesh)
    assert isinstance(die.surface, drape.TriangleMesh)
    assert holder is scene.tools[2]
    top = punch.surface.facets.points[2].max()
    assert top == pytest.approx(-0.15)
    assert die.surface.facets.points[2].min() == pytest.approx(0.15)
    assert punch.motion == scene.tools[0].motion


ROW = {
    "kind": "random",
    "refused": "",
    "refused_of_more_steps": "",
    "off_in_more_steps": 0.0,
    "force": 10.0,
    "force_in_more_steps": 10.0,
    "path_resolved": True,
    "refused_of_one_point": "",
    "rms_of_one_point": 1.0,
    "interval": 2.0,
    "force_of_one_point": 11.0,
}


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, "right"),
        ({"refused": "stopped"}, "refused"),
        ({"refused_of_more_steps": "stopped"}, "unconfirmed"),
        ({"off_in_more_steps": 0.02}, "wrong"),
        ({"force_in_more_steps": 10.02}, "wrong"),
        ({"force_in_more_steps": 10.02, "path_resolved": False}, "warned"),
    ],
)
def test_outcomes_of_a_run(changed, expected):
    """Each has its own column; a state that no other run confirms is not right."""
    row = ROW | changed
    assert outcome(row) == expected
    head, _, line = outcomes([row]).splitlines()
    columns = dict(zip(head.split("|"), line.split("|"), strict=True))
    assert [k.strip() for k, n in columns.items() if n.strip() == "1"] == [expected]
