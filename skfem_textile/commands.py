"""What the command line does: each command checks, then computes, then writes."""

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import __version__
from .fabric import Fabric
from .formulations import Formulation, Full, OnePoint
from .ply import Ply
from .result import Result, State
from .scenes import Scene, strip
from .scenes.rectangle import KINDS
from .stepper import LoadStepper, StepError

#: The scenes, and what they are.
SCENES = {
    "strip": "a strip laid on a circle, fibres along its sides, clamped at the bottom",
    "two_element": "why quadrilaterals lock: the paper's equations on two elements",
}

STOPPED_EARLY = 1

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
    fabric = Fabric(
        options.fibre_stiffness, options.shear_stiffness, scene.warp, scene.weft
    )
    formulation: Formulation = (
        Full()
        if options.formulation == "full"
        else OnePoint(options.cs, options.stabilisation)
    )
    stepper = LoadStepper(
        Ply(scene.mesh, fabric, formulation), scene.conditions, options.steps
    )
    fields = (f"fields/{io.STEPS}", f"fields/{io.SERIES}")
    written = ("summary.json", "history.csv", *fields, *_PICTURES)
    with io.ResultFolder(options.out, written) as folder:
        result, stopped = _load(stepper)
        summary = scene.summary(result)
        inputs = {"inputs": {"version": __version__, **_inputs(options)}}
        io.write_summary(summary | inputs, folder / "summary.json")
        io.write_history(result, folder / "history.csv")
        io.write_fields(result, folder / "fields")
        if not options.no_render:
            _render(lambda: _draw(scene, result, folder))
    for key, value in summary.items():
        shown = f"{value:.6g}" if isinstance(value, float) else value
        print(f"{key:28}{shown}")
    print(f"results in {options.out}")
    if stopped:
        print(f"skfem-textile: {stopped}", file=sys.stderr)
    return STOPPED_EARLY if stopped else 0


def paper(options: argparse.Namespace) -> int:
    """Run the strips of the paper's figures; a case that stops early is a row."""
    from . import io
    from .studies import paper as study

    with io.ResultFolder(options.out, (*study.FILES, *study.PICTURES)) as folder:
        rows = study.reproduce(folder)
        if not options.no_render:
            _render(lambda: study.draw(rows, folder))
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


def _inputs(options: argparse.Namespace) -> Mapping[str, Any]:
    """The options that decide the result."""
    others = ("command", "task", "out", "no_render")
    return {k: v for k, v in vars(options).items() if k not in others}


def _scene(options: argparse.Namespace) -> Scene:
    mesh = options.mesh
    if mesh not in KINDS:
        if not Path(mesh).is_file():
            raise ValueError(f"--mesh {mesh}: neither a file nor {', '.join(KINDS)}")
        from .io import read_mesh

        mesh = read_mesh(mesh)
    scene = strip(mesh, options.size, options.jitter, options.seed)
    return scene.rotated(np.radians(options.rotate))


def _load(stepper: LoadStepper) -> tuple[Result, StepError | None]:
    """The result with a progress bar on a terminal, and what stopped it early."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(
        console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("load factor", total=1.0)

        def show(state: State) -> None:
            bar.update(task, completed=state.load_factor)

        stepper.on_step = show
        try:
            return stepper.run(), None
        except StepError as error:
            return error.result, error


def _render(draw: Callable[[], None]) -> None:
    """Draw, or say in one line why not."""
    try:
        draw()
    except ImportError as error:
        print(f"no pictures: {error}; pip install 'skfem-textile[plot]'")
    except RuntimeError as error:
        print(f"no pictures: {error}")


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
