"""What the command line does: each command checks, then computes, then writes."""

import argparse
import json
import logging
import sys
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh, MeshQuad, MeshTri

from . import __version__
from .fabric import Fabric, Law, Sin2
from .formulations import Formulation, Full, Macro, OnePoint, Quadratic
from .ply import Ply
from .result import Iteration, Result, State, StepError
from .scenes import Scene, bias_extension, picture_frame, strip, trellis
from .scenes.rectangle import KINDS
from .scenes.trellis import Edge, sheared
from .splitting import SplitMesh, cut, split
from .stepper import LoadStepper

#: The scenes, and what they are.
SCENES = {
    "strip": "a strip laid on a circle, fibres along its sides, clamped at the bottom",
    "picture_frame": "a square sheared by a hinged frame, fibres along its sides",
    "trellis": "a square whose edges follow a motion that stretches no fibre",
    "bias_extension": "a rectangle pulled along the bisector of its fibres",
    "two_element": "why quadrilaterals lock: the paper's equations on two elements",
}

#: The shear laws, by their names on the command line.
SHEAR_LAWS: dict[str, Callable[[float], float | Law]] = {"linear": float, "sin2": Sin2}

#: The studies, and what they tell.
STUDIES = {
    "stability": "stiff and extreme cases: which are right, refused or wrong",
    "formulations": "every formulation on every scene: how far from the exact answer",
}

STOPPED_EARLY, BAD_INPUT, INTERRUPTED = 1, 2, 130

_PICTURES = (
    "fibre_strain.png",
    "shear_angle.png",
    "fibre_directions.png",
    "load.png",
    "animation.gif",
)


def scenes(_: argparse.Namespace) -> int:
    """List the scenes."""
    for name, what in SCENES.items():
        print(f"{name:16}{what}")
    return 0


def run(options: argparse.Namespace) -> int:
    """Load a scene and write its results."""
    from . import io  # loads meshio

    scene = _scene(options)
    stepper = _stepper(scene, options)
    fields = (f"fields/{name}" for name in io.FIELDS)
    written = ("summary.json", "history.csv", *fields, *_PICTURES)
    results = io.ResultFolder(options.out, written)
    code, said = _load(stepper, options)
    result = stepper.result
    summary = scene.summary(result)
    with results as folder:
        inputs = {"inputs": {"version": __version__, **_inputs(options)}}
        io.write_summary(summary | inputs, folder / "summary.json")
        io.write_history(result, folder / "history.csv")
        io.write_fields(result, folder / "fields")
    if not options.no_render and code != INTERRUPTED:
        _render(lambda folder: _draw(scene, result, folder), options.out, _PICTURES)
    for key, value in summary.items():
        shown = f"{value:.6g}" if isinstance(value, float) else value
        print(f"{key:28}{shown}")
    print(f"results in {options.out}")
    if said:
        print(f"skfem-textile: {said}", file=sys.stderr)
    return code


def paper(options: argparse.Namespace) -> int:
    """Run the strips of the paper's figures; a case that stops early is a row."""
    from . import io
    from .studies import paper as study

    results = io.ResultFolder(options.out, (*study.FILES, *study.PICTURES))
    with results as folder:
        rows = study.reproduce(folder)
    if not options.no_render:
        _render(lambda folder: study.draw(rows, folder), options.out, study.PICTURES)
    print(f"results in {options.out}")
    return 0


def two_element(options: argparse.Namespace) -> int:
    """Write the systems of the paper's two-element mesh beside what it prints."""
    from . import io
    from .studies import systems

    with io.ResultFolder(options.out, ("systems.json", "systems.md")) as folder:
        table = systems.table()
        (folder / "systems.md").write_text(table)
        text = json.dumps(systems.report(), indent=2, ensure_ascii=False)
        (folder / "systems.json").write_text(text + "\n")
    print(table, end="")
    print(f"results in {options.out}")
    return 0


def study(options: argparse.Namespace) -> int:
    """Run a study and write its report."""
    from . import io

    study = import_module(f".studies.{options.study}", __package__)
    results = io.ResultFolder(options.out, (*study.FILES, *study.PICTURES))
    rows: list[dict[str, Any]] = []
    try:
        for some in study.cases(options.workers):
            print(study.line(some))
            rows += some
    finally:  # an interrupted study reports on what it has
        if rows:
            with results as folder:
                study.write(rows, folder)
    if not options.no_render:
        _render(lambda folder: study.draw(rows, folder), options.out, study.PICTURES)
    print(f"results in {options.out}")
    return 0


def _inputs(options: argparse.Namespace) -> Mapping[str, Any]:
    """The options that decide the result."""
    others = ("command", "task", "out", "no_render", "checkpoint", "resume", "verbose")
    return {k: v for k, v in vars(options).items() if k not in others}


