"""Plates: the deflection of simply supported squares."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from skfem_textile import BodyForce, Fabric, OnePoint, Ply, Quadratic
from tests.helpers.bent_plies import SIDE, D, inclined, square


def bending(ply):
    return next(term for term in ply.terms if term.name == "bending")


def across(ply):
    """The matrix of the displacement along z."""
    return bending(ply).matrix[2::3, 2::3].tocsr()


def plate(mesh, degrees, formulation, held, ends=None):
    """Deflection under p sin sin over the largest exact one; pinned where held."""
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
    w[free] = spsolve(across(ply)[free][:, free].tocsc(), f[free])
    families = 2 if degrees % 90 == 0 else 4
    return w * families * D * (np.pi / SIDE) ** 4 - shape


def on_sides(x, y):
    return (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > SIDE - 1e-9)


@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("degrees", [0, 45])
def test_a_simply_supported_plate_is_of_second_order(degrees, jitter):
    coarse, fine = (
        np.abs(plate(square(n, jitter), degrees, OnePoint(), on_sides)).max()
        for n in (8, 16)
    )
    assert fine < 0.02
    assert coarse / fine > 3


@pytest.mark.parametrize("degrees", [0, 45])
def test_quadratic_triangles_are_of_second_order_too(degrees):
    coarse, fine = (
        np.abs(plate(square(n, 0.2), degrees, Quadratic(), on_sides)).max()
        for n in (8, 16)
    )
    assert fine < 0.012
    assert coarse / fine > 3


@pytest.mark.parametrize("formulation", [OnePoint(), Quadratic()], ids=["quad", "tri"])
@pytest.mark.parametrize("degrees", [0, 45])
def test_planes_of_symmetry_stand_for_the_other_half(degrees, formulation):
    """A quarter of the plate."""
    ends = {"right": "mirror", "top": "mirror"}
    errors = [
        np.abs(
            plate(
                square(n, side=SIDE / 2).with_defaults(),
                degrees,
                formulation,
                lambda x, y: np.minimum(x, y) < 1e-9,
                ends,
            )
        ).max()
        for n in (4, 8)
    ]
    assert errors[1] < 0.04
    assert errors[0] / errors[1] > 2.5
