"""
Holder force and friction
=========================

A punch forms a ply through a die, on which a rigid holder presses it with a force. The
punch force, the largest shear angle and the area where fibres may wrinkle are compared
for several holder forces and coefficients of friction. Any key of a case can vary.
"""

import sys
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from skfem_textile import plot
from skfem_textile.cases import sweep_case
from skfem_textile.sweep import ThisThread, WorkerProcesses

# %%
# The base case, with the keys of a case file. A quarter of the ply is computed. The
# holder presses around the fillet of the die; without this outline it would also press
# over the opening.

turn = np.linspace(0, 2 * np.pi, 61)
circle = np.transpose([np.cos(turn), np.sin(turn)])
ring = np.vstack([200 * circle, 54 * circle]).tolist()
law = {"law": "compaction", "thickness_mm": 0.3, "pressure_N_per_mm2": 1e-3}

case = {
    "scene": {"name": "forming", "width_mm": 200, "height_mm": 200, "part": "quarter"},
    "mesh": {"size": [6, 6]},
    "shear": {"law": "locking", "stiffness_N_per_mm": 0.1, "locking_angle_deg": 60},
    "bending": {"warp_N_mm": 5, "weft_N_mm": 5},
    "stepping": {"steps": 5},
    "tools": [
        {
            "name": "punch",
            "surface": "punch",
            "radius_mm": 40,
            "point_mm": [0, 0, -40.2],
            "motion_mm": [0, 0, 30],
        },
        {
            "name": "die",
            "surface": "die",
            "radius_mm": 45,
            "fillet_mm": 8,
            "point_mm": [0, 0, 0.2],
        },
        {
            "name": "holder",
            "surface": "plane",
            "point_mm": [0, 0, 0.2],
            "side": -1,
            "outline_mm": ring,
            "compaction": {**law, "exponent": 8},
        },
    ],
}

# %%
# Values of two keys: the force on the quarter in N, and the friction of all tools. All
# six cases are checked before the first run. A script that names a file of finished
# runs can be interrupted and started again; ``--processes`` uses two processors.

vary = {"tools.holder.force_N": [2, 10, 40], "tools.*.friction": [0.1, 0.3]}

if __name__ == "__main__":
    several = sys.argv[-1] == "--processes"
    finished = Path(mkdtemp()) / "sweep.jsonl"
    with WorkerProcesses(2) if several else ThisThread() as executor:
        found = sweep_case(case, vary, executor, finished)

    # %%
    # A row for each combination. Forces are of the whole ply.

    for row in found.rows:
        force, friction = (row[key] for key in vary)
        print(
            f"{force:2} N, friction {friction}: punch {row['Punch force (N)']:5.1f} N, "
            f"shear {row['Largest shear angle (°)']:.1f}°, draw-in "
            f"{row['Largest draw-in (mm)']:.1f} mm, {row['linear solves']} solves"
        )
    assert not found.incomplete
    found.write("compared.csv")

    # %%
    # The picture. Runs that stop early would be marked.

    plot.compared_runs(*found.drawn, "compared.png")

# %%
# The same on the command line, with the tables above in a case file:
#
# .. code-block:: sh
#
#    skfem-textile sweep case.toml --vary tools.holder.force_N=2,10,40 \
#        "tools.*.friction=0.1,0.3" --out DIR
