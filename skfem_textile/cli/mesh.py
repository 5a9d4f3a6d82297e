"""The mesh that the options of a run describe, and the scene on it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..mesh.user_input import printable
from ..registration import Option, SceneRegistration, angle
from ..scenes import SCENES, Scene
from ..scenes.rectangle import KINDS

_SEED = 1


def mesh_options(scene: SceneRegistration) -> tuple[Option, ...]:
    """The options of a scene's mesh."""
    nx, ny = scene.size
    return (
        Option(
            name="mesh",
            help=f"{', '.join(KINDS)}, or a file of quadrilaterals or triangles",
            default="irregular",
            metavar="KIND|FILE",
        ),
        Option(
            name="size",
            help="elements along x and y of a mesh to make, before they are split "
            f"(default: {nx}x{ny})",
            read=_size,
        ),
        Option(
            name="jitter",
            help=f"its node moves per spacing (default: {scene.jitter:g})",
            read=float,
        ),
        Option(
            name="seed", help=f"seed of its node moves (default: {_SEED})", read=int
        ),
        angle("rotate", 0.0, "turn it all"),
    )


def scene_of(values: Mapping[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """The scene on its mesh, and the values, completed for a generated mesh.

    Parameters
    ----------
    values
        Values of the options by their keys.
    """
    registration, mesh = SCENES[values["scene"]], values["mesh"]
    if mesh not in KINDS and not Path(mesh).is_file():
        raise ValueError(
            f"--mesh {printable(mesh)}: neither a file nor {', '.join(KINDS)}"
        )
    values = _completed(values, registration)
    if mesh not in KINDS:
        from ..io import read_mesh  # loads meshio

        mesh = read_mesh(mesh)
    own = {option.key: values[option.key] for option in registration.options}
    made = {name: values[name] for name in ("size", "jitter", "seed")}
    scene = registration.build(mesh=mesh, **made, **own)
    return scene.rotated(np.radians(values["rotate"])), values


def _completed(values: Mapping[str, Any], scene: SceneRegistration) -> dict[str, Any]:
    """Fill in defaults of a generated mesh; refuse its options beside a mesh file."""
    made = {"size": scene.size, "jitter": scene.jitter, "seed": _SEED}
    if values["mesh"] in KINDS:
        given = {name: values[name] for name in made if values[name] is not None}
        return {**values, **made, **given}
    for name in made:
        if values[name] is not None:
            raise ValueError(
                f"--{name} is of a mesh to make, but --mesh names a file: leave one of "
                "them out"
            )
    return dict(values)


def _size(word: str) -> tuple[int, int]:
    try:
        nx, ny = (int(n) for n in word.split("x"))
    except ValueError:
        raise ValueError(f"{word!r} is not like 10x15") from None
    return nx, ny
