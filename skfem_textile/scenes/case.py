"""Case: the complete input of one run, from the scene to the outputs."""

import os
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

from ..fabric import Fabric
from ..ply import Ply
from ..ply.formulations import DEFAULT
from ..ply.terms import Formulation, Load
from ..solve.newton import Method
from ..solve.quantities import Quantity
from ..solve.result import Result
from ..solve.stepper import DEFAULT_WARN_ONLY, LoadStepper
from .scene import Scene


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """Scene with its fabric, formulation, loads, load steps and outputs.

    Attributes
    ----------
    scene
        Mesh, displacement conditions and exact solution.
    fabric
        Fibre directions and laws.  The exact solution is valid for the directions of
        the scene.
    formulation
        See `Ply`.
    loads
        Loads besides the conditions of the scene.
    steps, method, warn_only, solver
        As for `LoadStepper`.
    pictures
        True if pictures are written in addition to summary, history and fields.
    defaults
        Note on default laws, which is printed; empty if there are none.

    Examples
    --------
    >>> from skfem_textile.scenes import strip
    >>> scene = strip(size=(2, 3))
    >>> fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    >>> case = Case(scene=scene, fabric=fabric, steps=2)
    >>> case.summary(case.run())["converged"]
    True
    """

    scene: Scene
    fabric: Fabric
    formulation: Formulation = DEFAULT
    loads: tuple[Load, ...] = ()
    steps: int = 20
    method: str | Method = "newton"
    warn_only: Collection[str] = DEFAULT_WARN_ONLY
    solver: str = "auto"
    pictures: bool = True
    defaults: str = ""

    def ply(self) -> Ply:
        """The ply at rest.

        Raises
        ------
        ValueError
            See `Ply`.
        """
        scene = self.scene
        of_fabric = scene.loads_of(self.fabric) if scene.loads_of else ()
        loads = *scene.loads, *of_fabric, *self.loads
        return Ply(
            *(scene.mesh, self.fabric, self.formulation, (*loads, *scene.tools)),
            dimension=scene.dimension,
            fibre_ends=scene.fibre_ends,
        )

    def stepper(self, checkpoint: str | os.PathLike[str] | None = None) -> LoadStepper:
        """Load stepper of the ply.

        Parameters
        ----------
        checkpoint
            As for `LoadStepper`.

        Raises
        ------
        ValueError
            See `Ply` and `LoadStepper`.
        """
        ply = self.ply()
        return LoadStepper(
            ply,
            self.scene.conditions,
            self.steps,
            method=self.method,
            warn_only=self.warn_only,
            checkpoint=checkpoint,
            initial_guess=self.scene.initial_guess(ply),
            solver=self.solver,
        )

    def run(self) -> Result:
        """Apply the whole load; see `stepper` and `LoadStepper.run` for errors."""
        return self.stepper().run()

    def summary(self, result: Result) -> dict[str, Any]:
        """Summary as `Scene.summary`; with further loads there is no exact solution."""
        scene = self.scene
        if self.loads:
            scene = replace(
                scene, misfit=("forces act in addition to the conditions of the scene")
            )
        summary = scene.summary(result)
        if not self.defaults:
            return summary
        note = Quantity("Note", "default_fabric").declared()
        first = [note, *summary["first"]]
        return {**summary, "default_fabric": self.defaults, "first": first}
