"""
A process in phases: close, punch, open
=======================================

A rigid holder closes with a force, a punch forms a ply through a die while the force of
the holder follows its travel, and both open. Tools rub with Coulomb friction. The
results are a table and a picture by phase. Then the last two phases are repeated with a
larger force, without computing the first one again.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    Ply,
    Tool,
    Traction,
    contact,
    drape,
    plot,
)

# %%
# The tools in their initial positions, in mm. The holder is a ring around the fillet of
# the die. The pressure on the ply follows from its thickness by a law of compaction.

turn = np.linspace(0, 2 * np.pi, 61)
circle = np.array([np.cos(turn), np.sin(turn)])
ring = np.hstack([200 * circle, 53 * circle])
law = contact.Compaction(thickness=0.3, pressure=1e-3, exponent=8.0)
flange = drape.Plane((0, 0, 0.15))
tools = [
    Tool(drape.Punch(40.0, (0, 0, -41)), friction=0.2, name="punch"),
    Tool(drape.Die(45.0, 8.0, (0, 0, 0.15)), friction=0.2, name="die"),
    Holder(flange, force=0.0, compaction=law, side=-1, outline=ring, friction=0.2),
]

# %%
# The phases. Each states motions in mm and forces in N at its end; what it does not
# state remains. The force is the one on a quarter of the ply.


def phases(force):
    """Close, punch and open, with the force of the holder at the end of the punch."""
    over_travel = contact.OverTravel("punch", [(0, 5), (15, force), (25, force)])
    up, down = {"motion": (0, 0, 25)}, {"motion": (0, 0, 0)}
    return [
        contact.Phase("close", 1, {"holder": {"force": 5.0}}),
        contact.Phase("punch", 5, {"punch": up, "holder": {"force": over_travel}}),
        contact.Phase("open", 2, {"punch": down, "holder": {"force": 0.0}}),
    ]


def run(force, checkpoint):
    """Process of a quarter of a ply, and its load stepper."""
    process = contact.Process(phases(force), tools)
    edges = [
        Traction("right", (0.2, 0.0, 0.0), factor=1.0),  # N/mm, there from the start
        Traction("top", (0.0, 0.2, 0.0), factor=1.0),
    ]
    mesh = MeshQuad().refined(3).scaled(100.0).with_defaults()
    ply = Ply(
        mesh,
        Fabric(1e4, 0.1, bending=(5.0, 5.0)),
        terms=[*edges, *process.tools],
        dimension=3,
        fibre_ends={"left": "mirror", "bottom": "mirror"},
    )
    symmetry = {
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
    }
    return process, LoadStepper(ply, symmetry, process.steps, checkpoint=checkpoint)


def show(rows):
    """Print a table of phases."""
    for row in rows:
        print(
            f"{row['phase']:6} {row['punch_travel_mm']:5.1f} mm, "
            f"punch {row['punch_force_N']:5.2f} N, "
            f"holder {row['holder_force_N']:5.2f} N, "
            f"shear {row['recovered_max_shear_angle_deg']:5.2f}°, "
            f"draw-in {row['max_draw_in_mm']:5.2f} mm, "
            f"lost {row['energy_lost']:5.1f} N·mm"
        )


# %%
# The figures at the ends of the phases. The energy lost is the work of friction since
# the start. After the tools have opened, the ply is flat again, because its fabric is
# elastic and its edges are pulled.

folder = Path(mkdtemp())
process, stepper = run(20.0, folder / "first")
result = stepper.run()
show(contact.phase_table(result, process))

# %%
# The ply at the end of each phase.

plot.phases(result, process, filename="phases.png")

# %%
# The same process from the second phase on with three times the force. The states of
# the first phase are read from the checkpoint, which is not changed.

process, stepper = run(60.0, folder / "second")
again = stepper.run(states_of=folder / "first", until=process.begin("punch"))
show(contact.phase_table(again, process))
first, second = (one.states[-3] for one in (result, again))
assert np.array_equal(result.states[1].u, again.states[1].u)
assert second.energy_lost["holder"] > first.energy_lost["holder"]

# %%
# The process as tables of a case file:
#
# .. code-block:: toml
#
#    [[phases]]
#    name = "close"
#    steps = 1
#    tools.holder.force_N = 5
#
#    [[phases]]
#    name = "punch"
#    steps = 5
#    tools.punch.motion_mm = [0, 0, 25]
#    tools.holder.force_N = {travel_of = "punch", rows = [[0, 5], [15, 20], [25, 20]]}
#
#    [[phases]]
#    name = "open"
#    steps = 2
#    tools.punch.motion_mm = [0, 0, 0]
#    tools.holder.force_N = 0

# sphinx_gallery_thumbnail_number = 1
