"""Options of a scene and its mesh."""

from ...registration import Option, SceneRegistration, angle
from ...scenes.rectangle import KINDS

#: Seed of the node moves of a mesh to make.
SEED = 1


def scene_options(scene: SceneRegistration) -> tuple[Option, ...]:
    """The options that are the scene's own, and how far it is turned in its plane."""
    if scene.dimension == 3:
        return scene.options
    return (*scene.options, angle("rotate", 0.0, "turn it all"))


def mesh_options(scene: SceneRegistration) -> tuple[Option, ...]:
    """The options of a scene's mesh."""
    nx, ny = scene.size
    return (
        Option(
            name="mesh",
            help=f"{', '.join(KINDS)}, or a file of quadrilaterals or triangles",
            default="irregular",
            metavar="KIND|FILE",
            names_file=is_mesh_file,
        ),
        Option(
            name="size",
            help="elements along x and y of a mesh to make, before they are split "
            f"(default: {nx}x{ny})",
            read=_size,
            in_file=tuple[int, int],
        ),
        Option(
            name="jitter",
            help=f"its node moves per spacing (default: {scene.jitter:g})",
            read=float,
        ),
        Option(name="seed", help=f"seed of its node moves (default: {SEED})", read=int),
    )


def is_mesh_file(word: str) -> bool:
    """Whether a word is the name of a file, and not the kind of a mesh to make."""
    return word not in KINDS


def _size(word: str) -> tuple[int, int]:
    try:
        nx, ny = (int(n) for n in word.split("x"))
    except ValueError:
        raise ValueError(f"{word!r} is not like 10x15") from None
    return nx, ny
