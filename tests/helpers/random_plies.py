"""Random laws, meshes, fibres and motions, for the library and for `independent`.

The order of nodes in cells is random too.  No element is close to folding.
"""

import numpy as np
from scipy.spatial import Delaunay
from skfem import MeshQuad, MeshTri

from skfem_textile import CrimpInterchange, Linear, Sin2
from skfem_textile.mesh.splitting import split, split_cells
from tests.helpers import independent as plain

# Laws: arguments of `Fabric`, and the same for the independent implementation


class Softening(Linear):
    """Energy ½ k x²/(1 + (x/s)²), s = 0.4: softer, the more it deforms."""

    def energy(self, x):
        return self.stiffness * x**2 / 2 / (1 + 6.25 * x**2)

    def value(self, x):
        return self.stiffness * x / (1 + 6.25 * x**2) ** 2

    def tangent(self, x):
        return self.stiffness * (1 - 18.75 * x**2) / (1 + 6.25 * x**2) ** 3


class Crimped(Linear):
    """Energy k x⁴/4: no stiffness at rest."""

    def energy(self, x):
        return self.stiffness * x**4 / 4

    def value(self, x):
        return self.stiffness * x**3

    def tangent(self, x):
        return 3 * self.stiffness * x**2


def linear(k):
    return k, plain.Law(lambda x: k * x * x / 2, lambda x: k * x, k)


def sin2(k):
    def energy(x):
        return k / 2 * np.sin(x) ** 2

    return Sin2(k), plain.Law(energy, lambda x: k * np.sin(x) * np.cos(x), k)


def softening(k):
    def energy(x):
        return k * x * x / 2 / (1 + (x / 0.4) ** 2)

    def value(x):
        return k * x / (1 + (x / 0.4) ** 2) ** 2

    return Softening(k), plain.Law(energy, value, k)


def crimped(k):
    return Crimped(k), plain.Law(lambda x: k * x**4 / 4, lambda x: k * x**3, 0.0)


NONE = 0.0, None


def pair(warp, weft):
    return (warp[0], weft[0]), (warp[1], weft[1])


def interchange(*parameters):
    return CrimpInterchange(*parameters), plain.interchange(*parameters)


TENSIONS = (
    pair(linear(1e4), linear(1e4)),
    pair(softening(500.0), linear(3e3)),
    pair(linear(200.0), NONE),
    pair(crimped(3e4), linear(80.0)),
    interchange((1e3, 1e3), (0.04, 0.04), 3.0, 0.02, 1.0),
    interchange((2e3, 300.0), (0.15, 0.01), 0.5, 0.1, 20.0),
)
SHEARS = linear(0.5), sin2(0.7), softening(2.0), NONE, crimped(1.5)


# Meshes


def grid(rng):
    """Nodes of a jittered grid, and its cells with their nodes in random order."""
    n = 3, 2
    x, y = np.meshgrid(np.arange(n[0] + 1.0), np.arange(n[1] + 1.0))
    X = np.array([x.ravel(), y.ravel()])
    X += rng.uniform(-0.22, 0.22, X.shape)
    skew = np.array([[1.0, rng.uniform(-0.3, 0.3)], [rng.uniform(-0.3, 0.3), 1.2]])
    number = np.arange(x.size).reshape(x.shape)
    cells = []
    for i in range(n[1]):
        for j in range(n[0]):
            cell = number[[i, i, i + 1, i + 1], [j, j + 1, j + 1, j]]
            cells.append(np.roll(cell, rng.integers(4))[:: rng.choice([-1, 1])])
    return skew @ X, cells


def quads(rng):
    X, cells = grid(rng)
    return MeshQuad(X, np.transpose(cells)), None


def triangles(rng):
    X, _ = grid(rng)
    cells = [c for c in Delaunay(X.T).simplices if plain.polygon(X[:, c]) > 0.1]
    return MeshTri(X, np.transpose(cells)), None  # without slivers along the hull


def split_quads(rng):
    mesh, _ = quads(rng)
    return split(mesh), mesh.t.T


def split_triangles(rng):
    mesh, _ = triangles(rng)
    return split(mesh), mesh.t.T


def split_both(rng):
    """Some of the quadrilaterals cut in two triangles."""
    X, cells = grid(rng)
    halves = [cell[three] for cell in cells[::2] for three in ([0, 1, 2], [2, 3, 0])]
    kinds = [np.transpose(halves), np.transpose(cells[1::2])]
    return split_cells(X, kinds), [*halves, *cells[1::2]]


def with_middles(mesh):
    """Nodes and cells of a mesh of triangles with nodes on the edges as well."""
    X = np.hstack([mesh.p, mesh.p[:, mesh.facets].mean(axis=1)])
    number = {frozenset(edge): i for i, edge in enumerate(mesh.facets.T.tolist())}
    cells = []
    for a, b, c in mesh.t.T.tolist():
        edges = [number[frozenset(pair)] for pair in ((a, b), (b, c), (c, a))]
        cells.append(np.array([a, b, c, *(mesh.nvertices + i for i in edges)]))
    return X, cells


def macro_elements(mesh, cells):
    """Quadrilaterals that share the node at the centre of an original cell."""
    macros = []
    for cell in cells:
        offsets = mesh.p - mesh.p[:, cell].mean(axis=1, keepdims=True)
        centre = np.argmin(np.hypot(*offsets))
        macros.append([e for e, quad in enumerate(mesh.t.T) if centre in quad])
    return macros


# Fibres


def direction(rng, kind, angle, n_elements):
    """A direction near ``angle`` for the library, and (element, X) -> unit vector."""

    def vector(angle):
        return np.array([np.cos(angle), np.sin(angle)])

    if kind == "vector":
        vectors = rng.uniform(0.5, 2) * vector(angle)
        return vectors, lambda e, X: vector(angle)
    if kind == "one per element":
        angles = angle + rng.uniform(-0.25, 0.25, n_elements)
        vectors = rng.uniform(0.5, 2, n_elements) * vector(angles)
        return vectors, lambda e, X: vector(angles[e])
    a, b = rng.uniform(-0.15, 0.15, 2)

    def field(X):
        return angle + 0.2 * np.sin(1 + a * X[0] + 2 * b * X[1]) + a * X[1]

    return lambda X: (2 + X[0] ** 2) * vector(field(X)), lambda e, X: vector(field(X))


KINDS = "vector", "one per element", "function"


def fibres(rng, seed, n_elements):
    """Warp at any angle, weft at 50° to 130° from it on either side."""
    warp = rng.uniform(0, 2 * np.pi)
    weft = warp + rng.choice([-1, 1]) * np.radians(rng.uniform(50, 130))
    kinds = KINDS[seed % 3], KINDS[seed // 4 % 3]
    pairs = zip(kinds, (warp, weft), strict=True)
    return [direction(rng, kind, angle, n_elements) for kind, angle in pairs]


# Motions


def motion(rng, cloth, turns):
    """Current positions:

    the nodes move at random, or after a large rotation and shear.
    """
    F = np.eye(2)
    if turns:
        A = np.transpose(cloth.fibres(0, cloth.X[:, 0]))
        turn, between = rng.uniform(-np.pi, np.pi), np.radians(rng.uniform(35, 145))
        between *= np.sign(np.linalg.det(A))
        a = [[np.cos(b), np.sin(b)] for b in (turn, turn + between)]
        F = np.transpose(a) @ np.linalg.inv(A)
    moves = 0.15 * rng.standard_normal(cloth.X.shape)
    while plain.smallest_det_F(cloth, F @ cloth.X + moves) < 0.15:
        moves *= 0.8
    return (F @ cloth.X + moves)[..., None]
