"""Result of a run, and the error that ends a run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy import ndarray

from .. import solve
from ..mesh.bases import components
from ..mesh.user_input import CopiedError
from ..ply import Ply
from ..ply.terms import ContactTerm
from ..surfaces.surface import Surface
from .conditions import Conditions
from .continuation import path_warning
from .linear.solver import Choice
from .on_surface import OnSurface
from .quantities import IN_PLANE, IN_SPACE, LOST, OF_PLY, SLIP, Quantity, first_rows
from .search import state_at
from .states import State

if TYPE_CHECKING:
    from .interval import ErrorInterval

#: Warning of a run in which nothing changes with the load factor.
UNCHANGING = (
    "nothing changes with the load factor: no condition prescribes a nonzero "
    "displacement, and there is no load; check the displacements of the conditions"
)

# Maximum number of states in a printed result.
_LINES = 11

# Maximum number of elements listed in an error message.
_ELEMENTS = 5

# Relative difference of angles that are equal within the tolerance of equilibrium.
_EQUAL = 1e-6

# Terms that are in every table, listed first and in this order.
_TERMS = ("tension", "shear", "stabilisation", "corners")


class ToolMotion(NamedTuple):
    """Travel of a tool in mm, or its rotation in degrees, from its initial position."""

    name: str
    amount: float
    unit: str

    def __str__(self) -> str:
        return f"{self.name} {self.amount:.1f}{' mm' if self.unit == 'mm' else '°'}"


class Driven(NamedTuple):
    """Displacement of a boundary in mm and load in N, along one axis.

    ``moved`` and ``loaded`` are the names of the boundaries.  ``half_width`` of the
    error interval of the load is in N, or None.
    """

    moved: str
    loaded: str
    displacement: float
    load: float
    half_width: float | None = None

    def figures(self) -> dict[str, Any]:
        """Figures of a summary, and their declaration for ``first``."""
        quantities = [
            Quantity(f"Load ({self.loaded})", "load_N", "N", has_interval=True),
            Quantity(f"Displacement ({self.moved})", "displacement_mm", "mm"),
        ]
        return {
            "load_N": self.load,
            "load_N_half_width": self.half_width,
            "displacement_mm": self.displacement,
            "first": [one.declared() for one in quantities],
        }


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Converged states of a run, beginning with the undeformed ply.

    Attributes
    ----------
    ply
        The ply.
    states
        Converged states in order of load factor.
    converged
        True if the whole load was applied.
    linear_solves, factorisations
        Total number of linear solves and factorisations, including abandoned steps.
    steps_cut
        Number of halved steps.
    unresolved
        Load factors at which another number of steps may lead to another equilibrium.
    wall_time_s, assembly_time_s, solve_time_s
        Time of the run and its two largest parts; the solve time includes the
        measurements of ``auto``.
    solver
        Name of the linear solver, and the reason for its choice.
    surfaces
        The conditions that keep nodes on surfaces, by name.
    unchanging
        True if nothing changes with the load factor.
    interval
        Function that returns the `ErrorInterval` of a state of the ply.
    later
        States after those in ``states``, see `until`.
    """

    ply: Ply
    states: list[State]
    converged: bool
    linear_solves: int
    factorisations: int
    steps_cut: int
    unresolved: tuple[float, ...]
    wall_time_s: float
    assembly_time_s: float
    solve_time_s: float
    solver: Choice
    surfaces: Mapping[str, OnSurface]
    unchanging: bool
    interval: "Callable[[State], ErrorInterval]"
    later: Sequence[State] = field(default=(), kw_only=True)

    def until(self, state: int) -> "Result":
        """Result whose last state is an earlier one; ``later`` has the states after it.

        Warnings and the number of steps describe the whole run.

        Parameters
        ----------
        state
            Index of the state.
        """
        first, later = self.states[: state + 1], self.states[state + 1 :]
        if not later:
            return self
        return replace(self, states=first, later=[*later, *self.later])

    @property
    def plies(self) -> "list[Result]":
        """Results of the plies of a stack from the lowest, see `of_ply`."""
        return [self.of_ply(i + 1) for i in range(len(getattr(self.ply, "plies", ())))]

    def of_ply(self, number: int) -> "Result":
        """Result of a ply of a stack where it lies, by its number, 1 for the lowest.

        Reactions are of tools on it; energy lost by friction on other bodies is not
        contained.  A ValueError if there is no such ply, or no stack.
        """
        from .of_stack import of_ply

        result: Result = of_ply(self, number)
        return result

    @property
    def every_state(self) -> list[State]:
        """The states and ``later`` ones."""
        return [*self.states, *self.later]

    @classmethod
    def of_state(
        cls, ply: Ply, conditions: Conditions, state: State | ndarray
    ) -> "Result":
        """Result of a single state, for pictures and files.

        Times and factorisations are 0, and there is no error interval.

        Parameters
        ----------
        ply, conditions
            The ply and its conditions by name.
        state
            State of the ply, such as the result of `equilibrium_near`; or its
            displacement at the load factor 1, shape (n_unknowns,), which counts as
            converged if it is an equilibrium under the conditions.  What a
            `LoadStepper` would refuse is a warning.

        Raises
        ------
        ValueError
            If it is not a displacement of this ply, or a condition is invalid.
        """
        if isinstance(state, State):
            ply.refuse_other(state.u)
            converged = state.load_factor == 1.0
        else:
            state, converged = state_at(ply, conditions, state)
        on = {k: c for k, c in conditions.items() if isinstance(c, OnSurface)}
        return cls(
            ply=ply,
            states=[state],
            converged=converged,
            linear_solves=state.linear_solves,
            factorisations=0,
            steps_cut=0,
            unresolved=(),
            wall_time_s=0.0,
            assembly_time_s=0.0,
            solve_time_s=0.0,
            solver=Choice("none", "the state was not computed by a run"),
            surfaces=on,
            unchanging=False,
            interval=_no_interval,
        )

    @property
    def path_resolved(self) -> bool:
        """True if no step indicated that more steps may lead to another final state."""
        return not self.unresolved

    def tool(self, t: float) -> Surface | None:
        """Surface on which all nodes lie at a load factor, or None."""
        for name, condition in self.surfaces.items():
            if condition.where is None:
                return condition.at(name, t)
        return None

    @property
    def not_on_tool(self) -> str:
        """Reason why the last state is not on its tool; empty if it is, or without one.

        A surface that grows has its own size at the load factor 1 only.
        """
        t = self.states[-1].load_factor
        if not self.surfaces or t == 1:
            return ""
        if t == 0:
            return "the ply is flat: no state on the tool was found"
        return f"the ply lies on the tool enlarged by {1 / t:.4g}, not on the tool"

    def tool_motions(self, t: float) -> list[ToolMotion]:
        """Travels and rotations of the tools that move during the run.

        Parameters
        ----------
        t
            Load factor.
        """
        factors = [state.load_factor for state in self.states]
        motions = []
        for tool in self._tools():
            if any(np.any(tool.travel(x)) for x in factors):
                far = float(np.linalg.norm(tool.travel(t)))
                motions.append(ToolMotion(tool.name, far, "mm"))
            if any(tool.rotation(x) for x in factors):
                angle = float(np.degrees(tool.rotation(t)))
                motions.append(ToolMotion(tool.name, angle, "°"))
        return motions

    @property
    def u(self) -> ndarray:
        """Displacement of the last converged state."""
        return self.states[-1].u

    @cached_property
    def error(self) -> "ErrorInterval":
        """Interval of the error of the last state, computed at first access."""
        return self.interval(self.states[-1])

    @cached_property
    def warnings(self) -> list[str]:
        """Warnings of the run, one line each.

        They state that nothing changes with the load factor; the checks that failed but
        only warn, each with the first load factor; an unresolved path; users' terms
        whose energy, residual and tangent contradict each other at the last state; and
        friction without contact or in long steps, extrapolated laws of compaction and
        holders over an opening.
        """
        failed: dict[str, list[State]] = {}
        for state in self.every_state:
            for check in state.warnings:
                failed.setdefault(check, []).append(state)
        lines = [UNCHANGING] if self.unchanging else []
        for check, (first, *others) in failed.items():
            more = f" (and in {_counted(len(others), 'more state')})" if others else ""
            where = f"load factor {first.load_factor:g}"
            lines.append(f"{where}: {first.warnings[check]}{more}")
        if self.unresolved:
            lines.append(path_warning(self.unresolved))
        return [
            *lines,
            *self.error.warnings,
            *self.ply.contradictions(self.every_state),
        ]

    def view(self, **options: Any) -> Any:
        """Show a state in 3D, in Jupyter or in a window; see `skfem_textile.plot.view`.

        Parameters, returned value and exceptions as there.  Nothing is imported for it
        before it is called.
        """
        return solve.viewer(self, **options)

    def history(self, turn: ndarray | None = None) -> list[dict[str, float | None]]:
        """Table with one row per converged state.

        Displacements and reactions are multiplied by the matrix ``turn``, if given.
        Columns: load_factor, linear_solves, residual (N), tolerance (N),
        negative_pivots, min_det_F, max_fibre_strain, mesh_fibre_strain; for each
        condition displacement_x and displacement_y, the mean over its nodes (mm), and
        reaction_x and reaction_y (N), in space also z; the energy in total and by term,
        and with friction and clamps the part of it that is lost; potentials of the
        loads, and work of reactions and loads along the path (N·mm); shares of
        stabilisation and deviations in energy, work and reactions; for each clamp also
        the magnitude of its force (N).
        """
        rows, work = [], 0.0
        for state in self.states:
            verdict = asdict(state.verdict)
            work += verdict.pop("work")
            row = {
                "load_factor": state.load_factor,
                "linear_solves": state.linear_solves,
                "residual": state.residuals[-1] if state.residuals else 0.0,
                "tolerance": state.tolerance,
                **verdict,
            }
            for name, reaction in state.reactions.items():
                vectors = {"displacement": state.displacements[name]}
                for what, vector in (vectors | {"reaction": reaction}).items():
                    vector = vector if turn is None else turn @ vector
                    components = zip("xyz", vector.tolist(), strict=False)
                    row |= {f"{name}_{what}_{axis}": x for axis, x in components}
            row |= self.clamp_forces(state)
            row |= _columns(state.shares) | _energies(state) | {"work": work}
            rows.append(row)
        return rows

    def summary(self, driven: Driven | None = None) -> dict[str, Any]:
        """Summary of the last converged state and of the run, in N, mm and degrees.

        ``first`` lists the quantities that are printed first, with names and units
        (`Quantity`).  ``load_N`` and ``displacement_mm`` belong to ``driven``; by
        default of the condition and axis with the largest product of both.
        ``max_fibre_strain`` is the largest magnitude of the strain in the tension law;
        ``max_fibre_tension`` and ``max_shear_angle_deg`` are largest values at the
        integration points of the ply.  ``mesh_fibre_strain`` is evaluated at the fine
        points of the ply, the 2×2 points of quadrilaterals or six points of quadratic
        triangles, and ``min_det_F`` also at the nodes of the elements.
        ``mesh_fibre_strain`` measures element distortion; it does not enter the law.

        In space ``recovered_max_shear_angle_deg`` is the largest value, at nodes and
        element centres, of quadratic polynomials through the centres around each node.

        ``load_half_width``, relative to the load, and ``shear_angle_error_deg``, a root
        mean square, describe the discretisation error (`error`).  ``error_interval`` is
        "by the numerical stiffness", with tools and surfaces "by the numerical
        stiffness and the contact between nodes"; if both are None it begins with
        "none: " and states the reason.  For a ply on a tool without loads, only the
        errors of the shear angle are available.  For a ply between tools, the figures
        of `skfem_textile.contact.formed` follow; `warnings`, if there are any, are
        last.
        """
        ply, u, state = self.ply, self.u, self.states[-1]
        verdict, shares, error = state.verdict, state.shares, self.error
        angle, tension = error.shear_angle, ply.fibre_tension(u, state.parameters)
        of_load, of_tools = self._figures_of_load(driven), self._figures_of_tools()
        of_clamps = self._figures_of_clamps()
        in_space = components(ply.basis) == 3
        of_shear: dict[str, float | None] = {}
        if in_space:
            key, half = IN_SPACE.key, error.of_largest_angle(ply, u)
            of_shear[key] = float(np.degrees(ply.largest_shear_angle(u)))
            of_shear[f"{key}_half_width"] = half and float(np.degrees(half))
        figures = of_load, of_tools, of_clamps
        first = [row for one in figures for row in one.get("first", [])]
        return {
            "formulation": ply.formulation.name,
            "n_elements": int(ply.mesh.nelements),
            "n_dofs": int(ply.basis.N),
            "converged": self.converged,
            "load_factor": state.load_factor,
            "load_steps": len(self.every_state) - 1,
            "steps_cut": self.steps_cut,
            "path_resolved": self.path_resolved,
            "linear_solves": self.linear_solves,
            "factorisations": self.factorisations,
            "stable": verdict.stable,
            "negative_pivots": verdict.negative_pivots,
            "min_det_F": verdict.min_det_F,
            **_energies(state),
            **_columns({of: shares[of] for of in ("energy", "work")}),
            "max_fibre_strain": verdict.max_fibre_strain,
            "mesh_fibre_strain": verdict.mesh_fibre_strain,
            "max_fibre_tension": float(np.abs(tension).max()),
            "max_shear_angle_deg": float(np.degrees(np.abs(ply.shear_angle(u)).max())),
            **of_shear,
            **self.place_of_shear(),
            **self._figures_of_slip(),
            **of_load,
            "load_half_width": error.load,
            "shear_angle_error_deg": (
                None if angle is None else float(np.degrees(angle))
            ),
            "error_interval": self._method_of_error(),
            "wall_time_s": self.wall_time_s,
            "assembly_time_s": self.assembly_time_s,
            "solve_time_s": self.solve_time_s,
            "solver": self.solver.name,
            "solver_reason": self.solver.reason,
            **({"not_on_tool": self.not_on_tool} if self.not_on_tool else {}),
            **of_tools,
            **of_clamps,
            "first": self._first(first, of_shear),
            **({"warnings": self.warnings} if self.warnings else {}),
        }

    def _method_of_error(self) -> str:
        """Method of the estimated errors, or the reason why there is none."""
        error, known = self.error, self.error.shear_angle is not None
        how = error.method if known else "none"
        if not error.reason:
            return how
        return f"{how}{'; none for the load' if known else ''}: {error.reason}"

    def _first(
        self, figures: list[dict[str, Any]], of_shear: Mapping[str, Any]
    ) -> list[dict[str, Any]]:
        """Quantities that are printed first: given ones, then the ones of every ply."""
        angle = IN_PLANE
        if of_shear:  # the reason for a missing interval is printed once
            known = of_shear[f"{IN_SPACE.key}_half_width"] is not None
            stated = any(row.get("has_interval") for row in figures)
            angle = IN_SPACE._replace(has_interval=known or not stated)
        stated = any(row["name"] == LOST.name for row in figures)  # of the whole ply
        lost = (LOST,) if self.states[-1].energy_lost and not stated else ()
        slip = (SLIP,) if self.ply.fabric.yarns else ()
        own = (one.declared() for one in (angle, *lost, *OF_PLY, *slip))
        return [*figures, *own]

    def at_centres(self) -> tuple[ndarray, ndarray, ndarray]:
        """Means of the vertices of elements, (2, n), shear angles there, and areas.

        Shear angles in the last state, and areas in the reference configuration, (n,).
        """
        ply = self.ply
        angle = ply.shear_angle(self.u, ply.centre)[:, 0]
        area = np.abs(ply.basis.mapping.detDF(ply.centre))[:, 0]
        return ply.mesh.p[:, ply.mesh.t].mean(axis=1), angle, area

    def place_of_shear(
        self, stated: Callable[[ndarray], ndarray] = lambda x: x
    ) -> dict[str, float]:
        """Centre of the element with the largest shear angle in mm, for a summary.

        The first of those whose angles are equal within round-off.  Positions, shape
        (d, n), are converted by ``stated``.
        """
        angle = np.abs(self.ply.shear_angle(self.u)).max(axis=1)
        first = int((angle >= (1 - _EQUAL) * angle.max()).argmax())
        return self.place_of(first, "max_shear_angle_at", stated)

    def place_of(
        self, element: int | None, name: str, stated: Callable[[ndarray], ndarray]
    ) -> dict[str, float]:
        """Current centre of an element in mm, by keys that begin with a name.

        The position, shape (d, 1), is converted by ``stated``.  Empty without an
        element, and for a ply that is not on its tool.
        """
        if element is None or self.not_on_tool:
            return {}
        corners = self.ply.positions(self.u)[:, self.ply.mesh.t[:, element]]
        place = stated(corners.mean(axis=1, keepdims=True))[:, 0]
        return components_mm(name, place)

    def _figures_of_slip(self) -> dict[str, float]:
        """Figures of the slip index; empty for a fabric without yarns."""
        if self.ply.fabric.yarns is None:
            return {}
        from ..ply.slip import slip_figures

        return slip_figures(self.ply, self.u, self.states[-1].parameters)

    def _figures_of_load(self, driven: Driven | None) -> dict[str, Any]:
        """Load and displacement; the largest displacement if only loads deform a ply.

        Without ``driven`` of the condition and axis with the largest product of both.
        """
        state, tools = self.states[-1], self._tools()
        if driven is None and not self.surfaces:
            least = self.ply.nodes.shape[1] * state.tolerance
            others = [x.name for x in (*tools, *self._clamps())]
            pairs = [
                Driven(name, name, moved, force, half)
                for name, displacement in state.displacements.items()
                if name not in others
                for moved, force, half in zip(
                    displacement.tolist(),
                    state.reactions[name].tolist(),
                    self.error.half_widths(name, len(displacement)),
                    strict=True,
                )
                if moved and abs(force) > least
            ]
            driven = max(
                pairs, key=lambda x: abs(x.displacement * x.load), default=None
            )
        if driven is not None:
            return driven.figures()
        if self.surfaces or tools:
            return {}
        largest = np.linalg.norm(self.ply.nodal(self.u), axis=0).max()
        first = Quantity("Largest displacement", "max_displacement_mm", "mm")
        return {"max_displacement_mm": float(largest), "first": [first.declared()]}

    def _tools(self) -> list[ContactTerm]:
        return [x for x in self.ply.terms if isinstance(x, ContactTerm)]

    def _clamps(self) -> list[Any]:
        return [x for x in self.ply.terms if x.release is not None]

    def clamp_forces(self, state: State) -> dict[str, float]:
        """Magnitude of the force of each clamp in a state in N, ``NAME_force_N``."""
        if not (clamps := self._clamps()):
            return {}
        from .clamp_release import clamp_forces

        return clamp_forces(clamps, state)

    def _figures_of_clamps(self) -> dict[str, Any]:
        if not (clamps := self._clamps()):
            return {}
        from .clamp_release import clamp_figures

        of_part = "mirror" in self.ply.fibre_ends.values()
        return clamp_figures(clamps, self.states, of_part)

    def _figures_of_tools(self) -> dict[str, Any]:
        figures: dict[str, Any] = {}
        for figures_of in dict.fromkeys(type(tool).figures for tool in self._tools()):
            of_terms = figures_of(self)
            first = figures.get("first", []) + of_terms.get("first", [])
            figures |= of_terms | ({"first": first} if first else {})
        return figures

    def _head(self) -> str:
        end = "converged" if self.converged else "stopped early"
        if not self.converged and self.states[-1].load_factor == 1.0:
            end = "no equilibrium"
        steps = _counted(len(self.states) - 1, "step")
        solves = _counted(self.linear_solves, "linear solve")
        at = f"{self.states[-1].load_factor:g}"
        return f"Result: {end} at load factor {at}, {steps}, {solves}"

    def __repr__(self) -> str:
        """Quantities that are read first, with units and the error interval."""
        rows = (f"  {name:22}  {text}" for name, _, text in first_rows(self.summary()))
        return "\n".join([self._head(), *rows])

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        rows = (
            f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>"
            for name, _, text in first_rows(self.summary())
        )
        return f"<table><caption>{self._head()}</caption>{''.join(rows)}</table>"

    def __str__(self) -> str:
        """A compact table of the states; if they are many, of an even selection.

        With the travel of each tool that moves in mm, and its rotation in degrees; then
        the quantities that are read first.
        """
        of_tools = [f"{x.name} ({x.unit})" for x in self.tool_motions(0.0)]
        tools = "".join(f"  {head:>9}" for head in of_tools)
        head = "load factor      solves     energy fibre strain  min det F  stable"
        lines = [head.replace("factor", f"factor{tools}")]
        chosen = np.linspace(0, len(self.states) - 1, _LINES).round().astype(int)
        for i in (chosen := np.unique(chosen)):
            state, verdict = self.states[i], self.states[i].verdict
            amounts = [x.amount for x in self.tool_motions(state.load_factor)]
            moved = "".join(
                f"  {amount:{max(9, len(name))}.2f}"
                for amount, name in zip(amounts, of_tools, strict=True)
            )
            lines.append(
                f"{state.load_factor:11.4f}{moved}{state.linear_solves:12}"
                f"{sum(state.energies.values()):11.4g}"
                f"{verdict.max_fibre_strain:13.2e}{verdict.min_det_F:11.3f}"
                f"{'yes' if verdict.stable else 'no':>8}"
            )
        if left_out := len(self.states) - len(chosen):
            more = _counted(left_out, "more state")
            lines.append(f"          … {more} in between: see .states")
        return "\n".join([*lines, repr(self)])