def _scene(options: argparse.Namespace) -> Scene:
    mesh, triangles = options.mesh, options.formulation == Quadratic.name
    if triangles and options.split:
        raise ValueError(
            "--split makes quadrilaterals, --formulation quadratic takes triangles: "
            "leave one of them out"
        )
    if mesh not in KINDS:
        if not Path(mesh).is_file():
            raise ValueError(f"--mesh {mesh}: neither a file nor {', '.join(KINDS)}")
        from .io import read_mesh

        mesh = read_mesh(mesh, split=not triangles)
    build = partial(
        _SCENES[options.scene](options),
        size=options.size,
        jitter=options.jitter,
        seed=options.seed,
    )
    scene = build(mesh=mesh)
    if not isinstance(scene.mesh, SplitMesh):
        own = scene.mesh
        if isinstance(own, MeshQuad) and (triangles or options.split == "triangles"):
            own = cut(own)
        if options.split or (isinstance(own, MeshTri) and not triangles):
            own = split(own)
        if own is not scene.mesh:
            scene = build(mesh=own)
    return scene.rotated(np.radians(options.rotate))


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


def _stepper(scene: Scene, options: argparse.Namespace) -> LoadStepper:
    try:
        shear = SHEAR_LAWS[options.shear_law](options.shear_stiffness)
    except ValueError as error:
        raise ValueError(f"shear {error}") from None
    fabric = Fabric(options.fibre_stiffness, shear, scene.warp, scene.weft)
    return LoadStepper(
        Ply(scene.mesh, fabric, _formulation(options, scene.mesh)),
        scene.conditions,
        options.steps,
        strategies=options.strategy,
        warn_only=options.warn_only,
        checkpoint=_checkpoint(options),
    )


def _formulation(options: argparse.Namespace, mesh: Mesh) -> Formulation:
    C_s, kind, C_d = options.cs, options.stabilisation, options.deviation
    macro = isinstance(mesh, SplitMesh) and kind == "energy"
    name = options.formulation or (Macro.name if macro else OnePoint.name)
    for option, given, names in (
        ("--stabilisation", kind != "energy", (OnePoint.name,)),
        ("--cs", C_s != "auto", (OnePoint.name, Macro.name)),
        ("--deviation", C_d is not None, (Macro.name, Quadratic.name)),
    ):
        if given and name not in names:
            raise ValueError(f"{option} goes with --formulation {' or '.join(names)}")
    if name == OnePoint.name:
        return OnePoint(C_s, kind)
    if name == Macro.name:
        return Macro(C_s) if C_d is None else Macro(C_s, C_d)
    return Full() if name == Full.name else Quadratic(C_d)


def _checkpoint(options: argparse.Namespace) -> Path | None:
    """The folder that --checkpoint or --resume name, or theirs in the output folder."""
    named = {f for f in (options.checkpoint, options.resume) if f not in (None, True)}
    if len(named) > 1:
        raise ValueError("--checkpoint and --resume name different folders")
    if options.checkpoint is None and options.resume is None:
        return None
    return named.pop() if named else options.out / "checkpoint"


def _load(stepper: LoadStepper, options: argparse.Namespace) -> tuple[int, str]:
    """Run with a progress bar on a terminal: exit code, and what to say at the end."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.description}"))
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        _log(options.verbose)
        task = bar.add_task("load factor 0", total=1.0)

        def told(at: Iteration) -> None:
            bar.update(
                task,
                description=f"load factor {at.load_factor:.4g}, step {at.step:.2g}, "
                f"{at.strategy} {at.number}",
            )

        def reached(state: State) -> None:
            bar.update(task, completed=state.load_factor)

        stepper.on_iteration, stepper.on_step = told, reached
        try:
            stepper.run(resume=options.resume is not None)
        except StepError as error:
            return STOPPED_EARLY, str(error)
        except KeyboardInterrupt:
            if not stepper.states:
                raise
            return INTERRUPTED, _interrupted(stepper, options)
    return 0, ""


def _interrupted(stepper: LoadStepper, options: argparse.Namespace) -> str:
    at = stepper.states[-1].load_factor
    kept = _checkpoint(options)
    advice = "--resume goes on from there" if kept else "--checkpoint lets a run resume"
    return f"interrupted; the state at load factor {at:.6g} is written, {advice}"


def _log(verbose: int) -> None:
    """Send the log to stderr, past the progress bar."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    log = logging.getLogger(__package__)
    log.handlers[:] = [handler]
    log.setLevel([logging.WARNING, logging.INFO, logging.DEBUG][min(verbose, 2)])


def _render(draw: Callable[[Path], None], out: Path, pictures: tuple[str, ...]) -> None:
    """Draw into a folder, or say in one line why not: the numbers are written."""
    from . import io

    try:
        with io.ResultFolder(out, pictures) as folder:
            draw(folder)
    except ImportError as error:
        print(f"no pictures: {error}; pip install 'skfem-textile[plot]'")
    except Exception as error:
        print(f"no pictures: {error}")
    except KeyboardInterrupt:
        print("no pictures: interrupted")


def _draw(scene: Scene, result: Result, folder: Path) -> None:
    from . import plot
    from .curves import curves

    plot.fibre_strain(result, filename=folder / "fibre_strain.png")
    plot.shear_angle(result, filename=folder / "shear_angle.png")
    plot.fibre_directions(result, filename=folder / "fibre_directions.png")
    plot.animation(result, folder / "animation.gif")
    t = [state.load_factor for state in result.states]
    x, y = np.transpose([scene.reaction(state) for state in result.states])
    lines = {"along x": (t, x), "along y": (t, y)}
    title = "Force on the driven edge"
    curves({title: lines}, "Load factor", "Force (N)", folder / "load.png")
