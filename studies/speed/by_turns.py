"""One Newton iteration in two checkouts of this project, by turns.

For each checkout it measures the processor time of a linear solve with its assembly,
the least over the turns, and gives the ratio of both.
"""

import json
import os
import subprocess
import sys

from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings

TABLES = ("by_turns.md",)

_TURNS = 5

_MEASURE = """
import json, time
from skfem_textile import Condition, Fabric, Full, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.scenes import strip
from skfem_textile.mesh.splitting import split

seconds = {}
for name, size, formulation in (
    ("one point", (100, 150), OnePoint()),
    ("2×2 points", (60, 90), Full()),
    ("macro-elements", (50, 75), Macro()),
):
    scene = strip("aligned", size)
    mesh = split(scene.mesh) if name == "macro-elements" else scene.mesh
    ply = Ply(mesh, Fabric(1e4, 0.5), formulation)
    conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (1.0, 1.0))}
    stepper = LoadStepper(ply, conditions, 2, solver="cholmod")
    began = time.process_time()
    result = stepper.run()
    seconds[name] = (time.process_time() - began) / result.linear_solves
print(json.dumps(seconds))
"""


def measured(settings: Settings) -> Row:
    """Seconds in both checkouts, and after over before, by formulation."""
    turns = [
        (_seconds(settings.before), _seconds(settings.after)) for _ in range(_TURNS)
    ]
    results = {}
    for name in turns[0][0]:
        before, after = (min(turn[i][name] for turn in turns) for i in range(2))
        results[name] = {"before": before, "after": after, "ratio": after / before}
    return results


def tables(results: Row) -> dict[str, str]:
    """A line for each formulation."""
    lines = [
        [name, f"{row['before']:.4f}", f"{row['after']:.4f}", f"{row['ratio']:.3f}"]
        for name, row in results.items()
    ]
    head = ["linear solve with its assembly", "before, s", "after, s", "ratio"]
    return {"by_turns.md": markdown_table(head, lines)}


def _seconds(checkout: str) -> dict[str, float]:
    child = subprocess.run(
        [sys.executable, "-c", _MEASURE],
        env={**os.environ, "PYTHONPATH": os.path.abspath(checkout)},
        cwd=checkout,
        capture_output=True,
        text=True,
        check=True,
    )
    seconds: dict[str, float] = json.loads(child.stdout)
    return seconds