def _counted(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"


def _no_interval(state: State) -> "ErrorInterval":
    from .interval import ErrorInterval

    return ErrorInterval(reason="the state was not computed by a run")


class StepError(CopiedError, RuntimeError):
    """Error that ends a run: no acceptable state was found.

    Attributes
    ----------
    result
        All previous states, including the last accepted one.
    elements
        Numbers of the elements where the last attempt failed; empty if the failure is
        not local.
    quantity
        Quantity at or beyond the end of its law's domain there: warp_strain,
        weft_strain or shear_angle; empty if there is none.
    """

    def __init__(
        self, message: str, result: Result, elements: ndarray, quantity: str = ""
    ) -> None:
        super().__init__(message)
        self.result = result
        self.elements = elements
        self.quantity = quantity

    @classmethod
    def after(
        cls, error: Exception, result: Result, travels: Mapping[str, ndarray]
    ) -> "StepError":
        """The error that ends a run, with the result so far.

        ``travels`` are the prescribed displacements in mm, see `travels`.
        """
        elements = getattr(error, "elements", np.empty(0, dtype=int))
        advice, state = getattr(error, "advice", ""), result.states[-1]
        lengths = {name: float(np.linalg.norm(u)) for name, u in travels.items()}
        name = max(lengths, key=lengths.__getitem__, default="")
        far = f"{name} moved by {lengths[name]:.4g} mm" if lengths.get(name) else ""
        far = result.not_on_tool or far
        where = f" ({far})" if far else ""
        first = ", ".join(map(str, elements[:_ELEMENTS]))
        more = ", ..." if elements.size > _ELEMENTS else ""
        return cls(
            f"stopped at load factor {state.load_factor:.6g}{where}: {error}"
            + (f" (element {first}{more})" if elements.size else "")
            + (f"; try {advice}" if advice else ""),
            result,
            elements,
            getattr(error, "quantity", ""),
        )


def components_mm(name: str, point: ndarray) -> dict[str, float]:
    """Components of a position in mm by key, such as ``NAME_x_mm``."""
    axes = zip("xyz", point.tolist(), strict=False)
    return {f"{name}_{axis}_mm": x for axis, x in axes}


def _energies(state: State) -> dict[str, float]:
    """Internal energy and energy lost, in total and by term; potentials of loads."""
    names = dict.fromkeys((*_TERMS, *state.energies))
    by_term = {f"{term}_energy": state.energies.get(term, 0.0) for term in names}
    loads = {f"{load}_potential": value for load, value in state.potentials.items()}
    lost = {f"{term}_energy_lost": x for term, x in state.energy_lost.items()}
    if lost:
        lost = {"energy_lost": sum(lost.values())} | lost
    return {"energy": sum(state.energies.values())} | by_term | lost | loads


def _columns(shares: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Shares of stabilisation and deviations, by column name."""
    return {
        f"{quantity}_share_of_{part}": share
        for quantity, by_part in shares.items()
        for part, share in by_part.items()
    }
