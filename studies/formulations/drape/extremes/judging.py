"""Whether a drape is right, by checks that do not use the solver.

- Every node is on the surface.
- Motions along the surface change the energy in second order only, and raise it.
- Fibres along the sides of inextensible plies lie as the kinematic net does.  Both
  planes of symmetry hold a thread of it straight, so that nothing about it is free,
  but for threads that end at a hole.
- The mirror image of a surface has the same shear angles.
- A mesh of half the element size has the same shear angles and positions.
"""

from dataclasses import replace

import numpy as np
from numpy import ndarray

from skfem_textile import drape
from skfem_textile.solve.error_estimate import estimated_error
from skfem_textile.solve.result import StepError
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.surface import distance, onto
from skfem_textile.solve.verdict import excess

from ....study import Row
from .cases import Extreme
from .runs import Drape, draped
from .surfaces import SIDE

#: Outcomes: right; off by more than is allowed, as the state itself tells; refused with
#: a reason; wrong.
RIGHT, TOLD, REFUSED, WRONG = "right", "told", "refused", "wrong"

#: Largest distance from the surface in mm.
OFF_SURFACE = 1e-8

#: Allowed: root mean square of the difference of shear angles in degrees, difference of
#: positions as a share of the elements that are computed on.
ANGLE, POSITION = 3.0, 0.25

#: Largest difference of shear angles from those of the mirror image in degrees.
OFF_MIRROR = 1e-4

#: Rotation in degrees that fibres of the strain 1 make, where the net has no strain.
ANGLE_OVER_STRAIN = 100.0

# Motions in mm that are tried, their number, and the energy to first order over that
# to second that is none.
_MOTION, _MOTIONS, _FIRST_ORDER = 1e-4, 5, 1e-2

# Cells of the net along a side.
_CELLS = 64

# E/G from which fibres are as good as inextensible.
_INEXTENSIBLE = 1e4


def judged(case: Extreme) -> Row:
    """Run a case, and compare what it found."""
    try:
        found = draped(case)
    except (NoEquilibriumError, StepError) as error:
        return {"outcome": REFUSED, "reason": str(error)}
    row: Row = {
        "solves": found.state.linear_solves,
        "strain": found.state.verdict.max_fibre_strain,
        "at_risk": float(
            drape.wrinkle_risk(found.ply, found.state.u, found.state.parameters).mean()
        ),
        "element_size": float(found.ply.element_size),
        "off_surface": float(np.abs(distance(found.surface, found.positions)).max()),
        "first_order": _first_order(case, found),
    }
    row |= _against_net(case, found) | _against_finer(case, found)
    if case.mirrored:
        other = draped(replace(case, mirrored=False))
        row["off_mirror"] = float(np.abs(found.angle - other.angle).max())
    complaints = _complaints(row)
    told = _told(found)
    outcome = WRONG if complaints else RIGHT
    if complaints and told and not _is_unsound(row):
        outcome = TOLD
    return {"outcome": outcome, "reason": "; ".join(complaints), "told": told, **row}


def _told(found: Drape) -> str:
    """Why a state says itself that it may be off; empty if it does not."""
    ply, state = found.ply, found.state
    estimate = estimated_error(ply, found.conditions, "superlu", state).shear_angle
    reasons = {
        "wrinkles": drape.wrinkle_risk(ply, state.u, state.parameters).any(),
        "stabilisation": excess(state.shares, "stabilisation"),
        "deviations": excess(state.shares, "deviation"),
        "estimated error": np.degrees(estimate or 0.0) > ANGLE,
    }
    return ", ".join(reason for reason, given in reasons.items() if given)


def _is_unsound(row: Row) -> bool:
    """Whether a state is off its surface, or no stable equilibrium."""
    return not (
        row["off_surface"] <= OFF_SURFACE and 0 <= row["first_order"] <= _FIRST_ORDER
    )


def _complaints(row: Row) -> list[str]:
    """What is wrong with a state."""
    found = []
    if _is_unsound(row):
        found.append("no stable equilibrium on the surface")
    if row.get("off_net", 0.0) > ANGLE + ANGLE_OVER_STRAIN * row["strain"]:
        found.append(f"{row['off_net']:.1f}° off the net")
    if row.get("off_finer", 0.0) > ANGLE:
        found.append(f"{row['off_finer']:.1f}° off the finer mesh")
    if row.get("off_mirror", 0.0) > OFF_MIRROR:
        found.append(f"{row['off_mirror']:.1e}° off the mirror image")
    if row.get("moved", 0.0) > POSITION * row["element_size"]:
        found.append(f"{row['moved']:.1f} mm off the finer mesh")
    return found


def _first_order(case: Extreme, found: Drape) -> float:
    """Energy to first order over that to second of motions along the surface.

    At most of a few smooth motions that symmetry allows; −1 where one lowers the
    energy.  The positions at either end are brought onto the surface.
    """
    ply, x = found.ply, found.positions
    rng, largest = np.random.default_rng(0), 0.0
    free = np.ones_like(x, dtype=bool)
    for i, name in enumerate(("left", "bottom")):
        nodes = found.conditions["xy"[i]].nodes(name, ply.basis)
        free[i, nodes] = False
    projectors = np.array([np.diag(f) for f in free.T.astype(float)])
    for _ in range(_MOTIONS):
        phase, waves = rng.uniform(0, 6, (3, 1)), rng.uniform(-4, 4, (3, 2)) / SIDE
        v = _MOTION * np.sin(waves @ ply.nodes + phase) * free
        ends = [onto(found.surface, x + sign * v, projectors) for sign in (1, -1)]
        energies = [_energy(found, end) for end in (*ends, x)]
        first = abs(energies[0] - energies[1]) / 2
        second = (energies[0] + energies[1]) / 2 - energies[2]
        round_off = 1e-12 * sum(abs(e) for e in found.state.energies.values())
        if second < -round_off - first:
            return -1.0
        largest = max(largest, first / max(second, round_off, 1e-300))
    return float(largest)


def _energy(found: Drape, x: ndarray) -> float:
    u = drape.displacement(found.ply.nodes, x)
    return found.ply.energy(u, found.state.load_factor, found.state.parameters)


def _against_net(case: Extreme, found: Drape) -> Row:
    """How far the shear angles are from those of the net, root mean square."""
    inextensible = case.stiffness >= _INEXTENSIBLE and case.tension and not case.bending
    if case.bias or not inextensible or case.mesh == "hole":
        return {}
    cells = (0, _CELLS)
    try:
        net = drape.net(found.surface, SIDE / _CELLS, cells, cells)
    except ValueError:
        return {}
    element = found.ply.users_mesh.element_finder()(*net.centres().reshape(2, -1))
    angle = np.degrees(net.shear_angle().ravel())
    off = found.angle - np.bincount(element, angle) / np.bincount(element)
    return {"off_net": float(np.sqrt(np.mean(off**2)))}


def _against_finer(case: Extreme, found: Drape) -> Row:
    """How far shear angles and positions are from those with elements halved."""
    try:
        finer = draped(case, halvings=1)
    except (NoEquilibriumError, StepError):
        return {}
    off = found.angle - finer.angle.reshape(4, -1).mean(axis=0)
    n = found.ply.users_mesh.p.shape[1]
    moved = np.linalg.norm((found.positions[:, :n] - finer.positions[:, :n]), axis=0)
    return {"off_finer": float(np.sqrt(np.mean(off**2))), "moved": float(moved.max())}
