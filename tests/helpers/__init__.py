"""Distorted meshes, triangles in space and arbitrary states for tests."""

import errno
import os

import numpy as np
import pytest
import shapely
from scipy.optimize import brentq
from scipy.spatial import ConvexHull
from skfem import BilinearForm, Functional, LinearForm, MeshQuad, MeshTri

from skfem_textile import BiaxialLaw, Forms, Full, Macro, OnePoint, Quadratic, Values
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.outlines.net import cut_cells
from skfem_textile.scenes.rectangle import rectangle

ONE_QUAD = np.array([[0.0, 2.0, 2.3, -0.2], [0.0, 0.3, 1.7, 1.4]])


class Locking:
    """A shear law with a pole: w = −½ G a² ln(1 − (Γ/a)²)."""

    def __init__(self, stiffness, angle):
        self.G, self.a = stiffness, angle

    def energy(self, x):
        return -0.5 * self.G * self.a**2 * np.log(1 - (x / self.a) ** 2)

    def value(self, x):
        return self.G * x / (1 - (x / self.a) ** 2)

    def tangent(self, x):
        share = (x / self.a) ** 2
        return self.G * (1 + share) / (1 - share) ** 2


def one_quad(points=ONE_QUAD) -> MeshQuad:
    """A mesh of one quadrilateral."""
    return MeshQuad(np.asarray(points), np.arange(4)[:, None])


def distorted(seed: int, size=(3, 2), jitter=0.35) -> MeshQuad:
    """A small mesh of a 3 mm × 2 mm rectangle with jittered nodes."""
    return rectangle(3, 2, size, "irregular", jitter, seed)


def fit_mesh(mesh, formulation):
    """The mesh, cut or split as the formulation requires."""
    if isinstance(formulation, Macro):
        return split(mesh)
    needs_cut = isinstance(formulation, Quadratic) and not isinstance(mesh, MeshTri)
    return cut(mesh) if needs_cut else mesh


def distorted_for(formulation, seed: int):
    """A small distorted mesh of the formulation's cells; no triangle is thin."""
    jitter = 0.2 if isinstance(formulation, Quadratic) else 0.35
    return fit_mesh(distorted(seed, jitter=jitter), formulation)


def random_u(ply, seed: int, amplitude: float | None = None) -> np.ndarray:
    """An arbitrary displacement, up to a fraction of the element size.

    The default is smaller for quadratic triangles, whose nodes are closer together.
    """
    if amplitude is None:
        amplitude = 0.015 if isinstance(ply.formulation, Quadratic) else 0.05
    rng = np.random.default_rng(seed)
    return amplitude * rng.standard_normal(ply.basis.N)


#: Formulations, each with the kind of mesh that `rectangle` makes for it.
FORMULATIONS_ON_MESHES = {
    "full": (Full(), "irregular"),
    "one point": (OnePoint(), "irregular"),
    "macro, quads": (Macro(), "irregular"),
    "macro, triangles": (Macro(), "delaunay"),
    "quadratic": (Quadratic(), "delaunay"),
    "quadratic, mean": (Quadratic(80.0), "delaunay"),
}


def derivative(function, x, direction, step=1e-5):
    """Central difference of fourth order of ``function`` along ``direction``."""

    def difference(h):
        return (function(x + h * direction) - function(x - h * direction)) / (2 * h)

    return (4 * difference(step) - difference(2 * step)) / 3


def assert_derivatives(ply, u, du, parameters=None, step=1e-5, rel=1e-6):
    """Residual and tangent are derivatives of the energy along ``du``.

    Central differences with parameters held fixed; ``rel`` is relative to the energy.
    """

    def energy(x):
        return ply.energy(x, 1.0, parameters)

    def residual(x):
        return ply.residual(x, 1.0, parameters)

    slope = derivative(energy, u, du, step)
    assert slope == pytest.approx(residual(u) @ du, rel=rel)
    K = ply.tangent(u, 1.0, parameters)
    change, error = derivative(residual, u, du, step), 1e-8 * abs(K).max()
    np.testing.assert_allclose(change, K @ du, atol=error)


def values_at_rest(term):
    """Values of the parameters of a term at rest."""
    return Values() if term.parameters is None else term.parameters.at_rest()


def defined(forms):
    """The forms as scikit-fem evaluates their functions, without a kernel."""
    functions, kinds = (x.form for x in forms), (Functional, LinearForm, BilinearForm)
    return Forms(*(kind(x) for kind, x in zip(kinds, functions, strict=True)))


def form_parameters(term, t=1.0):
    """Parameters of the forms of a term at rest, beside the displacement."""
    return term._form_parameters(t, values_at_rest(term))


def acting_tension(ply, u, parameters=None):
    """Tensions that act on the nodes, including the contribution of deviations."""
    return ply.predicted_tension(u, np.zeros_like(u), parameters)


