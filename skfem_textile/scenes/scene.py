"""A scene: geometry, conditions and exact answer of one problem."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..drape import SAME_AXES, Axes
from ..fabric import Fabric, Law, is_zero
from ..solve.conditions import Condition
from ..solve.result import Result
from ..solve.states import State
from ..solve.surface import OnSurface
from .shear_test import BiasTest, FrameTest

if TYPE_CHECKING:
    from ..ply.own_terms import FibreEnd
    from ..ply.terms import Load

ExactField = Callable[[ndarray, float], ndarray]

# From this share of the load on, a sentence tells what fibre stretch costs.
_WORTH_SAYING = 0.01


def unknown(X: ndarray, t: float) -> ndarray:
    """A field of which no exact answer is known; raises a ValueError."""
    raise ValueError("the scene has no exact field: its figures say what is exact")


@dataclass(frozen=True, eq=False)
class Scene:
    """One problem: mesh, fibre directions, conditions and exact answer.

    Attributes
    ----------
    name
        Name of the scene.
    mesh
        Reference configuration: the user's mesh, which a `Ply` may split.
    warp, weft
        Fibre directions.
    conditions
        Conditions by name.
    driven
        Name of the condition whose nodes have the reported reaction.
    displacement
        Exact displacement ``(X, t) -> (2, n)`` at the load factor t; `unknown`
        where ``figures`` say what is exact.
    shear_angle
        Exact shear angle ``(X, t) -> (n,)`` in radians.
    rotation
        Angle in radians by which the whole problem has been turned.
    load
        Exact force along y on the driven edge in N, ``(shear law, t) -> float``, if
        fibres do not stretch; None if it is unknown or zero.
    load_lost
        Estimate of the share of this force that is lost because fibres do stretch,
        ``(fabric, t) -> float``; None if there is no estimate.
    misfit
        Why the exact answer does not hold on this mesh; empty if it does.
    shear_test
        The test of shear that this is; None if it is none.
    dimension
        Components of the displacement, 3 of a ply in space.
    fibre_ends
        As of `Ply`.
    loads
        Loads that are part of the problem.
    reacting
        Name of the condition whose nodes have the reported reaction, where it is not
        the driven one.
    loads_of
        Further loads, which depend on the fabric.
    figures
        Further figures of a result, beside exact ones.
    measured
        Further figures of a result that need no exact answer.
    axes
        Axes of the scene among those of the tool on which the ply lies.
    """

    name: str
    mesh: Mesh
    warp: tuple[float, float]
    weft: tuple[float, float]
    conditions: Mapping[str, Condition | OnSurface]
    driven: str
    displacement: ExactField = field(default_factory=lambda: unknown)
    shear_angle: ExactField = field(default_factory=lambda: unknown)
    rotation: float = 0.0
    load: Callable[[Law, float], float] | None = None
    load_lost: Callable[[Fabric, float], float] | None = None
    misfit: str = ""
    shear_test: BiasTest | FrameTest | None = None
    dimension: int = 2
    fibre_ends: "Mapping[str, FibreEnd]" = field(default_factory=dict)
    loads: "tuple[Load, ...]" = ()
    reacting: str = ""
    loads_of: "Callable[[Fabric], Sequence[Load]]" = lambda fabric: ()
    figures: Callable[[Result], Mapping[str, float]] = lambda result: {}
    measured: Callable[[Result], Mapping[str, float | str]] = lambda result: {}
    axes: Axes = SAME_AXES

    def rotated(self, angle: float) -> "Scene":
        """The same problem with mesh, fibres and conditions turned together.

        Parameters
        ----------
        angle
            Angle in radians, anticlockwise about the origin.

        Raises
        ------
        ValueError
            If the angle is not finite, or the scene in space.
        """
        if not np.isfinite(angle):
            raise ValueError(f"rotation must be a finite angle, got {angle}")
        if angle == 0:
            return self
        if self.dimension == 3:
            raise ValueError(f"the scene {self.name} is in space and is not turned")
        Q = _rotation(angle)
        displacement, shear_angle = self.displacement, self.shear_angle
        return replace(
            self,
            mesh=replace(self.mesh, doflocs=Q @ self.mesh.p),
            warp=tuple(Q @ self.warp),
            weft=tuple(Q @ self.weft),
            conditions={
                k: c.turned(Q)
                for k, c in self.conditions.items()
                if isinstance(c, Condition)  # on a surface plies in space alone are
            },
            displacement=lambda X, t: Q @ displacement(Q.T @ X, t),
            shear_angle=lambda X, t: shear_angle(Q.T @ X, t),
            rotation=self.rotation + angle,
        )

    @property
    def turn(self) -> ndarray:
        """Rotation matrix of the whole problem."""
        return _rotation(self.rotation)

    def reaction(self, state: State) -> ndarray:
        """Force on the driven edge in N, shape (d,), along the unrotated axes."""
        return self._unrotated(state.reactions[self.reacting or self.driven])

    def driven_displacement(self, state: State) -> ndarray:
        """Mean displacement of the nodes of the driven edge in mm, shape (d,).

        Along the unrotated axes.
        """
        return self._unrotated(state.displacements[self.driven])

    def _unrotated(self, vector: ndarray) -> ndarray:
        return self.turn.T @ vector if len(vector) == 2 else vector

    def errors(self, result: Result) -> dict[str, float]:
        """Distance of the last converged state from the exact answer; see `distance`.

        Empty if the exact answer does not hold on the mesh.
        """
        if self.misfit or self.displacement is unknown:
            return {}
        ply, t = result.ply, result.states[-1].load_factor
        angle = ply.shear_angle(result.u, ply.centre)[:, 0]
        area = np.abs(ply.basis.mapping.detDF(ply.centre))[:, 0]
        centres = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
        return self.distance(ply.nodes, ply.nodal(result.u), centres, angle, area, t)

    def distance(
        self,
        nodes: ndarray,
        u: ndarray,
        centres: ndarray,
        angle: ndarray,
        area: ndarray,
        t: float,
    ) -> dict[str, float]:
        """Distance of displacements and shear angles from the exact ones.

        The displacement error is taken over all nodes, unweighted.  The shear
        angle at the element centre is compared with the exact one at the mean of
        the vertices, weighted by reference area.

        Parameters
        ----------
        nodes, u
            Nodes and their displacements in mm, shape (2, n_nodes).
        centres, angle, area
            Of each element that is computed with the mean of the vertices in mm, shape
            (2, n_elements), the shear angle at the centre in radians and the reference
            area in mm².
        t
            Load factor.
        """
        distance = np.linalg.norm(u - self.displacement(nodes, t), axis=0)
        off_angle = angle - self.shear_angle(centres, t)
        rms_angle = np.sqrt(np.average(off_angle**2, weights=area))
        return {
            "displacement_error_rms": float(np.sqrt(np.mean(distance**2))),
            "displacement_error_max": float(distance.max()),
            "shear_angle_error_rms_deg": float(np.degrees(rms_angle)),
        }

    def summary(self, result: Result) -> dict[str, str | int | float | bool]:
        """The result's summary with this scene's reaction and errors.

        If the exact answer holds on the mesh, the summary has ``load_over_exact``,
        ``displacement_error_...`` and ``shear_angle_error_...``.  If something limits
        them, the sentence ``exact_answer`` says what.
        """
        state = result.states[-1]
        reaction = self.reaction(state).tolist()
        carried = state.shares[f"{self.reacting or self.driven}_reaction"]
        return {
            "scene": self.name,
            **result.summary(),
            **{f"reaction_{x}": f for x, f in zip("xyz", reaction, strict=False)},
            **{f"reaction_share_of_{k}": v for k, v in carried.items()},
            **self._load_over_exact(result, reaction[1]),
            **self.errors(result),
            **self.measured(result),
            **({} if self.misfit else self.figures(result)),
            **({"exact_answer": f"none: {self.misfit}"} if self.misfit else {}),
        }

    def _load_over_exact(
        self, result: Result, reaction_y: float
    ) -> dict[str, float | str]:
        """The load over the exact load, if this is known and not zero."""
        fabric, t = result.ply.fabric, result.states[-1].load_factor
        uniform = fabric.at() is fabric  # the exact load holds for one law
        if self.misfit or self.load is None or not uniform:
            return {}
        if is_zero(fabric.shear_law) or t == 0:
            return {}
        exact = self.load(fabric.shear_law, t)
        if not np.isfinite(exact):
            return {
                "exact_answer": "none: without fibre stretch the shear angle is beyond "
                "the domain of the shear law"
            }
        found: dict[str, float | str] = {"load_over_exact": reaction_y / exact}
        if self.load_lost is None:
            return found
        found["load_lost_to_fibre_stretch"] = lost = self.load_lost(fabric, t)
        if lost > _WORTH_SAYING:
            found["exact_answer"] = (
                "of fibres that do not stretch; stretch costs about "
                f"{100 * lost:.0f} % of the load: load_over_exact converges to about "
                f"{1 - lost:.2f}, not to 1"
            )
        return found


def _rotation(angle: float) -> ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
