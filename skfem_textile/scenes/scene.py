"""Scene: geometry, conditions and exact solution of one problem; and its run."""

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from inspect import signature
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..fabric import Fabric, Law, is_zero
from ..ply import Ply
from ..ply.amount import Following, Programme
from ..ply.formulations import DEFAULT
from ..ply.terms import Formulation, Load
from ..solve.conditions import Condition
from ..solve.newton import Method
from ..solve.on_surface import OnSurface
from ..solve.quantities import Quantity
from ..solve.result import Driven, Result
from ..solve.states import State
from ..solve.stepper import DEFAULT_WARN_ONLY, LoadStepper
from ..surfaces.surface import SAME_AXES, Axes

if TYPE_CHECKING:
    from ..contact import Holder, Process, Tool
    from ..mesh.selection import FibreEnd
    from ..outlines import Outline
    from .plies import Plies
    from .shear_test import BiasTest, FrameTest

ExactField = Callable[[ndarray, float], ndarray]

# Relative load reduction by fibre stretch above which the summary reports it.
_WORTH_SAYING = 0.01

_P = ParamSpec("_P")
_T = TypeVar("_T")


def with_parameters(
    declaration: Callable[_P, _T],
) -> Callable[[Callable[[_T], "Scene"]], Callable[_P, "Scene"]]:
    """Give a function of declared parameters these parameters as its own.

    Parameters
    ----------
    declaration
        Dataclass of the parameters, which the function takes as one object.
    """

    def decorated(build: Callable[[_T], "Scene"]) -> Callable[_P, "Scene"]:
        @wraps(build)
        def scene(*args: _P.args, **kwargs: _P.kwargs) -> "Scene":
            return build(declaration(*args, **kwargs))

        given = signature(declaration).replace(return_annotation=Scene)
        scene.__signature__ = given  # type: ignore[attr-defined]
        return scene

    return decorated


def unknown(X: ndarray, t: float) -> ndarray:
    """Field without an exact solution; raises a ValueError."""
    raise ValueError(
        "the scene has no exact field: use its figures, which contain the exact values"
    )


def _no_figures(result: Result) -> Mapping[str, float]:
    return {}


