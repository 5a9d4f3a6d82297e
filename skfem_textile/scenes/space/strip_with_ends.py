"""The mesh of a strip that is held at its left and right ends."""

from skfem import Mesh

from ...mesh.checks import MeshError, check_mesh, with_edges
from ..rectangle import rectangle

#: Names of its ends.
ENDS = ("left", "right")


def strip_with_ends(
    scene: str,
    mesh: str | Mesh,
    sides: tuple[float, float],
    size: tuple[int, int],
    jitter: float,
    seed: int,
) -> Mesh:
    """A mesh whose ends are named ``left`` and ``right``.

    Parameters
    ----------
    scene
        Name of the scene, for errors.
    mesh
        A mesh, or the kind of `rectangle` to make.
    sides
        Length and width in mm of one to make.
    size, jitter, seed
        As for `rectangle`.

    Raises
    ------
    ValueError
        If the mesh is not valid, or has no such end.
    """
    if isinstance(mesh, str):
        return rectangle(*sides, size, mesh, jitter, seed)
    check_mesh(mesh)
    mesh = with_edges(mesh)
    for name in ENDS:
        if name not in mesh.boundaries:
            raise MeshError(f"{scene}: the mesh has no straight {name} edge")
    return mesh
