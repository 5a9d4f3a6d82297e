"""Messages about meshes; those about defects are in `test_hostile_meshes`."""

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTri

from skfem_textile import Fabric, Ply
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.splitting import cut, split, split_cells
from tests.helpers import TRIANGLE_AND_QUAD, refused

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