@dataclass(frozen=True, eq=False)
class Scene:
    """Problem: mesh, fibre directions, conditions and exact solution.

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
        Name of the condition or tool with the reported reaction.
    displacement
        Exact displacement ``(X, t) -> (2, n)`` at the load factor t; `unknown` if
        ``figures`` have the exact values.
    shear_angle
        Exact shear angle ``(X, t) -> (n,)`` in radians.
    rotation
        Angle in radians by which the whole problem is rotated.
    load
        Exact force on the driven edge along the axis ``load_axis`` in N, ``(shear law,
        t) -> float``, for inextensible fibres; None if it is unknown or zero.
    load_axis
        Number of this axis: y by default.
    load_lost
        Estimated relative reduction of this force by fibre stretch, ``(fabric, t) ->
        float``; None if there is no estimate.
    misfit
        Reason why the exact solution is not valid on this mesh; empty if it is.
    shear_test
        The shear test that the scene represents, or None.
    dimension
        Number of displacement components, 3 for a ply in space.
    fibre_ends
        See `Ply`.
    loads
        Loads that are part of the problem.
    reacting
        Name of the condition with the reported reaction, if it is not the driven one.
    tools
        Tools and holders of a ply in space.
    loads_of
        Further loads, as a function of the fabric, or None.
    figures
        Further figures of a result, besides exact ones.
    measured
        Further figures of a result that need no exact solution.
    first
        Figures of the scene that are printed before the ones of every ply.
    axes
        Axes of the scene in the axes of the tool on which the ply lies.
    initial_guess
        Displacement of a ply near the equilibrium under the whole load, or None, see
        `LoadStepper`.
    programme
        Load programme that motions and loads follow, or None, see `through`.
    process
        Process whose tools are the tools of the scene, or None.
    plies
        Plies that are formed together, or None for one ply.
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
    load_axis: int = 1
    load_lost: Callable[[Fabric, float], float] | None = None
    misfit: str = ""
    shear_test: "BiasTest | FrameTest | None" = None
    dimension: int = 2
    fibre_ends: "Mapping[str, FibreEnd]" = field(default_factory=dict)
    loads: "tuple[Load, ...]" = ()
    tools: "tuple[Tool | Holder, ...]" = ()
    reacting: str = ""
    loads_of: "Callable[[Fabric], Sequence[Load]] | None" = None
    figures: Callable[[Result], Mapping[str, float]] = _no_figures
    measured: Callable[[Result], Mapping[str, float | str]] = _no_figures
    first: Sequence[Quantity] = ()
    axes: Axes = SAME_AXES
    initial_guess: Callable[[Ply], ndarray | None] | None = None
    programme: Programme | None = None
    process: "Process | None" = None
    plies: "Plies | None" = None

    def through(
        self, levels: Sequence[float], release: Collection[str] = ()
    ) -> "Scene":
        """The same problem with motions and loads that follow a load programme.

        Each passes through the levels in parts of equal length, see `Programme`;
        constant loads remain.  Only the exact fields of the scene remain of its
        figures.

        Parameters
        ----------
        levels
            Factors of the motions and loads at the ends of the parts.
        release
            Names of conditions that end after these parts; in one more part the others
            hold the ply.

        Raises
        ------
        ValueError
            If a level is not a finite number, a condition is unknown, or the ply is on
            or between tools.

        Examples
        --------
        >>> from skfem_textile.scenes import picture_frame
        >>> scene = picture_frame(size=(2, 2)).through([1.0, 0.0])
        >>> float(scene.shear_angle(scene.mesh.p, 1.0).max())
        0.0
        """
        self._refuse_programme(release)
        levels = tuple(levels)
        programme = Programme((*levels, levels[-1]) if levels and release else levels)
        end = 1 - 1 / len(programme.levels)

        def following(of: Any) -> Any:
            """A function that follows the programme; other values remain."""
            known = callable(of) and of is not unknown
            return Following(of, programme) if known else of

        loads: list[Any] = [*self.loads]
        return replace(
            self,
            conditions={
                name: replace(
                    c,
                    factor=following(c.factor),
                    until=end if name in release else c.until,
                )
                for name, c in self.conditions.items()
                if isinstance(c, Condition)
            },
            displacement=following(self.displacement),
            shear_angle=following(self.shear_angle),
            load=following(self.load),
            loads=tuple(replace(x, factor=following(x.factor)) for x in loads),
            fibre_ends={name: following(of) for name, of in self.fibre_ends.items()},
            figures=_no_figures,
            measured=_no_figures,
            first=(),
            programme=programme,
            misfit=self.misfit or ("conditions have ended" if release else ""),
        )

    def _refuse_programme(self, release: Collection[str]) -> None:
        """Refuse a programme between tools, or after which no condition remains."""
        on_tool = any(isinstance(c, OnSurface) for c in self.conditions.values())
        if self.tools or on_tool:
            raise ValueError(
                f"a programme does not apply to the scene {self.name}, whose ply is on "
                "or between tools: give the tools rows of motions, or phases"
            )
        if unknown_names := sorted({*release} - self.conditions.keys()):
            raise ValueError(
                f"the scene {self.name} has no condition {unknown_names[0]!r}: choose "
                f"from {', '.join(self.conditions)}"
            )
        if release and {*release} == self.conditions.keys():
            raise ValueError(
                "no condition remains: hold the ply by another condition, at two nodes "
                "or more"
            )

    def rotated(self, angle: float) -> "Scene":
        """The same problem with mesh, fibres, conditions and loads rotated together.

        Parameters
        ----------
        angle
            Angle in radians, anticlockwise about the origin.

        Raises
        ------
        ValueError
            If the angle is not finite, the scene is in space, or a load has no method
            ``turned``.
        """
        if not np.isfinite(angle):
            raise ValueError(f"the rotation must be a finite angle, got {angle}")
        if angle == 0:
            return self
        if self.dimension == 3:
            raise ValueError(
                f"the scene {self.name} is in space and cannot be rotated: omit the "
                "rotation"
            )
        Q, loads = _rotation(angle), list[Any](self.loads)
        for load in loads:
            if not hasattr(load, "turned"):
                raise ValueError(
                    f"the scene {self.name} has a load without a method turned(Q), "
                    f"{type(load).__name__}, and cannot be rotated"
                )
        return replace(
            self,
            mesh=replace(self.mesh, doflocs=Q @ self.mesh.p),
            warp=tuple(Q @ self.warp),
            weft=tuple(Q @ self.weft),
            conditions={
                k: c.turned(Q)
                for k, c in self.conditions.items()
                if isinstance(c, Condition)  # only plies in space are on surfaces
            },
            loads=tuple(load.turned(Q) for load in loads),
            displacement=partial(_turned_vector, of=self.displacement, Q=Q),
            shear_angle=partial(_turned_number, of=self.shear_angle, Q=Q),
            rotation=self.rotation + angle,
        )

    def graded(
        self,
        fabric: Fabric,
        density: float = 1.0,
        loads: "Iterable[Load]" = (),
        outline: "Outline | None" = None,
    ) -> "Scene":
        """The same problem on triangles that follow the singular fibres.

        Parameters
        ----------
        fabric
            Laws for which the mesh is graded; the directions of the scene are used.
        density, loads
            See `mesh_outline`; loads are further loads.
        outline
            The outline; by default the outline of the mesh.

        Raises
        ------
        ValueError
            If the scene is in space; see also `mesh_outline`.

        Examples
        --------
        >>> from skfem_textile.scenes import bias_extension
        >>> scene = bias_extension(size=(1, 1)).graded(Fabric(1e5, 0.5))
        >>> "singular fibres" in scene.mesh.boundaries
        True
        """
        if self.dimension == 3:
            raise ValueError(
                f"the scene {self.name} is in space: its mesh cannot be graded"
            )
        from ..outlines import Outline, mesh_outline

        fabric = replace(fabric, warp=self.warp, weft=self.weft)
        outline = Outline.of_mesh(self.mesh) if outline is None else outline
        loads = *self.loads, *loads
        mesh = mesh_outline(outline, fabric, self.conditions, loads, density=density)
        return replace(self, mesh=mesh)

    @property
    def turn(self) -> ndarray:
        """Rotation matrix of the whole problem."""
        return _rotation(self.rotation)

    def reaction(self, state: State) -> ndarray:
        """Force on the driven edge in N, shape (d,), along the unrotated axes.

        Nodes that other conditions hold too are included.  For a ply on a tool along
        the axes of the tool.
        """
        return self._unrotated(self._of(state.forces, self.reacting or self.driven))

    def driven_displacement(self, state: State) -> ndarray:
        """Mean displacement of the nodes of the driven edge in mm, shape (d,).

        Along the axes of `reaction`.
        """
        return self._unrotated(self._of(state.displacements, self.driven))

    def _of(self, vectors: Mapping[str, ndarray], name: str) -> ndarray:
        if name not in vectors:
            raise ValueError(
                f"the state has no condition {name!r}: it is not one of the scene "
                f"{self.name}"
            )
        return vectors[name]

    def driven_curve(self, result: Result) -> tuple[ndarray, ndarray]:
        """Displacement in mm and force in N of each state, shape (n_states,).

        Of the machine for a shear test, else of the driven edge along the axis of its
        larger displacement.  Forces below the equilibrium tolerance are 0.
        """
        moved = np.array([self.driven_displacement(one) for one in result.states])
        force = np.array([self.reaction(one) for one in result.states])
        left = np.array([one.tolerance for one in result.states])
        force[np.abs(force) <= result.ply.nodes.shape[1] * left[:, None]] = 0.0
        if self.shear_test is not None:
            return self.shear_test.measured(moved, force)
        axis = self._axis(result)
        return moved[:, axis], force[:, axis]

    def _driven(self, result: Result) -> Driven | None:
        """Driven edge in the last state; None for a ply on or between tools."""
        if not isinstance(self.conditions.get(self.driven), Condition):
            return None
        displacement, force = (x[-1].item() for x in self.driven_curve(result))
        error = result.error
        half = None if error.load is None else error.load * abs(force)
        if self.shear_test is not None:
            return Driven("machine", "machine", displacement, force, half)
        name = self.reacting or self.driven
        if name in error.reactions:  # which count shared nodes in part only
            halves = self._unrotated(np.diag(error.reactions[name]))
            own = np.abs(halves[self._axis(result)]).sum().item()
            half = max(own, half or 0.0)
        return Driven(self.driven, name, displacement, force, half)

    def _axis(self, result: Result) -> int:
        """Axis of the larger displacement of the driven edge."""
        moved = [self.driven_displacement(one) for one in result.states]
        return int(np.abs(moved).max(axis=0).argmax())

    def _unrotated(self, vector: ndarray) -> ndarray:
        turn = self.turn.T if len(vector) == 2 else self.axes.turn
        return turn @ vector

    def errors(self, result: Result) -> dict[str, float]:
        """Errors of the last state relative to the exact solution; see `distance`.

        Empty if the exact solution is not valid on the mesh.
        """
        if self.misfit or self.displacement is unknown:
            return {}
        ply, t = result.ply, result.states[-1].load_factor
        return self.distance(ply.nodes, ply.nodal(result.u), *result.at_centres(), t)

    def distance(
        self,
        nodes: ndarray,
        u: ndarray,
        centres: ndarray,
        angle: ndarray,
        area: ndarray,
        t: float,
    ) -> dict[str, float]:
        """Errors of displacements and shear angles.

        The displacement error is taken over all nodes, unweighted.  The shear angle at
        the element centre is compared with the exact one at the mean of the vertices,
        weighted by reference area.

        Parameters
        ----------
        nodes, u
            Nodes and their displacements in mm, shape (2, n_nodes).
        centres, angle, area
            For each computed element the mean of the vertices in mm, shape (2,
            n_elements), the shear angle at the centre in radians and the reference area
            in mm².
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

    def summary(self, result: Result) -> dict[str, Any]:
        """Summary of the result with the reaction and errors of this scene.

        If the exact solution is valid on the mesh, the summary contains
        ``load_over_exact``, ``displacement_error_...`` and ``shear_angle_error_...``.
        ``exact_answer`` states any limitation.
        """
        from ..contact.risks import most_compressed, share_of_area, wrinkle_risk

        state = result.states[-1]
        reaction = self.reaction(state).tolist()
        carried = state.shares.get(f"{self.reacting or self.driven}_reaction", {})
        summary = result.summary(self._driven(result))
        of_ply = result.ply, result.u, state.parameters
        at_risk, most = wrinkle_risk(*of_ply), most_compressed(*of_ply)
        stated = self.axes.of_tool if self.dimension == 3 else np.asarray
        return {
            "scene": self.name,
            **summary,
            "first": [*(one.declared() for one in self.first), *summary["first"]],
            **result.place_of_shear(stated),
            "wrinkle_risk_share_of_area": share_of_area(result.ply, at_risk),
            **result.place_of(most, "wrinkle_risk_at", stated),
            **{f"reaction_{x}": f for x, f in zip("xyz", reaction, strict=False)},
            **{f"reaction_share_of_{k}": v for k, v in carried.items()},
            **self._load_over_exact(result, reaction[self.load_axis]),
            **self.errors(result),
            **self.measured(result),
            **({} if self.misfit else self.figures(result)),
            **({"exact_answer": f"none: {self.misfit}"} if self.misfit else {}),
        }

    def _load_over_exact(
        self, result: Result, reaction: float
    ) -> dict[str, float | str]:
        """Load relative to the exact load, if this is known and not zero."""
        fabric, t = result.ply.fabric, result.states[-1].load_factor
        uniform = fabric.at() is fabric  # the exact load is valid for one law
        at_rest = t == 0 or is_zero(fabric.shear_law)
        if self.misfit or self.load is None or at_rest or not uniform:
            return {}
        if self.programme and (fabric.has_friction or not self.programme(t)):
            return {}  # it is the load of the first loading
        exact = self.load(fabric.shear_law, t)
        if not np.isfinite(exact):
            return {
                "exact_answer": (
                    "none: for inextensible fibres the shear angle is beyond the "
                    "domain of the shear law"
                )
            }
        figures: dict[str, float | str] = {"load_over_exact": reaction / exact}
        if self.load_lost is None:
            return figures
        figures["load_lost_to_fibre_stretch"] = lost = self.load_lost(fabric, t)
        if lost > _WORTH_SAYING:
            figures["exact_answer"] = (
                "valid for inextensible fibres: fibre stretch reduces the load by "
                f"about {100 * lost:.0f} %, so that load_over_exact converges to about "
                f"{1 - lost:.2f}, not to 1"
            )
        return figures


