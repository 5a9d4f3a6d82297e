"""The mesh that values describe, and the scene on it."""

import filecmp
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh

from ...mesh.user_input import printable
from ...registration import SceneRegistration
from ...scenes import SCENES, Scene
from ...scenes.rectangle import KINDS
from .mesh_options import SEED, is_mesh_file


def scene_of(values: Mapping[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """The scene on its mesh, and the values, completed for a generated mesh.

    Parameters
    ----------
    values
        Values of the options by their keys.
    """
    registration, mesh = SCENES[values["scene"]], values["mesh"]
    if is_mesh_file(mesh) and not Path(mesh).is_file():
        raise ValueError(
            f"--mesh {printable(mesh)}: neither a file nor {', '.join(KINDS)}"
        )
    values = _completed(values, registration)
    if is_mesh_file(mesh):
        mesh = _read(mesh, values)
    own = {option.key: values[option.key] for option in registration.options}
    made = {name: values[name] for name in ("size", "jitter", "seed")}
    scene = registration.build(mesh=mesh, **made, **own)
    return scene.rotated(np.radians(values["rotate"])), values


def _read(file: str, values: Mapping[str, Any]) -> Mesh:
    """The mesh of a file, of which directions and the fabric may be read too."""
    from ...io import OF_DIRECTIONS, OF_FABRICS, read_mesh  # loads meshio

    given = {"directions": OF_DIRECTIONS, "fabric": OF_FABRICS}
    same = [option for option in given if _is_copy(values[option], file)]
    others = [name for option in same for name in given[option]]
    return read_mesh(file, others)


def _is_copy(named: str | None, file: str) -> bool:
    """Whether a file is another or a copy of it, as a written case has them."""
    try:
        return named is not None and filecmp.cmp(named, file, shallow=False)
    except (OSError, ValueError):  # its reader tells
        return False


def _completed(values: Mapping[str, Any], scene: SceneRegistration) -> dict[str, Any]:
    """Fill in defaults of a generated mesh; refuse its options beside a mesh file."""
    made = {"size": scene.size, "jitter": scene.jitter, "seed": SEED}
    if not is_mesh_file(values["mesh"]):
        given = {name: values[name] for name in made if values[name] is not None}
        return {**values, **made, **given}
    for name in made:
        if values[name] is not None:
            raise ValueError(
                f"--{name} is of a mesh to make, but --mesh names a file: leave one of "
                "them out"
            )
    return dict(values)
