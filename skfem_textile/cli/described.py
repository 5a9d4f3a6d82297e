"""What the options of a run describe: a scene, its ply and its load stepper."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from skfem import Mesh, MeshQuad, MeshTri

from ..fabric import Fabric, Law, Sin2
from ..mesh.user_input import printable
from ..ply import Ply
from ..ply.formulations import Full, Macro, OnePoint, Quadratic
from ..ply.loads import Force
from ..ply.terms import Formulation
from ..scenes import Scene, bias_extension, picture_frame, strip, trellis
from ..scenes.rectangle import KINDS
from ..scenes.trellis import Edge, sheared
from ..solve.stepper import LoadStepper
from ..splitting import SplitMesh, cut, split

#: The shear laws, by their names on the command line.
SHEAR_LAWS: dict[str, Callable[[float], float | Law]] = {"linear": float, "sin2": Sin2}


def scene_of(options: argparse.Namespace) -> Scene:
    """The scene, on its mesh."""
    mesh, triangles = options.mesh, options.formulation == Quadratic.name
    if triangles and options.split:
        raise ValueError(
            "--split makes quadrilaterals, --formulation quadratic takes triangles: "
            "leave one of them out"
        )
    if mesh not in KINDS and not Path(mesh).is_file():
        raise ValueError(
            f"--mesh {printable(mesh)}: neither a file nor {', '.join(KINDS)}"
        )
    _complete(options)
    if mesh not in KINDS:
        if not Path(mesh).is_file():
            raise ValueError(
                f"--mesh {printable(mesh)}: neither a file nor {', '.join(KINDS)}"
            )
        from ..io import read_mesh

        mesh = read_mesh(mesh, split=not triangles)
    build = partial(
        _SCENES[options.scene](options),
        size=options.size,
        jitter=options.jitter,
        seed=options.seed,
    )
    scene = build(mesh=mesh)
    fitting = _fitting(scene.mesh, options.split, triangles)
    if fitting is not scene.mesh:
        scene = build(mesh=fitting)
    if options.force:
        scene = replace(scene, misfit="forces act beside the scene's conditions")
    return scene.rotated(np.radians(options.rotate))


def _complete(options: argparse.Namespace) -> None:
    """Fill in what is not given of a mesh to make, and refuse it beside a file."""
    for name, default in options.made.items():
        given = getattr(options, name)
        if options.mesh not in KINDS:
            if given is not None:
                raise ValueError(
                    f"--{name} is of a mesh to make, but --mesh names a file: leave "
                    "one of them out"
                )
        elif given is None:
            setattr(options, name, default)


def _fitting(mesh: Mesh, into: str | None, triangles: bool) -> Mesh:
    """The mesh cut and split as asked, and as triangles or quadrilaterals."""
    if into == "quads" and isinstance(mesh, MeshTri | SplitMesh):
        raise ValueError("--split quads: the mesh has triangles; leave it out")
    if isinstance(mesh, SplitMesh):
        return mesh
    if isinstance(mesh, MeshQuad) and (triangles or into == "triangles"):
        mesh = cut(mesh)
    if into or (isinstance(mesh, MeshTri) and not triangles):
        mesh = split(mesh)
    return mesh


def _picture_frame(options: argparse.Namespace) -> Callable[..., Scene]:
    return partial(picture_frame, shear_angle=np.radians(options.shear_angle))


def _trellis(options: argparse.Namespace) -> Callable[..., Scene]:
    warp, weft = np.radians([options.warp, options.weft])
    turns = sheared(np.radians(options.shear_angle), np.radians(options.bend))
    return partial(trellis, warp=warp, weft=weft, turns=turns, edges=_edges(options))


def _edges(options: argparse.Namespace) -> dict[str, Edge]:
    """What --free and --roller say of each side."""
    edges: dict[str, Edge] = dict.fromkeys(options.free, "free")
    for side, inclination in options.roller:
        if side in edges:
            raise ValueError(
                f"--roller {side}: that side is already free or on a roller"
            )
        edges[side] = float(np.radians(inclination))
    return edges


def _bias_extension(options: argparse.Namespace) -> Callable[..., Scene]:
    warp, weft, gamma = np.radians([options.warp, options.weft, options.shear_angle])
    return partial(
        bias_extension, warp=warp, weft=weft, shear_angle=gamma, part=options.part
    )


_SCENES: dict[str, Callable[[argparse.Namespace], Callable[..., Scene]]] = {
    "strip": lambda options: strip,
    "picture_frame": _picture_frame,
    "trellis": _trellis,
    "bias_extension": _bias_extension,
}


def stepper_of(scene: Scene, options: argparse.Namespace) -> LoadStepper:
    """The load stepper of a ply of the scene."""
    try:
        shear = SHEAR_LAWS[options.shear_law](options.shear_stiffness)
    except ValueError as error:
        raise ValueError(f"shear {error}") from None
    fabric = Fabric(options.fibre_stiffness, shear, scene.warp, scene.weft)
    forces = [Force(name, scene.turn @ total) for name, total in options.force]
    return LoadStepper(
        Ply(scene.mesh, fabric, _formulation(options, scene.mesh), forces),
        scene.conditions,
        options.steps,
        strategies=options.strategy,
        warn_only=options.warn_only,
        checkpoint=checkpoint_of(options),
        solver=options.solver,
    )


def _formulation(options: argparse.Namespace, mesh: Mesh) -> Formulation:
    C_s, kind, C_d = options.cs, options.stabilisation, options.deviation
    macro = isinstance(mesh, SplitMesh) and kind == "energy"
    name = options.formulation or (Macro.name if macro else OnePoint.name)
    for option, given, names in (
        ("--stabilisation", kind != "energy", (OnePoint.name,)),
        ("--cs", C_s != "auto", (OnePoint.name, Macro.name)),
        ("--deviation", C_d is not None, (Quadratic.name,)),
    ):
        if given and name not in names:
            raise ValueError(f"{option} goes with --formulation {' or '.join(names)}")
    if name == OnePoint.name:
        return OnePoint(C_s, kind)
    if name == Macro.name:
        return Macro(C_s)
    return Full() if name == Full.name else Quadratic(C_d)


def checkpoint_of(options: argparse.Namespace) -> Path | None:
    """The folder that --checkpoint or --resume name, or theirs in the output folder."""
    named = {f for f in (options.checkpoint, options.resume) if f not in (None, True)}
    if len(named) > 1:
        raise ValueError("--checkpoint and --resume name different folders")
    if options.checkpoint is None and options.resume is None:
        return None
    return named.pop() if named else options.out / "checkpoint"
