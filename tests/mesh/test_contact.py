"""Meshes that touch or overlap themselves are rejected, except for cuts."""

import time

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import MeshError
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.hostile import sheets

SHEET = rectangle(4, 4, (4, 4), "aligned")


def together(a, b):
    """Two meshes as one without common nodes."""
    return type(a)(*sheets.joined(a, b))


def opened(mesh, ends, by=0.0):
    return MeshQuad(*sheets.opened(mesh, *ends, by))


def fans(*sectors):
    return MeshQuad(*sheets.fans(*sectors))


def turned_over(mesh):
    return MeshQuad(mesh.p, mesh.t[::-1])


def moved(mesh, x, y, scale=1.0):
    return mesh.scaled((scale, scale)).translated((float(x), float(y)))


COARSE = rectangle(4, 4, (3, 3), "aligned")
TRIANGLES = cut(SHEET)
ON_TOP = "lie on top of others, edge on edge: 0"
CROSS = "overlap others that are not neighbours, where the boundary crosses itself"
INSIDE = (
    "others that are not neighbours, because one part of the mesh lies inside another"
)
HANG = "lie in the interior of an edge.*: "
DOUBLED = "coincide with others: "

REFUSED = {
    "two layers": (together(SHEET, SHEET), ON_TOP),
    "a layer turned over": (together(SHEET, turned_over(SHEET)), ON_TOP),
    "layers of triangles": (together(TRIANGLES, TRIANGLES), ON_TOP),
    "layers of other meshes": (together(SHEET, COARSE), HANG),
    "a layer shifted by elements": (together(SHEET, moved(SHEET, 1, 0)), "on top of"),
    "a layer shifted": (
        together(SHEET, moved(SHEET, 0.3, 1.3)),
        rf"4 quad.* {CROSS}: 7, 12, 19, 24",
    ),
    "a patch on the sheet": (together(SHEET, moved(SHEET, 1.3, 1.3, 0.1)), INSIDE),
    "a seam": (together(SHEET, moved(SHEET, 4, 0)), rf"10 node.* {DOUBLED}4, 9, 14"),
    "a seam to round-off": (together(SHEET, moved(SHEET, 4 + 1e-8, 0)), DOUBLED),
    "a seam between other meshes": (
        together(SHEET, moved(COARSE, 4, 0)),
        rf"5.*{HANG}",
    ),
    "half a seam": (opened(SHEET, (0, 1)), rf"4 node.* {DOUBLED}2, 7, 25, 26"),
    "all of a seam": (opened(SHEET, (0, 4)), rf"10 node.* {DOUBLED}2"),
    "pieces at a corner": (together(SHEET, moved(SHEET, 4, 4)), rf"{DOUBLED}24, 25"),
    "fans that overlap": (fans((0, 90, 1), (45, 135, 1)), CROSS),
    "a fan in a fan": (fans((0, 90, 1), (30, 60, 0.3)), INSIDE),
}


@pytest.mark.parametrize("case", REFUSED)
def test_overlapping_meshes_are_rejected(case):
    mesh, message = REFUSED[case]
    with pytest.raises(MeshError, match=message):
        check_mesh(mesh)


def test_an_inclusion_that_was_not_merged_is_rejected():
    whole = rectangle(4, 4, (8, 8), "aligned")
    x, y = whole.p[:, whole.t].mean(axis=1)
    inside = (np.abs(x - 2) < 1) & (np.abs(y - 2) < 1)
    hole = whole.restrict(np.flatnonzero(~inside), False, True)
    rest = whole.restrict(np.flatnonzero(inside), False, True)
    check_mesh(hole)
    with pytest.raises(MeshError, match=rf"32 node.* {DOUBLED}"):
        check_mesh(together(hole, rest))


@pytest.mark.parametrize(
    "mesh",
    [
        opened(SHEET, (2, 2)),
        opened(SHEET, (1, 3)),
        split(opened(SHEET, (1, 3))),
        cut(opened(SHEET, (1, 3))),
        opened(SHEET, (0, 1), by=0.01),
        together(SHEET, moved(SHEET, 4.01, 0)),
        fans((0, 90, 1), (180, 270, 1)),
        fans((-60, 40, 1), (90, 170, 1), (190, 270, 2)),
        MeshTri.init_circle(3),
    ],
    ids=[
        *("cut of two edges", "cut of four", "split", "triangles", "open cut"),
        *("two pieces", "two fans", "three fans", "a circle"),
    ],
)
def test_cuts_and_separate_pieces_are_accepted(mesh):
    check_mesh(mesh)


def test_nested_rings_without_contact_are_accepted():
    whole = rectangle(4, 4, (8, 8), "aligned")
    x, y = np.abs(whole.p[:, whole.t].mean(axis=1) - 2)
    far = np.maximum(x, y)
    rings = whole.restrict(np.flatnonzero((far > 1.5) | (far < 1)), False, True)
    check_mesh(rings)


def test_crossing_cuts_are_accepted():
    """All four quadrilaterals around a position have separate nodes there."""
    centre = int(np.flatnonzero((SHEET.p == 2).all(axis=0))[0])
    t, p = SHEET.t, SHEET.p
    quadrant = (p[:, t].mean(axis=1) > 2).astype(int).T @ [1, 2]
    twins = [centre, *(p.shape[1] + np.arange(3))]
    t = np.where(t == centre, np.array(twins)[quadrant], t)
    check_mesh(MeshQuad(np.column_stack([p, *[p[:, centre]] * 3]), t))


def test_large_meshes_are_checked_in_a_fraction_of_a_second():
    mesh = rectangle(40, 60, (200, 300), "irregular", 0.3, seed=1)
    mesh.t2f  # noqa: B018 - scikit-fem's own, which every basis needs
    seconds = []
    for _ in range(3):
        start = time.process_time()
        check_mesh(mesh)
        seconds.append(time.process_time() - start)
    assert min(seconds) < 1.0


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (MeshQuad([[0.0, 1, np.nan, 0], [0, 0, 1, 1]]), r"1 node.* not finite: 2"),
        (MeshQuad([[0.0, np.inf, 1, 0], [0, 0, 1, 1]]), r"1 node.* not finite: 1"),
        (
            MeshQuad([[0.0, 1e200, 1, 0], [0, 0, 1, 1]]),
            r"coordinates beyond ±1e\+100.*: 1",
        ),
        (MeshQuad(SHEET.p, SHEET.t - 1), r"1 quad.* refer to an undefined node: 0"),
        (MeshQuad(SHEET.p, SHEET.t + 1), r"1 quad.* refer to an undefined.*: 15"),
        (SHEET.with_boundaries({"a\n": np.array([99])}), r"'a\\n': its numbers must"),
        (SHEET.with_boundaries({"b": np.array([-1])}), "boundary 'b': .* from 0 to 39"),
    ],
)
def test_invalid_positions_and_numbers_are_reported_in_one_line(mesh, message):
    with pytest.raises(MeshError, match=message) as error:
        check_mesh(mesh)
    assert "\n" not in str(error.value)
