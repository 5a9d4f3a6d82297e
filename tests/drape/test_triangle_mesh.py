"""Values of smoothed triangles at many points, against all vertices one by one."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers.tools import plate

PARTS = "level", "gradient", "hessian"


def points(kind):
    """Points near a bump, far from it, equally far from vertices, and at vertices."""
    x, t = plate(n=15)
    rng = np.random.default_rng(1)
    return {
        "near": x[:, ::3] + rng.normal(size=(3, 75)),
        "far": 300 * rng.normal(size=(3, 40)),
        "beyond": x[:, :15] - [[0], [30], [0]],
        "edges": x[:, t[:2]].mean(axis=1)[:, ::5],
        "vertices": x[:, ::7],
    }[kind]


KINDS = "near", "far", "beyond", "edges", "vertices"


@pytest.fixture(scope="module")
def tool():
    return drape.TriangleMesh(*plate(n=15))


@pytest.mark.parametrize("kind", KINDS)
def test_the_level_is_the_mean_over_all_vertices(tool, kind):
    """With weights that vanish at two edges, or at 1.5 times the nearest distance."""
    vertices, a, b, H = tool._quadrics._quadrics
    for x in points(kind).T:
        d = x - vertices
        r = np.linalg.norm(d, axis=1)
        s = np.minimum(r / max(tool._quadrics._reach, 1.5 * r.min()), 1)
        w = (1 - s) ** 6 * (35 * s**2 + 18 * s + 3)
        q = a + (b * d).sum(axis=1) + 0.5 * np.einsum("ni,nij,nj->n", d, H, d)
        level = tool.level(x[:, None])[0]
        assert level == pytest.approx((w @ q) / w.sum(), rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_many_points_have_the_values_of_each_alone(tool, kind):
    x = points(kind)
    for part in PARTS:
        together = getattr(tool, part)(x)
        alone = [getattr(tool, part)(x[:, [i]])[..., 0] for i in range(x.shape[1])]
        np.testing.assert_allclose(together, np.moveaxis(alone, 0, -1), atol=1e-10)


def test_values_do_not_depend_on_points_before(tool):
    x, other = points("near"), points("far")
    before = [getattr(tool, part)(x).copy() for part in PARTS]
    for shift in range(3):
        tool.level(other + shift)
    for part, values in zip(PARTS, before, strict=True):
        np.testing.assert_array_equal(getattr(tool, part)(x), values)
