"""What several tests need: distorted meshes and arbitrary states."""

import numpy as np
from skfem import MeshQuad

from skfem_textile import Macro, Quadratic
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.splitting import cut, split

ONE_QUAD = np.array([[0.0, 2.0, 2.3, -0.2], [0.0, 0.3, 1.7, 1.4]])


def one_quad(points=ONE_QUAD) -> MeshQuad:
    """A mesh of one quadrilateral."""
    return MeshQuad(np.asarray(points), np.arange(4)[:, None])


def distorted(seed: int, size=(3, 2), jitter=0.35) -> MeshQuad:
    """A small mesh of a 3 mm × 2 mm rectangle with jittered nodes."""
    return rectangle(3, 2, size, "irregular", jitter, seed)


def fitting(mesh, formulation):
    """The mesh of quadrilaterals, cut or split as the formulation takes it."""
    prepared = {Quadratic: cut, Macro: split}.get(type(formulation))
    return prepared(mesh) if prepared else mesh


def distorted_for(formulation, seed: int):
    """A small distorted mesh of the formulation's cells; no triangle is thin."""
    jitter = 0.2 if isinstance(formulation, Quadratic) else 0.35
    return fitting(distorted(seed, jitter=jitter), formulation)


def wobble(ply, seed: int, amplitude: float | None = None) -> np.ndarray:
    """An arbitrary displacement, as much as a share of the element size.

    By default less of quadratic triangles, whose nodes lie closer.
    """
    if amplitude is None:
        amplitude = 0.015 if isinstance(ply.formulation, Quadratic) else 0.05
    rng = np.random.default_rng(seed)
    return amplitude * rng.standard_normal(ply.basis.N)


def derivative(function, x, direction, step=1e-5):
    """Central difference of ``function`` at ``x`` along ``direction``."""
    ahead, behind = function(x + step * direction), function(x - step * direction)
    return (ahead - behind) / (2 * step)
