"""Messages about meshes; those about defects are in `test_hostile_meshes`."""

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTri

from skfem_textile import Fabric, Full, Ply
from skfem_textile.mesh.checks import check_mesh, refuse_metres
from skfem_textile.mesh.extents import warn_of_outline
from skfem_textile.mesh.splitting import cut, split, split_cells
from skfem_textile.mesh.user_input import shortened
from tests.helpers import TRIANGLE_AND_QUAD, one_quad, refused
from tests.helpers.hostile.sheets import joined, sheet, shifted

SHEET = MeshQuad().refined(2)
ENDS = {"clamp\n": np.array([[0, 0, 3], [1, 2, 4]])}


def with_edge(name, number):
    return SHEET.with_boundaries({name: np.array([number])})


def averaged(*shape):
    return lambda: Ply(SHEET, Fabric()).on_users_elements(np.zeros(shape))


MESSAGES = [
    (lambda: check_mesh(with_edge("a\n", 99)), r"'a\\n': its numbers must"),
    (lambda: check_mesh(with_edge("b", -1)), "boundary 'b': .* from 0 to 39"),
    (lambda: split(MeshHex()), "straight edges can be split, not MeshHex"),
    (lambda: cut(MeshTri()), r"only a skfem.MeshQuad can be cut"),
    (lambda: cut(None), r"only a skfem.MeshQuad can be cut"),
    (
        lambda: split_cells(*TRIANGLE_AND_QUAD, ENDS),
        r"boundary 'clamp\\n': no edge of the mesh joins nodes 0 and 2, at "
        r"\(0, 0\) and \(1, 1\), or 1 further pair",
    ),
    (
        lambda: check_mesh(
            MeshTri(np.full((2, 12), np.nan), np.arange(12).reshape(3, 4))
        ),
        r"12 .*: 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, \.\.\.",
    ),
    (
        lambda: Ply(SHEET, Fabric()).on_users_nodes(np.zeros(6)),
        r"each of the 81 nodes of ply\.nodes",
    ),
    (averaged(6), r"each of the 64 elements of ply\.mesh"),
    (averaged(64, 1), r"each of the 64 elements of ply\.mesh"),
    (averaged(), r"each of the 64 elements of ply\.mesh"),
]


@pytest.mark.parametrize(("call", "text"), MESSAGES)
def test_the_message_is_one_line_about(call, text):
    refused(call, text)


def checked_triangle(height, scale=1.0):
    p = scale * np.array([[0.0, 1.0, 0.5], [0.0, 0.0, height]])
    check_mesh(MeshTri(p, np.arange(3)[:, None]))


def checked_gap(gap):
    check_mesh(MeshQuad(*joined(sheet(), shifted(sheet(), 4.0 + gap, 4.0))))


@pytest.mark.parametrize(
    ("call", "accepted", "value", "text"),
    [
        (lambda scale: checked_triangle(1.0, scale), 3e-100, 3e-101, "degenerate"),
        (checked_gap, 3e-6, 3e-7, "coincide with others: 24, 25"),
        (lambda side: refuse_metres(side * SHEET.p), 1 - 3e-10, 1 - 3e-9, "in metres"),
    ],
)
def test_a_mesh_is_refused_beyond_a_limit(call, accepted, value, text):
    call(accepted)
    refused(lambda: call(value), text)


def test_a_triangle_of_nearly_no_area_is_degenerate():
    refused(lambda: checked_triangle(3e-9), "in the interior of an edge: 2")
    refused(lambda: checked_triangle(3e-10), "degenerate")


@pytest.mark.parametrize(("height", "is_flat"), [(3e-10, True), (3e-9, False)])
def test_a_flat_corner_has_no_area_ratio(height, is_flat):
    mesh = one_quad([[0, 1, 0.5 + height, 0], [0, 0, 0.5 + height, 1]])
    ply = Ply(mesh, Fabric(), Full())
    assert np.isinf(ply.corners.area_ratio(ply.basis.zeros())).any() == is_flat


@pytest.mark.parametrize(("excess", "ends"), [(3e-10, {1, 3}), (3e-9, {0, 2})])
def test_the_cut_of_a_parallelogram_does_not_depend_on_rounding(excess, ends):
    far = 1.0 + excess
    first, second = cut(one_quad([[0, 1, far, 0], [0, 0, far, 1]])).t.T
    assert {*first} & {*second} == ends


@pytest.mark.parametrize(("extent", "doubtful"), [(5.5, False), (4.5, True)])
def test_an_outline_and_tools_of_two_units_are_told(extent, doubtful, caplog):
    tools = [np.diag([x, 1.0, 0.0]) for x in (100.0, 10.0)]
    warn_of_outline("ply.csv", np.diag([extent, 1.0]), tools)
    assert ("check the units" in caplog.text) == doubtful


def test_a_value_in_a_message_has_at_most_sixty_characters():
    assert [shortened("x" * n) for n in (58, 59)] == [repr("x" * 58), "str"]
