"""The range of the stabilisation in intervals grows where meshes resolve less."""

import numpy as np
import pytest
from skfem import MeshTri

from skfem_textile import Quadratic
from skfem_textile.mesh.selection import SINGULAR
from skfem_textile.ply.formulations import OF_QUADRATIC


def mesh(height, width=2.0, singular=True):
    """Two triangles of a height on both sides of an edge, and one beside them."""
    p = np.array([[1.0, 1.0 + width, 1.5, 1.2, 9.0], [5.0, 5.0, 5 + height, 0, 5]])
    p[1, 3] = 5 - height
    made = MeshTri(p, np.array([[0, 1, 1], [1, 0, 2], [2, 3, 4]]))
    edge = [i for i, ends in enumerate(made.facets.T) if {*ends} == {0, 1}]
    return made.with_boundaries({SINGULAR: np.array(edge)}) if singular else made


@pytest.mark.parametrize(("height", "share"), [(0.5, 0.25), (1.0, 0.5), (9.0, 1.0)])
def test_triangles_as_high_as_long_do_not_resolve_a_layer(height, share):
    """By height over length, at most 1."""
    found = Quadratic(400.0).log_range(mesh(height))
    assert found == pytest.approx(OF_QUADRATIC + 0.6 * share)


def test_another_deviation_than_the_calibrated_one_widens_the_range():
    assert Quadratic(70.0).log_range(mesh(1.0, singular=False)) == OF_QUADRATIC
    for deviation, of in ((7.0, False), (700.0, False), (40.0, True)):
        off = Quadratic(deviation).log_range(mesh(1.0, singular=of))
        layer = 0.6 * 0.5 * of
        assert off == pytest.approx(OF_QUADRATIC + np.log(10) + layer)


def test_a_border_between_subdomains_widens_the_range_and_its_own_edge_does_not():
    plain = mesh(1.0, singular=False)
    every = plain.with_subdomains({"a": np.arange(3)})
    part = plain.with_subdomains({"a": np.array([2])})
    assert Quadratic(70.0).log_range(every) == OF_QUADRATIC
    assert Quadratic(70.0).log_range(part) == pytest.approx(OF_QUADRATIC + 1.3)
