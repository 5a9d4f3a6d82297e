"""Interval of the discretisation error of a state.

Elements that represent a jump of the shear angle poorly make a ply too stiff.  The
numerical stiffness, of stabilisation and deviations, takes the place of the stiffness
of fibres and makes it too soft.  If the numerical stiffness is multiplied by k, let
these two errors of a result W be a kᵖ and b k⁻ᑫ.  A calibrated stiffness balances them,
a ≈ b; their difference is the error, and dW/d(ln k) = p a + q b is of the size of each
for exponents between ½ and 1.  The half-width of the interval is dW/d(ln k) times the
``log_range`` of the formulation.

Beside a pole, of the shear law or of the load where fibres align with it, the tension
varies within elements more than they represent: see `tension_variation`.  The
half-width is then twice the change by the omitted forces, if that is larger.

Elements that contain a jump of the shear angle have an error of the shear angle of the
size of its differences δ between neighbours.  For a proportional law the numerical
stiffness is calibrated to it.  The further change of the work of another law is of the
size of ``∫ |M′Γ − M| δ dΩ``: see `_work_of_jumps`.

Elements that resolve the layers of singular fibres contain no jump, and have the
stiffness of the fibres along them.  They miss a part of the work of the layer: see
`_work_of_layers`.

Between tools and on surfaces the error of contact between nodes adds its change: see
`between_nodes`.

The forces that remain out of balance, mainly by the rounding of stiff fibres, add their
work.

The derivative needs no second equilibrium: the numerical stiffness is linear in k, so
that its nodal forces are the derivative of the residual.  A formulation without
numerical stiffness is compared with one of the same unknowns that has it.  So is one
point on triangles, which locks, with macro-elements.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy import ndarray

from ..fabric import is_zero
from ..mesh.bases import element_numbers
from ..mesh.selection import SINGULAR
from ..mesh.user_input import error_text, real_numbers, shortened
from ..ply import Ply
from ..ply.formulations import (
    OF_DEVIATION_BELOW_ONE_POINT,
    OF_MACRO,
    Macro,
)
from ..ply.parameters import Values
from ..ply.terms import FormTerm, Formulation, TensionTerm, Term
from .between_nodes import STEP, changes_of_tools, pushed_out, response, work_of_tools
from .conditioning import buckling_warning, uncertain_reactions
from .conditions import Conditions, Constraints, turned
from .linear import solver_named
from .linear.solver import Clock
from .problem import Problem, Tangent
from .search import equilibrium_near
from .states import NoEquilibriumError, State
from .tension_variation import forces_of_tension_variation, smooth_edges
from .verdict import CHECKS

#: Ratio of the rms error of the shear angle to the rms change of the shear angle that
#: belongs to the interval of the load: `python -m studies interval --case "chosen: *"`.
SHEAR_ANGLE_OVER_CHANGE = 2.2

# Half-width of the load relative to it, beyond which the change is not of first order,
# and numerical share of the energy, beyond which there is no interval.
_MOST, _MOST_NUMERICAL = 1.0, 0.5

# Ratio of work to energy, for a ply on a surface, above which the work is attributed to
# a load.  Measured: supported nodes that follow a triangulated tool do work of up to
# 0.2 % of the energy; an edge tension does several times the energy.
_OF_A_LOAD = 0.01

# Residual of a state, relative to its tolerance, above which it belongs to another ply:
# computed again, it differs by round-off, which is part of the tolerance.
_UNBALANCED = 10.0

# Roles whose stiffness is numerical.
_NUMERICAL = "stabilisation", "deviation"

# Change by the forces of `forces_of_tension_variation`, and its factor.  It estimates
# the error beside a pole: of the shear law, or of the load where fibres align with it.
# The recovered tension has an error of the size of its variation.
_VARIATION, _OF_VARIATION = "variation", 2.0

# Change by contact between the nodes of tools and surfaces, and its factor:
# `python -m studies forming --case "chosen, *"`.
_CONTACT, _OF_CONTACT = "contact", 2.0

# Part of the half-width of the work over the result of `_work_of_jumps`:
# `python -m studies interval --case "chosen: free meshes near *"`.
_OF_JUMPS = 2.0

# Part of the half-width of the work over the result of `_work_of_layers`: `python -m
# studies singular_fibres --case "chosen *"`.
_OF_LAYERS = 0.3

# One point locks: the converged load is below its load where deviations matter, and
# above it where the stabilisation does.  The errors have opposite signs.
_BELOW_ONE_POINT: "_Groups" = [
    {"stabilisation": OF_MACRO},
    {"deviation": OF_DEVIATION_BELOW_ONE_POINT},
]

# Least ``log_range`` if only one of the two errors remains: fibres bend, or run along
# free sides, instead of jumps of the shear angle within elements.  The error is up to
# 2.1 times the change: `python -m studies simple_shear`.
_OF_ONE_ERROR = 2.4

# Angle in radians between a side and fibres below which they run along it.
_ALONG_SIDE = 1e-3

# Reasons why a ply has no interval of the load.
_NO_LOAD = "no moving condition carries a load"
_IN_SPACE = (
    "intervals are measured for plies in the plane, on surfaces and between tools "
    "only; compare with a finer mesh"
)
_NUMERICAL_LOAD = (
    "most of the resistance is numerical: refine the mesh, or use one that follows the "
    "singular fibres"
)

_BUCKLED = "fibres buckle or bend within elements"

_TOO_WIDE = "its half-width is not small relative to the load: refine the mesh"

# Changes from which an interval follows, in the plane and with tools or surfaces.
_BY_STIFFNESS = "by the numerical stiffness"
_BY_CONTACT = f"{_BY_STIFFNESS} and the contact between nodes"

_OWN_TERM = (
    "the discretisation error of the term {} is not known; compare with a finer mesh"
)

_FRICTION = "intervals are measured without friction only; compare with a finer mesh"

_LET_GO = "clamps have let go; compare with a finer mesh"

#: Reason why a stack and its plies have no interval.
OF_STACK = "intervals are not measured for stacks; compare with a finer mesh"

_RELEASED = "conditions have ended; compare with a finer mesh"

#: A quantity of the user: a number from a ply and its displacement.
Quantity = Callable[[Ply, ndarray], float]


@dataclass(frozen=True, eq=False)
class ErrorInterval:
    """Interval of the discretisation error of a state, or the reason why there is none.

    The interval is the computed value plus and minus a half-width.  It is measured, not
    proved: `python -m studies interval` counts how often it contains the converged
    value.

    Attributes
    ----------
    load
        Half-width of the load relative to it: of the work of the forces of moving
        conditions along their motion, and of loads.  None if not available.
    shear_angle
        Estimated root mean square error of the shear angle over the ply, in radians;
        None if not available.
    reactions
        Half-width of the reaction of each condition in N, shape (d,).
    reason
        Reason why the interval, or its load, is not available; else empty.
    warnings
        Reactions that the mesh determines poorly, one line each.
    method
        Changes from which the interval follows.
    """

    load: float | None = None
    shear_angle: float | None = None
    reactions: dict[str, ndarray] = field(default_factory=dict)
    reason: str = ""
    warnings: list[str] = field(default_factory=list)
    _half_width: Callable[[Quantity], tuple[float, float]] | None = field(
        default=None, repr=False
    )
    method: str = _BY_STIFFNESS

    def half_widths(self, name: str, d: int) -> list[float | None]:
        """Half-widths of the reaction of a condition in N; d times None if unknown."""
        known = self.reactions.get(name)
        return [None] * d if known is None else known.tolist()

    def of_largest_angle(self, ply: Ply, u: ndarray) -> float | None:
        """Half-width of `Ply.largest_shear_angle` in radians; None without an interval.

        It is increased by the difference between the recovered and the computed angle
        around the peak (Zienkiewicz & Zhu 1992).
        """
        try:
            low, high = self.of(Ply.largest_shear_angle)
        except ValueError:
            return None
        angle, t = ply.shear_angle(u, ply.centre)[:, 0], ply.mesh.t
        near = np.isin(t, t[:, np.abs(angle).argmax()]).any(axis=0)
        off = (ply.recovery @ angle)[t].mean(axis=0) - angle
        return (high - low) / 2 + float(np.sqrt(np.mean(off[near] ** 2)))

    def of(self, quantity: Quantity) -> tuple[float, float]:
        """Lower and upper end of the interval of a quantity.

        Parameters
        ----------
        quantity
            Function of the ply and a displacement, such as ``lambda ply, u:
            float(ply.shear_angle(u).max())``.

        Raises
        ------
        ValueError
            If there is no interval, or the quantity is not a finite number.

        Examples
        --------
        >>> from skfem_textile import Fabric, LoadStepper, Ply
        >>> from skfem_textile.scenes import bias_extension
        >>> scene = bias_extension(size=(4, 8))
        >>> ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
        >>> result = LoadStepper(ply, scene.conditions, steps=2).run()
        >>> low, high = result.error.of(lambda ply, u: float(u @ u))
        >>> low < float(result.u @ result.u) < high
        True
        """
        if self._half_width is None:
            raise ValueError(f"there is no interval: {self.reason}")

        def number(ply: Ply, u: ndarray) -> float:
            value = real_numbers("the quantity", quantity(ply, u))
            if value.shape or not np.isfinite(value):
                given = shortened(value)
                raise ValueError(f"the quantity must be a finite number, got {given}")
            return float(value)

        value, half_width = self._half_width(number)
        return value - half_width, value + half_width


def error_interval(
    problem: Problem, conditions: Conditions, solver: str, state: State
) -> ErrorInterval:
    """Interval of the error of a state of a problem, with a linear solver by name.

    Raises
    ------
    ValueError
        If the state is not one of the ply.
    """
    if not _is_state_of(problem, state):
        raise ValueError(
            "the interval is known for states of the same run only: use one of "
            "result.states"
        )
    if state.load_factor == 0:
        return ErrorInterval(reason="the ply is not loaded yet")
    if hasattr(problem.ply, "plies"):
        return ErrorInterval(reason=OF_STACK)
    if not state.verdict.stable:
        return ErrorInterval(reason="the equilibrium is not stable")
    if not problem.constraints.free.size:
        return ErrorInterval(reason="no node is free: refine the mesh")
    if problem.has_friction:
        return ErrorInterval(reason=_FRICTION)
    if any(p.get("released_at", np.inf) < np.inf for p in state.parameters.values()):
        return ErrorInterval(reason=_LET_GO)
    if problem.endings and _has_ended(problem, state):
        return ErrorInterval(reason=_RELEASED)
    if own := [x.name for x in problem.ply.terms if _has_own_forms(x)]:
        return ErrorInterval(reason=_OWN_TERM.format(", ".join(own)))
    try:
        with np.errstate(all="ignore"):  # non-finite values are detected
            of_state = problem.at(state.load_factor)
            of_state.clock = Clock()  # the run's clock goes on
            return _interval(of_state, conditions, solver, state)
    except NoEquilibriumError as error:
        reason = f"a formulation with numerical stiffness has no state nearby: {error}"
    except MemoryError:
        reason = "there is not enough memory"
    except Exception as error:  # from a user's term; computed states are kept
        reason = error_text(error)
    return ErrorInterval(reason=reason)


def _has_ended(problem: Problem, state: State) -> bool:
    """True if conditions have ended before a state, also at its load factor."""
    at, first = problem.at(t := state.load_factor), min(problem.endings)
    fixed = at.is_fixed(state.u, at.constraints.fixed_values(t))
    return t > first or (t == first and not fixed)


def _has_own_forms(term: Term) -> bool:
    """True for an elastic energy given by user-defined forms."""
    if not isinstance(term, FormTerm) or term.role != "internal":
        return False
    return not hasattr(term.forms, "built_by")


def _is_state_of(problem: Problem, state: State) -> bool:
    """True if a state is an equilibrium of a problem."""
    if not isinstance(state, State):
        return False
    ply, p = problem.ply, state.parameters
    here = {name: _shapes(values) for name, values in ply.parameters_at_rest.items()}
    shapes = {name: _shapes(values) for name, values in p.items()}
    if state.u.shape != (ply.basis.N,) or shapes != here:
        return False
    at = problem.at(state.load_factor)
    with np.errstate(all="ignore"):  # non-finite values are detected
        try:
            f = ply.residual(state.u, state.load_factor, p)
            unbalanced = at.unbalanced(f, state.u)
        except NoEquilibriumError:
            return False
    return unbalanced <= _UNBALANCED * max(0.0, state.tolerance, *state.residuals[-1:])


def _shapes(values: Values) -> dict[str, tuple[int, ...]]:
    return {name: np.shape(value) for name, value in values.items()}


def work_of(problem: Problem, state: State) -> float:
    """Work of reactions and loads at a state in N·mm; 0 if nothing carries a load."""
    u, p, rate = state.u, state.parameters, _rate(problem)
    work = _work(problem, problem.residual(u, p), u, p, rate)
    work = np.append(work, work_of_tools(problem, u, p))
    least = state.tolerance * _length(u, rate)
    if problem.surfaces:
        least = max(least, _OF_A_LOAD * abs(sum(state.energies.values())))
    return float(work.sum()) if np.abs(work).sum() > least else 0.0


def _length(u: ndarray, rate: ndarray) -> float:
    """Work in N·mm of unbalanced forces of 1 N at all unknowns, of random signs."""
    return float(np.linalg.norm(u) + np.linalg.norm(rate))


def _work(
    problem: Problem, f: ndarray, u: ndarray, parameters: Any, rate: ndarray
) -> ndarray:
    """Work of the reactions through their prescribed motion, and work of the loads.

    Each node of a condition contributes with its own motion, as an edge may rotate;
    ``rate`` is the result of `_rate`.  Loads between tools are constant and do no work.
    """
    constraints = problem.constraints
    moving = turned(f, constraints.turn)[constraints.prescribed]
    load = 0.0 if problem.contacts else problem.load(u, parameters) @ u
    return np.array([moving @ rate, load])


def _rate(problem: Problem) -> ndarray:
    """Load factor times the rate of the fixed unknowns with respect to it, in mm."""
    constraints, t = problem.constraints, problem.load_factor
    values, before = (constraints.fixed_values(x) for x in (t, (1 - STEP) * t))
    return (values - before) / STEP


class _Change(NamedTuple):
    """Derivatives of displacement, work and reactions with respect to ln k."""

    motion: ndarray
    work: float
    reactions: dict[str, ndarray]


#: Ranges of the logarithm of the factor of each change.  Changes of a group add up.
_Groups: TypeAlias = list[dict[str, float]]


@dataclass(frozen=True, eq=False)
class _Changes:
    """Changes of a state with its numerical stiffness, and with omitted forces.

    ``by_role`` has the changes by stabilisation, by deviations and by the variation of
    the tension.  The group with the largest half-width counts.
    """

    ply: Ply
    u: ndarray
    by_role: dict[str, _Change]
    groups: _Groups

    @classmethod
    def of(
        cls, problem: Problem, tangent: Tangent, state: State, groups: _Groups
    ) -> "_Changes":
        """Changes to first order, from the tangent at the state."""
        ply, u, p = problem.ply, state.u, state.parameters
        forces: dict[str, ndarray] = {}
        for part in ply.parts(u, state.load_factor, p):
            if part.role in _NUMERICAL:
                forces[part.role] = forces.get(part.role, 0.0) + part.forces
        if not problem.in_space and any(_VARIATION in group for group in groups):
            forces[_VARIATION] = forces_of_tension_variation(ply, u)
        responses = {k: response(problem, tangent, state, f) for k, f in forces.items()}
        if problem.contacts or problem.surfaces:
            responses[_CONTACT] = pushed_out(problem, tangent, state)
        rate, by_role = _rate(problem), {}
        for role, found in responses.items():
            motion, after, _ = found
            of_tools, reactions = changes_of_tools(problem, state, found)
            work = float(_work(problem, after, motion, p, rate).sum()) + of_tools
            reactions |= problem.reactions(after, u)
            by_role[role] = _Change(motion, work, reactions)
        return cls(ply, u, by_role, groups)

    def largest(self, of: Callable[[_Change], Any]) -> Any:
        """Half-width of a quantity, from its derivative for each change."""
        sums = [
            sum(
                factor * np.abs(of(self.by_role[role]))
                for role, factor in group.items()
                if role in self.by_role
            )
            for group in self.groups
        ]
        return np.maximum(*sums)

    @property
    def work(self) -> float:
        """Half-width of the work in N·mm."""
        return float(self.largest(lambda change: change.work))

    @property
    def reactions(self) -> dict[str, ndarray]:
        """Half-widths of the reactions in N."""
        names = next(iter(self.by_role.values())).reactions if self.by_role else {}

        def half_width(name: str) -> ndarray:
            return np.asarray(self.largest(lambda change: change.reactions[name]))

        return {name: half_width(name) for name in names}

    def half_width(self, quantity: Quantity) -> tuple[float, float]:
        """Value of a quantity, and half the width of its interval."""
        half = self.largest(lambda change: self._slope(quantity, change.motion))
        return float(quantity(self.ply, self.u)), float(half)

    @property
    def shear_angle(self) -> float:
        """Estimated root mean square error of the shear angle in radians."""
        ply, motion = self.ply, np.zeros_like(self.u)
        for role, change in self.by_role.items():
            if role in _NUMERICAL:
                motion += ply.formulation.log_range(ply.mesh) * change.motion
        change = self._slope(Ply.shear_angle, motion)
        return SHEAR_ANGLE_OVER_CHANGE * _rms(ply, change)

    def _slope(self, quantity: Callable[[Ply, ndarray], Any], motion: ndarray) -> Any:
        """Derivative of a quantity along a motion."""
        ends = (quantity(self.ply, self.u + h * motion) for h in (-STEP, STEP))
        before, after = ends
        return (after - before) / (2 * STEP)


def _interval(
    problem: Problem, conditions: Conditions, solver: str, state: State
) -> ErrorInterval:
    """The interval; of the shear angle alone if nothing carries a load."""
    ply, work = problem.ply, work_of(problem, state)
    reference = ply.formulation.reference(ply.mesh)
    other, there = problem, state
    if reference != ply.formulation:
        other, there = _other(ply, reference, conditions, solver, state)
    if warning := buckling_warning(other.ply, there):
        return ErrorInterval(reason=_BUCKLED, warnings=[warning])
    tangent = Tangent.at(other, there.u, there.parameters)
    one_error = not problem.in_space and _has_one_error(problem)
    groups = _groups(ply.formulation, other.ply, one_error)
    changes = _Changes.of(other, tangent, there, groups)
    load = abs(work - work_of(other, there)) + changes.work
    load += max(state.residuals[-1:], default=0.0) * _length(state.u, _rate(problem))
    reactions = {
        name: np.abs(state.reactions[name] - there.reactions[name]) + half
        for name, half in changes.reactions.items()
    }
    off = ply.shear_angle(state.u) - ply.shear_angle(there.u)
    angle = max(_rms(ply, off) + changes.shear_angle, _rms_jump(ply, state.u))
    half_width = partial(_half_width, ply, state.u, changes)
    if not np.isfinite([load, angle]).all():
        return ErrorInterval(reason="its half-width is not finite")
    in_contact = problem.contacts or problem.surfaces
    if problem.in_space and not in_contact:
        return ErrorInterval(None, angle, reason=_IN_SPACE if work else _NO_LOAD)
    method = _BY_CONTACT if in_contact else _BY_STIFFNESS
    if not work:
        return ErrorInterval(
            *(None, angle, reactions, _NO_LOAD, [], partial(half_width, 1.0)),
            method=method,
        )
    wider = 1.0
    if load and not problem.in_space:
        if SINGULAR in (ply.mesh.boundaries or {}):
            more = _OF_LAYERS * _work_of_layers(other.ply, there, work)
        else:
            more = _OF_JUMPS * _work_of_jumps(ply, state.u)
        wider = 1.0 + more / load
        load, reactions = wider * load, {k: wider * x for k, x in reactions.items()}
    numerical = sum(state.shares.get("energy", {}).values())
    if not load <= _MOST * abs(work) or numerical > _MOST_NUMERICAL:
        if in_contact:
            return ErrorInterval(None, angle, reason=_TOO_WIDE, method=method)
        return ErrorInterval(reason=_NUMERICAL_LOAD)
    uncertain = []
    if not problem.in_space:
        uncertain = list(uncertain_reactions(other, tangent, there, _rate(other), load))
    for name, half, _ in uncertain:
        reactions[name] = np.maximum(reactions.get(name, 0.0), half)
    warnings = [x.warning for x in uncertain]
    of_quantity = partial(half_width, wider)
    of_load = load / abs(work), angle, reactions
    return ErrorInterval(*of_load, "", warnings, of_quantity, method)


def _half_width(
    ply: Ply, u: ndarray, changes: _Changes, factor: float, quantity: Quantity
) -> tuple[float, float]:
    """Value of a quantity at u, and half the width of its interval."""
    value = float(quantity(ply, u))
    theirs, half = changes.half_width(quantity)
    return value, factor * (abs(value - theirs) + half)


def _has_one_error(problem: Problem) -> bool:
    """True if fibres bend, or run along free sides, whose traction they carry alone."""
    ply, mesh = problem.ply, problem.ply.mesh
    if ply.fabric.bends or is_zero(ply.fabric.shear_law):
        return bool(ply.fabric.bends)
    sides = mesh.boundary_facets()
    held = np.concatenate([[], *problem.constraints.nodes.values()])
    sides = sides[~np.isin(mesh.facets[:, sides], held).all(axis=0)]
    start, end = mesh.p[:, mesh.facets[:, sides]].swapaxes(0, 1)
    cells = element_numbers(ply.basis)[mesh.f2t[0, sides], :1]
    along = (end - start) / np.hypot(*(end - start))
    A = ply.fabric.directions(0.5 * (start + end)[..., None], cells)
    sines = [np.abs(a[0, :, 0] * along[1] - a[1, :, 0] * along[0]) for a in A]
    return bool((np.array(sines) < _ALONG_SIDE).any())


def _groups(formulation: Formulation, ply: Ply, one_error: bool = False) -> _Groups:
    """Groups of the changes of a ply, with which a formulation is compared."""
    reference = ply.formulation
    log_range = reference.log_range(ply.mesh)
    if one_error:
        log_range = max(log_range, _OF_ONE_ERROR)
    groups = [dict.fromkeys(_NUMERICAL, log_range), {_VARIATION: _OF_VARIATION}]
    if isinstance(reference, Macro) and not isinstance(formulation, Macro):
        groups = _BELOW_ONE_POINT
    return [group | {_CONTACT: _OF_CONTACT} for group in groups]


def _other(
    ply: Ply, reference: Any, conditions: Conditions, solver: str, state: State
) -> tuple[Problem, State]:
    """Problem and state of another formulation near a state."""
    other = Ply(ply.mesh, ply.fabric, reference, ply.user_terms, **ply.placement)
    at, warn = state.load_factor, tuple(CHECKS)
    there = equilibrium_near(
        other, conditions, state.u, at, warn_only=warn, solver=solver
    )
    if not there.verdict.stable or there.verdict.min_det_F <= 0:
        raise NoEquilibriumError("it is not stable, or elements are folded")
    constraints = Constraints(other.basis, conditions)
    return Problem(other, constraints, solver_named(solver)).at(at), there


def _rms(ply: Ply, values: ndarray) -> float:
    """Root mean square over the ply of values at its integration points."""
    return float(np.sqrt(np.average(values**2, weights=ply.basis.dx)))


def _rms_jump(ply: Ply, u: ndarray) -> float:
    """Root mean square of the jumps of the shear angle between elements, in radians."""
    area = ply.basis.dx.sum(axis=1)
    return float(np.sqrt(np.average(_square_jumps(ply, u), weights=area)))


def _square_jumps(ply: Ply, u: ndarray) -> ndarray:
    """Mean square of the jumps of the shear angle at the edges of each element.

    Jumps across singular fibres are part of the solution.  Shape (n_elements,), in
    radians squared.
    """
    mesh: Any = ply.mesh
    inner = smooth_edges(mesh)
    angle = np.average(ply.shear_angle(u), axis=1, weights=ply.basis.dx)
    pairs = mesh.f2t[:, inner]
    square = np.tile(np.subtract(*angle[pairs]) ** 2, 2)
    return np.bincount(pairs.ravel(), square, mesh.nelements) / len(mesh.t2f)


def _work_of_jumps(ply: Ply, u: ndarray) -> float:
    """Work ``∫ |M′Γ − M| δ dΩ`` in N·mm, with the root mean square jumps δ of Γ.

    It is zero for a proportional shear law M, and large beside the pole of a law.
    """
    law = ply.fabric.at(element_numbers(ply.basis)).shear_law
    angle, jump = ply.shear_angle(u), np.sqrt(_square_jumps(ply, u))
    excess = np.abs(law.tangent(angle) * angle - law.value(angle))
    return float(jump @ (excess * ply.basis.dx).sum(axis=1))


def _work_of_layers(ply: Ply, state: State, work: float) -> float:
    """Part of a work that triangles which resolve layers of singular fibres miss.

    A layer of the width w changes the load by a share w/L, of which quadratic triangles
    of the height h at its fibre miss about (h/w)².
    """
    term = next(x for x in ply.terms if isinstance(x, TensionTerm))
    layer = getattr(term.parameters, "layer", np.zeros((2, 1, 1)))
    if not np.isinf(layer).any():
        return 0.0
    mesh, L = ply.mesh, np.sqrt(ply.basis.dx.sum())
    edges = np.asarray(mesh.boundaries[SINGULAR], dtype=int)
    start, end = mesh.p[:, mesh.facets[:, edges]].swapaxes(0, 1)
    sides = mesh.f2t[:, edges]
    length, area = np.hypot(*(end - start)), ply.basis.dx.sum(axis=1)[sides]
    resolved = np.isinf(layer[:, sides, 0]) & (2 * area < length**2)
    if not resolved.any():
        return 0.0
    family, side, edge = np.nonzero(resolved)
    cell, h = sides[side, edge], 2 * area[side, edge] / length[edge]
    E = state.parameters[term.name]["E_d"][family, cell, 0]
    law = ply.fabric.at(element_numbers(ply.basis)[cell, :1]).shear_law
    w = L * np.sqrt(law.tangent(np.zeros((len(cell), 1)))[:, 0] / E)
    return float(np.median(w / L * np.minimum(1.0, (h / w) ** 2))) * abs(work)
