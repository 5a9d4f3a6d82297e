"""The strips of Figs. 3 to 5 and 9 to 12.

The paper's mesh is not published: the irregular meshes here are those of the scene
`strip` with 10×15 elements, jitter 0.3 and seed 1.
"""

from typing import NamedTuple

import numpy as np

from skfem_textile.fabric import Fabric
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Kind, OnePoint
from skfem_textile.scenes import strip
from skfem_textile.solve.result import StepError
from skfem_textile.solve.stepper import LoadStepper

from ..common.log import errors_only
from ..study import Row

_STEPS = 40


class Strip(NamedTuple):
    """A figure of the paper: the run, and what the paper says about it."""

    figure: str
    mesh: str
    formulation: Full | OnePoint
    strain: str
    load: str

    @property
    def name(self) -> str:
        """Figure, mesh and element."""
        return f"Fig. {self.figure}, {self.mesh}, {self.formulation.title}"

    @property
    def is_of_rates(self) -> bool:
        """Whether the stabilisation is the paper's, which has no energy."""
        return isinstance(self.formulation, OnePoint) and (
            self.formulation.kind == "rate"
        )

    def ply(self) -> Ply:
        """The ply, unloaded."""
        return Ply(strip(self.mesh).mesh, Fabric(1e4), self.formulation)


def strips() -> list[Strip]:
    """The figures of the paper, the last three with both kinds of stabilisation."""
    return [
        Strip("3, 5", "aligned", Full(), "< 2e-6", "almost zero"),
        Strip("4, 5", "irregular", Full(), "9.5e-3", "140 N"),
        Strip("9", "horizontal", Full(), "1.66e-6", "-"),
        Strip("10", "vertical", Full(), "locks", "-"),
        *_stabilised("energy"),
        *_stabilised("rate"),
    ]


def _stabilised(kind: Kind) -> list[Strip]:
    return [
        Strip(figure, "irregular", OnePoint(C_s, kind), strain, load)
        for figure, C_s, strain, load in (
            ("11c, 12", 10.0, "1.39e-3", "not negligible"),
            ("11a, 12", 1.0, "5.39e-4", "nearly negligible"),
            ("11b, 12", 0.01, "2.33e-5", "close to zero"),
        )
    ]


#: The numbers of a strip by what tables call them, under their names in the summary.
MEASURED = {
    "strain": "max_fibre_strain",
    "mesh strain": "mesh_fibre_strain",
    "load (N)": "reaction_x",
    "position, rms (mm)": "displacement_error_rms",
    "max (mm)": "displacement_error_max",
    "angle, rms (°)": "shear_angle_error_rms_deg",
}


@errors_only()
def examined(case: Strip) -> Row:
    """Run a strip as far as it goes.

    Its row has its results beside those of the paper and, as ``drawn``, what pictures
    need: the load curve as displacements at the top of the right edge and forces on
    that edge, the last load factor and the last displacement.
    """
    scene, ply, outcome = strip(case.mesh), case.ply(), "stable"
    try:
        result = LoadStepper(ply, scene.conditions, _STEPS).run()
    except StepError as error:
        result = error.result
        t = result.states[-1].load_factor
        outcome = f"no acceptable state beyond load factor {t:.3f}; figures at that"
    summary = scene.summary(result)
    corner = int(np.argmax(scene.mesh.p.sum(axis=0)))
    return {
        "figure": case.figure,
        "mesh": case.mesh,
        "element": case.formulation.title,
        "outcome": outcome,
        "strain, paper": case.strain,
        "load, paper": case.load,
        **{name: summary[key] for name, key in MEASURED.items()},
        "drawn": {
            "curve": (
                [float(ply.nodal(state.u)[0, corner]) for state in result.states],
                [float(scene.reaction(state)[0]) for state in result.states],
            ),
            "load_factor": result.states[-1].load_factor,
            "u": result.u.tolist(),
        },
    }
