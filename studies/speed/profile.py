"""Time of whole commands by part of the program.

A thread samples the call stack of the command and attributes the time since its last
sample to the innermost part of `PARTS` on the stack.
"""

import sys
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread, main_thread
from time import perf_counter

import numpy as np
from meshio import Mesh

from ..common.running import in_new_process
from ..common.tables import Row
from .solving import Settings

# Time between samples in s.
_INTERVAL = 0.002

# Radius and width of the flange of the tool in mm, and numbers of its triangles along a
# meridian and a parallel.
_RADIUS, _FLANGE, _RINGS, _SECTORS = 50.0, 50.0, 30, 60

#: Modules or packages of each part, relative to the library; the innermost match on the
#: stack counts, and the last part is for everything else in the library.
PARTS: dict[str, tuple[str, ...]] = {
    "tool surface": ("surfaces", "solve.surface_nodes"),
    "kinematic nets": ("nets",),
    "factorisation and solution": ("solve.linear",),
    "assembly": ("ply", "forms", "fabric", "mesh.pattern"),
    "mesh": ("mesh", "scenes", "outlines"),
    "fit": ("calibration",),
    "plots": ("plot", "calibration.figure"),
    "files": ("io", "cases", "cli"),
    "Newton iteration and checks": ("",),
}

#: Time before the command runs.
IMPORT = "import"


def profile(settings: Settings) -> Row:
    """Time of whole commands in s, by part of the program, each in a new process."""
    with TemporaryDirectory() as folder:
        tool, curve = Path(folder, "tool.stl"), Path(folder, "curve.csv")
        write_hemisphere(tool)
        write_curve(curve)
        commands = {
            "strip": "run strip",
            "bias extension": "run bias_extension --steps 20",
            "hemisphere from STL": f"run drape --tool {tool} --size 12x12"
            " --width 100 --height 100",
            "fit": f"fit picture-frame {curve} --frame-side 100 --fabric-side 100",
        }
        return {
            "commands": {
                name: in_new_process(
                    _profiled, command.split(), str(Path(folder, name))
                )
                for name, command in commands.items()
            }
        }


def write_hemisphere(file: Path) -> None:
    """Write a hemisphere with a flange as STL."""
    polar = np.linspace(0.0, np.pi / 2, _RINGS)
    r = np.append(_RADIUS * np.sin(polar), _RADIUS + _FLANGE)
    z = np.append(_RADIUS * np.cos(polar), 0.0)
    azimuth = 2 * np.pi * np.arange(_SECTORS) / _SECTORS
    x, y = r[1:, None] * np.cos(azimuth), r[1:, None] * np.sin(azimuth)
    ring = np.stack([x, y, np.broadcast_to(z[1:, None], x.shape)], axis=-1)
    points = np.vstack([[0.0, 0.0, _RADIUS], ring.reshape(-1, 3)])
    node = 1 + np.arange(len(points) - 1).reshape(-1, _SECTORS)
    following = np.roll(node, -1, axis=1)
    a, b, c, d = node[:-1], following[:-1], following[1:], node[1:]
    triangles = [
        np.stack([np.zeros_like(node[0]), node[0], following[0]], axis=-1),
        np.stack([a, d, c], axis=-1).reshape(-1, 3),
        np.stack([a, c, b], axis=-1).reshape(-1, 3),
    ]
    Mesh(points, [("triangle", np.concatenate(triangles))]).write(file)


def write_curve(file: Path) -> None:
    """Write a picture-frame test: shear angle in degrees and force in N."""
    angle = np.linspace(0.0, 50.0, 101)
    force = 0.5 * np.radians(angle) * (1 + np.sin(np.radians(angle)) ** 2)
    table = np.stack([angle, force], axis=1)
    np.savetxt(
        file, table, "%.6f", ",", header="shear angle (deg),force (N)", comments=""
    )


def _profiled(arguments: list[str], folder: str) -> Row:
    """Seconds of each part of a command, and its exit code."""
    start = perf_counter()
    from skfem_textile.cli.main import main

    seconds, stop = defaultdict(float, {IMPORT: perf_counter() - start}), Event()
    sampling = Thread(target=_sample, args=(seconds, stop), daemon=True)
    sampling.start()
    try:
        code = main([*arguments, "--out", folder])
    finally:
        stop.set()
        sampling.join()
    return {"exit_code": code, "seconds": dict(seconds), "total": sum(seconds.values())}


def _sample(seconds: dict[str, float], stop: Event) -> None:
    """Add the time between samples to the part that the main thread executes."""
    main_id, last = main_thread().ident, perf_counter()
    while not stop.wait(_INTERVAL):
        frame = sys._current_frames().get(main_id or 0)
        now = perf_counter()
        while frame is not None:
            module = frame.f_globals.get("__name__", "")
            if module.startswith("skfem_textile"):
                seconds[part_of(module)] += now - last
                break
            frame = frame.f_back
        last = now


def part_of(module: str) -> str:
    """Part of the program to which a module belongs.

    Examples
    --------
    >>> part_of("skfem_textile.mesh.pattern"), part_of("skfem_textile.solve.newton")
    ('assembly', 'Newton iteration and checks')
    """
    within = module.removeprefix("skfem_textile").removeprefix(".")
    parents = {"", within} | {within[:i] for i, c in enumerate(within) if c == "."}
    lengths = {
        name: max((len(x) for x in modules if x in parents), default=-1)
        for name, modules in PARTS.items()
    }
    return max(lengths, key=lambda name: lengths[name])
