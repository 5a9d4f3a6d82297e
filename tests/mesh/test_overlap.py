"""Meshes may touch themselves along cuts only; defects are in `test_hostile_meshes`."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import MeshError
from skfem_textile.mesh import overlap
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.hostile.sheets import fans, joined, opened, sheet, shifted

SHEET = sheet()


def clockwise(base):
    return base._replace(t=base.t[::-1])


def nested_rings():
    whole = rectangle(4, 4, (8, 8), "aligned")
    far = np.abs(whole.p[:, whole.t].mean(axis=1) - 2).max(axis=0)
    return whole.restrict(np.flatnonzero((far > 1.5) | (far < 1)), False, True)


def crossing_cuts():
    """All four quadrilaterals around a position have separate nodes there."""
    centre = int(np.flatnonzero((SHEET.p == 2).all(axis=0))[0])
    t, p = SHEET.t, SHEET.p
    quadrant = (p[:, t].mean(axis=1) > 2).astype(int).T @ [1, 2]
    twins = [centre, *(p.shape[1] + np.arange(3))]
    t = np.where(t == centre, np.array(twins)[quadrant], t)
    return MeshQuad(np.column_stack([p, *[p[:, centre]] * 3]), t)


ACCEPTED = {
    "a cut of two edges": MeshQuad(*opened(SHEET, 2, 2)),
    "three fans": MeshQuad(*fans((-60, 40, 1), (90, 170, 1), (190, 270, 2))),
    "a circle": MeshTri.init_circle(3),
    "nested rings": nested_rings(),
    "crossing cuts": crossing_cuts(),
}


@pytest.mark.parametrize("mesh", ACCEPTED.values(), ids=ACCEPTED)
def test_cuts_and_separate_pieces_are_accepted(mesh):
    check_mesh(mesh)


@pytest.mark.parametrize(
    ("mesh", "named"),
    [
        (joined(SHEET, shifted(SHEET, 0.3, 1.3)), r"crosses itself: 7, 12, 19, 24"),
        (opened(SHEET, 0, 1), r"coincide with others: 2, 7, 25, 26"),
        (opened(SHEET, 0, 4), r"coincide with others: 2, 7, 12"),
        (joined(SHEET, shifted(SHEET, 4, 4)), r"coincide with others: 24, 25"),
        (joined(SHEET, clockwise(shifted(SHEET, 1.3, 1.3, 0.1))), "inside another: 28"),
    ],
)
def test_elements_and_nodes_in_contact_are_named(mesh, named):
    with pytest.raises(MeshError, match=named):
        check_mesh(MeshQuad(*mesh))


def test_only_close_edges_are_compared(monkeypatch):
    """Each of 256 edges with itself and the next ones; a corner is missing."""
    monkeypatch.setattr(overlap, "_MOST_PAIRS", 1000)
    mesh = MeshQuad().refined(6)
    corner = mesh.p[:, mesh.t].mean(axis=1).sum(axis=0).argmin()
    check_mesh(mesh.restrict(np.delete(np.arange(mesh.nelements), corner), False, True))


def two_turns():
    """A ring of cells that winds around its hole twice."""
    angle = np.linspace(0, 4 * np.pi, 41)
    p = np.hstack([r * np.array([np.cos(angle), np.sin(angle)]) for r in (1, 2)])
    i = np.arange(40)
    return MeshQuad(p, np.array([i, i + 41, i + 42, i + 1]))


CONVEX = {
    "a rectangle": MeshQuad().refined(3),
    "a circle": MeshTri.init_circle(3),
    "clockwise cells": MeshQuad(MeshQuad().p, MeshQuad().t[::-1]),
}
OTHERS = {
    **ACCEPTED,
    "a notch": MeshQuad().refined(2).restrict(np.arange(1, 16), False, True),
    "two turns": two_turns(),
    "two squares": MeshQuad(*joined(SHEET, shifted(SHEET, 9, 9))),
}
del OTHERS["a circle"]


def test_only_a_convex_loop_is_not_searched_for_overlaps():
    found = {k: overlap.is_convex(overlap.boundary_of(m)) for k, m in CONVEX.items()}
    assert all(found.values())
    found = {k: overlap.is_convex(overlap.boundary_of(m)) for k, m in OTHERS.items()}
    assert not any(found.values()), found