def _turned_vector(X: ndarray, t: float, of: ExactField, Q: ndarray) -> ndarray:
    return Q @ of(Q.T @ X, t)


def _turned_number(X: ndarray, t: float, of: ExactField, Q: ndarray) -> ndarray:
    return of(Q.T @ X, t)


def _rotation(angle: float) -> ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


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
    defaults, changes
        Notes on default laws, and on changes of the mesh, which are printed; empty if
        there are none.
    describe
        Name of the phase at whose end the ply is `described`, or None.

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
    steps: int | Sequence[int] = 20
    method: str | Method = "newton"
    warn_only: Collection[str] = DEFAULT_WARN_ONLY
    solver: str = "auto"
    pictures: bool = True
    defaults: str = ""
    changes: str = ""
    describe: str | None = None

    def ply(self) -> Ply:
        """The ply at rest, or the `contact.Stack` of the plies of the scene.

        Raises
        ------
        ValueError
            See `Ply`.
        """
        scene = self.scene
        of_fabric = scene.loads_of(self.fabric) if scene.loads_of else ()
        terms = *scene.loads, *of_fabric, *self.loads, *scene.tools

        def ply(fabric: Fabric, *terms: Any) -> Ply:
            d, ends = scene.dimension, scene.fibre_ends
            of_ply = scene.mesh, fabric, self.formulation, terms
            return Ply(*of_ply, dimension=d, fibre_ends=ends)

        if scene.plies is None:
            return ply(self.fabric, *terms)
        return scene.plies.stack(self.fabric, ply, terms)

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
        ply, scene = self.ply(), self.scene
        return LoadStepper(
            ply,
            scene.conditions,
            self.steps,
            method=self.method,
            warn_only=self.warn_only,
            checkpoint=checkpoint,
            initial_guess=scene.initial_guess(ply) if scene.initial_guess else None,
            solver=self.solver,
        )

    def run(self) -> Result:
        """Apply the whole load; see `stepper` and `LoadStepper.run` for errors."""
        return self.stepper().run()

    def described(self, result: Result) -> Result:
        """Result up to the state of the summary, the pictures and the exported part.

        At the end of the phase ``describe``; by default the last state before the tools
        open, in which the tool that reaches deepest beyond the plane of the flat ply is
        deepest and the other tools have not opened.  The last state if there is no
        tool, and of a run that stopped early.
        """
        if not (result.converged and self.scene.tools):
            return result
        states, process = result.states, self.scene.process
        if self.describe and process:
            here = [process.phase_at(x.load_factor) == self.describe for x in states]
            return result.until(int(np.flatnonzero(here)[-1]))
        if self.scene.driven in self.scene.conditions:
            return result
        from ..contact.figures import last_closed

        return result.until(last_closed(result))

    def _description(self, result: Result) -> str:
        """Which state a result up to it describes; empty for the last one."""
        if not result.later:
            return ""
        t, process = result.states[-1].load_factor, self.scene.process
        at = process.time(t, result.later[0].load_factor) if process else "at"
        why = "" if self.describe else ", before the tools open"
        return (
            f"{at} load factor {t:.4g}{why}; later states are in history.csv"
            f"{', phases.csv' if process else ''} and fields"
        )

    def summary(self, result: Result) -> dict[str, Any]:
        """Summary as `Scene.summary` of the state in which a result is `described`.

        With further loads there is no exact solution.
        """
        scene, result = self.scene, self.described(result)
        if self.loads:
            misfit = "forces act in addition to the conditions of the scene"
            scene = replace(scene, misfit=misfit)
        summary = scene.summary(result)
        notes = {
            Quantity("Mesh", "mesh_changes"): self.changes,
            Quantity("Note", "default_fabric"): self.defaults,
            Quantity("Described", "described"): self._description(result),
        }
        for quantity, text in notes.items():
            if text:
                first = [quantity.declared(), *summary["first"]]
                summary |= {quantity.key: text, "first": first}
        return summary