def arguments_of(state):
    """Displacement, load factor and parameters of a state."""
    return state.u, state.load_factor, state.parameters


def forces_of(result, number=-1):
    """Nodal forces of a state of a result, shape (d, n_nodes)."""
    ply = result.ply
    return ply.nodal(ply.residual(*arguments_of(result.states[number])))


def zero_modes(K):
    """Number of free motions without stiffness; no motion may have a negative one."""
    values = np.linalg.eigvalsh(K.toarray())
    assert values[0] > -1e-9 * values[-1]
    return int((np.abs(values) < 1e-9 * values[-1]).sum())


def graded_along_fibres(width, theta, n, smallest) -> MeshTri:
    """A bias extension of height 2W tan θ in triangles with edges along the fibres.

    There are 6n + 1 lines along each family, densest at the kinks of the exact motion,
    where their distance is this fraction of half a fibre across the ply.
    """
    c, s = np.cos(theta), np.sin(theta)
    ratio = brentq(lambda r: smallest * (r ** np.arange(n)).sum() - 0.5, 1.0, 100.0)
    steps = ratio ** np.arange(n)
    steps *= 0.5 / steps.sum()
    third = np.cumsum([0.0, *steps, *steps[::-1]])
    lines = np.unique(np.concatenate([third, third + 1, third + 2]).round(12))
    outline = shapely.box(0, 0, width, 2 * width * s / c)
    A = width / (2 * c) * np.array([[c, -c], [s, s]])
    return MeshTri(*cut_cells(outline, A, lines, lines - 1))


class Coupled(BiaxialLaw):
    """ψ = ½ E (ε₁² + ε₂²) + C ε₁ ε₂ + E (ε₁ + 2 ε₂)⁴."""

    def __init__(self, stiffness, coupling):
        self.E, self.C = stiffness, coupling

    def energy(self, strain):
        warp, weft = strain
        plain = 0.5 * self.E * (warp**2 + weft**2) + self.C * warp * weft
        return plain + self.E * (warp + 2 * weft) ** 4

    def value(self, strain):
        warp, weft = strain
        cubic = 4 * self.E * (warp + 2 * weft) ** 3
        uncoupled = self.E * strain + self.C * strain[::-1]
        return uncoupled + np.array([cubic, 2 * cubic])

    def tangent(self, strain):
        warp, weft = strain
        square = 12 * self.E * (warp + 2 * weft) ** 2
        cross = self.C + 2 * square
        return np.array([[self.E + square, cross], [cross, self.E + 4 * square]])


class Pretensioned:
    """T = T₀ + E ε."""

    domain = (-np.inf, np.inf)

    def __init__(self, stiffness, tension):
        self.E, self.T = stiffness, tension

    def energy(self, x):
        return self.T * x + 0.5 * self.E * x**2

    def value(self, x):
        return self.T + self.E * x

    def tangent(self, x):
        return np.full(np.shape(x), self.E)


#: Points and cells of one triangle beside one quadrilateral.
TRIANGLE_AND_QUAD = (
    np.array([[0.0, 1.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 1.0, 0.5]]),
    [np.array([[1], [4], [2]]), np.array([[0], [1], [2], [3]])],
)


def graph(s, height):
    """Points, (3, n²), and triangles, (3, 2 (n − 1)²), of z = h(x, y), x and y in s."""
    x, y = (a.ravel() for a in np.meshgrid(s, s))
    n = len(s)
    k = np.add.outer(n * np.arange(n - 1), np.arange(n - 1)).ravel()
    t = np.hstack([[k, k + 1, k + n + 1], [k, k + n + 1, k + n]])
    return np.array([x, y, height(x, y) + 0 * x]), t


def sphere(n):
    """Points, (3, n), on a spiral around the unit sphere, and 2n − 4 triangles."""
    k = np.arange(n) + 0.5
    polar, around = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    x = np.array([np.cos(around), np.sin(around), np.ones(n)])
    x[:2] *= np.sin(polar)
    x[2] = np.cos(polar)
    return x, facing_outwards(x, ConvexHull(x.T).simplices.T)


def facing_outwards(x, triangles):
    """Triangles around the origin, reversed if their normals point inwards."""
    t = triangles.copy()
    a, b, c = x[:, t].swapaxes(0, 1)
    inwards = (np.cross(b - a, c - a, axis=0) * a).sum(axis=0) < 0
    t[1:, inwards] = t[:0:-1, inwards]
    return t


def refused(call, text):
    """The message of a `ValueError` of a call: one line that matches a pattern."""
    with pytest.raises(ValueError, match=text) as error:
        call()
    assert "\n" not in str(error.value)
    return str(error.value)


def full_disk(*_, **__):
    """Raises the error of writing to a full disk."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
