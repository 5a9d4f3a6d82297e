"""One Newton iteration in two checkouts of this project, by turns.

``python benchmarks/by_turns.py BEFORE AFTER`` prints the processor time of a linear
solve with its assembly in both, the least over the turns, and their ratio.
"""

import json
import os
import subprocess
import sys

TURNS = 5

MEASURE = """
import json, time
from skfem_textile import Fabric, Full, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.scenes import strip
from skfem_textile.splitting import split

found = {}
for name, size, formulation in (
    ("one point", (100, 150), OnePoint()),
    ("2x2 points", (60, 90), Full()),
    ("macro-elements", (50, 75), Macro()),
):
    scene = strip(size=size)
    mesh = split(scene.mesh) if name == "macro-elements" else scene.mesh
    ply = Ply(mesh, Fabric(1e4, 0.5), formulation)
    stepper = LoadStepper(ply, scene.conditions, 2, solver="cholmod")
    began = time.process_time()
    result = stepper.run()
    found[name] = (time.process_time() - began) / result.linear_solves
print(json.dumps(found))
"""


def measured(checkout):
    one_thread = {f"{k}_NUM_THREADS": "1" for k in ("OMP", "OPENBLAS", "MKL")}
    child = subprocess.run(
        [sys.executable, "-c", MEASURE],
        env={**os.environ, **one_thread, "PYTHONPATH": checkout},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(child.stdout)


def main(before, after):
    turns = [(measured(before), measured(after)) for _ in range(TURNS)]
    for name in turns[0][0]:
        old, new = (min(turn[i][name] for turn in turns) for i in range(2))
        print(f"{name:16}{old:8.4f} s{new:8.4f} s{new / old:8.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
