"""A holder presses with its pressure times the area of the ply within its outline.

Random outlines on irregular meshes, at rest and moved, are in `test_hostile_holders`.
"""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Fabric, Holder, Ply, Tool, drape

PRESSURE, PLANE = 0.005, drape.Plane((0.0, 0.0, 0.15))


def square(n):
    s = np.linspace(-80.0, 80.0, n + 1)
    return MeshQuad.init_tensor(s, s)


def box(x_0, x_1, y_0, y_1):
    return np.array([[x_0, x_1, x_1, x_0], [y_0, y_0, y_1, y_1]], dtype=float)


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
