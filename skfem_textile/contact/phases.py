"""Processes in phases: tools move, press and rub in one phase after the other.

n phases have equal shares 1/n of the load factor, so that a phase keeps its load
factors if later ones change.  What a phase does not state keeps its value.
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray

from ..mesh.user_input import real_numbers, refuse_in_files, shortened
from ..ply import Ply
from ..ply.amount import SAME, Limits, Part, Rows, ends_of_parts, refuse_places
from ..solve.continuation import LoadSteps, refuse_steps
from ..solve.result import Result
from .holder import pressing
from .motion import travelled
from .tool import LIMITS, AboutAxis, Holder, Tool


@dataclass(frozen=True)
class OverTravel:
    """Amount in a phase, by rows of the travel of a tool.

    Parameters
    ----------
    tool
        Name of the tool.
    rows
        Travel from its initial position in mm, and value; linear between the rows, and
        constant beyond them.
    """

    tool: str
    rows: Sequence[Sequence[float]]


#: Value at the end of a phase; rows of the share of the phase, from 0 to 1, and value;
#: or rows of a travel.
InPhase: TypeAlias = float | Sequence[Any] | OverTravel


@dataclass(frozen=True)
class Phase:
    """Phase of a `Process`.

    Parameters
    ----------
    name
        Its name.
    steps
        Number of its load steps.
    tools
        By the names of tools what changes: ``motion``, the translation from the initial
        position in mm; ``rotation``, the angle in radians about the axis of the tool,
        see `Process`; ``friction``; and ``gap``, ``pressure`` or ``force`` of a
        `Holder`.  Each is the value at the end of the phase, which is reached linearly
        from the end of the previous phase, while a number for the friction is valid in
        the whole phase; or rows ``(share of the phase, value)``, linear between them;
        or `OverTravel`.
    loads
        Factor of the loads, in the same way; 0 before the first phase.
    """

    name: str
    steps: int
    tools: Mapping[str, Mapping[str, InPhase]] = field(default_factory=dict)
    loads: InPhase | None = None


# Amounts of holders, of which each has one.
_OF_HOLDERS = "gap", "pressure", "force"

# Types of rows, and of a vector.
_ROWS = list, tuple, ndarray

# Of loads.
_ANY = Limits()


class StepsOfProcess(tuple[int, ...]):
    """Numbers of steps of the phases of a process."""

    process: "Process"

    def check_ply(self, ply: Ply) -> None:
        """Refuse a ply whose tools are not the ones of the process."""
        self.process.check_ply(ply)


class Process:
    """Phases in which tools move, press and rub, with the tools.

    Parameters
    ----------
    phases
        The phases in order; each has the same share of the load factor.
    tools
        The tools in their initial positions: without motions, and with the friction and
        the gap, pressure or force of holders before the first phase.
    axes
        Axis of rotation of tools by name, a direction and a point on it in mm; by
        default z through the origin.

    Attributes
    ----------
    phases, names
        The phases, and their names.
    tools
        The tools, whose motions, friction and so on are functions of the load factor.
    steps
        Numbers of steps, for `LoadStepper`, which refuses a ply with other tools.
    loads
        Factor of loads, a function of the load factor; None if no phase states one.

    Raises
    ------
    ValueError
        If a name is given twice or unknown, a tool has another motion besides
        the phases, the rows of a phase run backwards, do not begin at the value at
        which the previous phase ends, or turn back within a step, or a value is not
        valid.

    Examples
    --------
    A holder closes, a punch moves up, and both open:

    >>> from skfem_textile import Holder, Tool, contact, drape
    >>> tools = [
    ...     Tool(drape.Punch(40.0, (0, 0, -41)), name="punch"),
    ...     Tool(drape.Die(45.0, 8.0, (0, 0, 0.15)), name="die"),
    ...     Holder(drape.Plane((0, 0, 0.15)), gap=5.0, side=-1, name="holder"),
    ... ]
    >>> phases = [
    ...     contact.Phase("close", 1, {"holder": {"gap": 0.3}}),
    ...     contact.Phase("punch", 4, {"punch": {"motion": (0, 0, 25)}}),
    ...     contact.Phase(
    ...         "open", 2, {"punch": {"motion": (0, 0, 0)}, "holder": {"gap": 5.0}}
    ...     ),
    ... ]
    >>> process = contact.Process(phases, tools)
    >>> punch, die, holder = process.tools
    >>> punch.motion(0.5), holder.gap(0.5), process.steps
    (array([ 0. ,  0. , 12.5]), 0.3, (1, 4, 2))
    """

    def __init__(
        self,
        phases: Sequence[Phase],
        tools: Sequence[Tool | Holder],
        axes: Mapping[str, tuple[Sequence[float], Any]] | None = None,
    ) -> None:
        self.phases, tools = _listed("phases", phases), _listed("tools", tools)
        names, axes = [tool.name for tool in tools], axes or {}
        _refuse_phases(self.phases, names)
        for name in axes:
            _refuse_unknown_tool("axes", name, names)
        self.names = [phase.name for phase in self.phases]
        self.steps = StepsOfProcess(phase.steps for phase in self.phases)
        self.steps.process = self
        self._ends = ends_of_parts(len(self.phases))
        moving = [self._moving(tool, axes.get(tool.name)) for tool in tools]
        self._travels = {x.name: partial(_travel, tool=x) for x in moving}
        self.tools = tuple(map(self._changing, moving))
        self.loads = self._amount("loads", None, 0.0, [x.loads for x in self.phases])

    def begin(self, name: str) -> float:
        """Load factor at which a phase begins.

        Raises
        ------
        ValueError
            If there is no such phase.
        """
        if name not in self.names:
            raise ValueError(
                f"there is no phase {shortened(name)}: choose from "
                f"{', '.join(self.names)}"
            )
        return self._ends[self.names.index(name)]

    def phase_at(self, t: float) -> str:
        """Name of the phase that contains a load factor or ends there."""
        return self.names[max(bisect_left(self._ends, t) - 1, 0)]

    def time(self, t: float, later: float) -> str:
        """Load factor in words: its phase, or the end of it if ``later`` is beyond."""
        name, after = self.phase_at(t), self.phase_at(later)
        return f"{'the end of ' if after != name else ''}phase {name!r},"

    def at_ends(self, result: Result) -> list[int]:
        """Indices of the states at the ends of phases, and of the last state.

        Raises
        ------
        ValueError
            See `check_ply`.
        """
        self.check_ply(result.ply)
        factors = [state.load_factor for state in result.states]
        last = {t: i for i, t in enumerate(factors)}  # of clamps that let go
        ends = [last[t] for t in self._ends[1:] if t in last]
        return ends if factors[-1] in self._ends else [*ends, len(factors) - 1]

    def check_ply(self, ply: Ply) -> None:
        """Refuse a ply whose tools are not the ones of the process.

        Raises
        ------
        ValueError
            If a tool is missing, or does not move and press as in the process.
        """
        terms = {x.name: [y.stated for y in x.amounts] for x in pressing(ply)}
        for tool in self.tools:
            own = [getattr(tool, name, None) for name in LIMITS]
            stated = [x for x in own if x is not None]
            if not _same(terms.get(tool.name, []), stated, self._ends):
                raise ValueError(
                    f"the tool {tool.name!r} of the ply is not the one of the process: "
                    "build the ply with the tools of the process, "
                    "Ply(..., terms=process.tools)"
                )

    def _moving(self, tool: Any, axis: Any) -> Any:
        """A tool with the motion that the phases state."""
        stated = [phase.tools.get(tool.name, {}) for phase in self.phases]
        motion, rotation = (
            self._amount(quantity, tool.name, start, [x.get(quantity) for x in stated])
            for quantity, start in (("motion", np.zeros(3)), ("rotation", 0.0))
        )
        if motion is None and rotation is None:
            return tool
        if callable(tool.motion) or (tool.motion is not None and np.any(tool.motion)):
            raise ValueError(
                f"tool {tool.name!r} has a motion besides the motions of phases, which "
                "would put it in two places: omit one of them"
            )
        if rotation is None:
            return replace(tool, motion=motion)
        axis = _axis(tool.name, axis or ((0.0, 0.0, 1.0), np.zeros(3)))
        motion = motion or Rows.reaching(np.zeros(3))
        return replace(tool, motion=AboutAxis(motion, rotation, *axis))

    def _changing(self, tool: Any) -> Any:
        """A tool with the friction, and gap, pressure or force, of the phases."""
        changed = {}
        for quantity in ("friction", *_OF_HOLDERS):
            stated = [x.tools.get(tool.name, {}).get(quantity) for x in self.phases]
            first = next((i for i, x in enumerate(stated) if x is not None), None)
            if first is None:
                continue
            start = getattr(tool, quantity, None)
            where = f"phase {self.names[first]!r}: tool {tool.name!r}"
            if start is None:
                own = [x for x in _OF_HOLDERS if getattr(tool, x, None) is not None]
                raise ValueError(
                    f"{where} is a holder with a {own[0]}, not a {quantity}: state its "
                    f"{own[0]}, or replace it by a holder with a {quantity}"
                    if own
                    else f"{where} has no {quantity}: a holder states its {quantity} "
                    "before the first phase"
                )
            if callable(start):
                raise ValueError(
                    f"{where} has a {quantity} that is a function of the load factor, "
                    f"and another in phases: state its {quantity} at the start"
                )
            changed[quantity] = self._amount(quantity, tool.name, start, stated)
        return replace(tool, **changed)

    def _amount(
        self, name: str, tool: str | None, start: Any, stated: Sequence[InPhase | None]
    ) -> Rows | None:
        """Amount by its values in each phase; None if no phase states it.

        ``tool`` is None for loads, and ``start`` the value before the first phase.
        """
        if all(value is None for value in stated):
            return None
        before, left, limits = np.ravel(start), "before it is", LIMITS.get(name, _ANY)
        of, parts = name if tool is None else f"{name} of {tool!r}", list[Part]()
        bounds = pairwise(self._ends)
        for phase, between, value in zip(self.phases, bounds, stated, strict=True):
            what = f"phase {phase.name!r}: {of}"
            given = before if value is None else value
            part = self._part(name, what, given, before, between)
            begins, ends = (np.ravel(part(t)) for t in between)
            jumps = name == "friction"
            if not (jumps or np.allclose(begins, before, SAME, SAME)):
                raise ValueError(
                    f"{what} begins with {_text(begins, limits)}, but {left} "
                    f"{_text(before, limits)}"
                )
            before, left = ends, f"phase {phase.name!r} leaves it at"
            parts.append(part)
        amount = Rows(tuple(parts))
        amount.check_steps(LoadSteps(self.steps).ends()[1:])
        return amount

    def _part(
        self,
        name: str,
        what: str,
        value: Any,
        before: ndarray,
        between: tuple[float, float],
    ) -> Part:
        """Rows of an amount in one phase."""
        limits = LIMITS.get(name, _ANY)
        if isinstance(value, OverTravel):
            if name in ("motion", "rotation"):
                raise ValueError(
                    f"{what} does not follow the travel of a tool: state its value at "
                    "the end of the phase, or rows of the share of the phase"
                )
            if value.tool not in [*self._travels]:
                raise ValueError(
                    f"{what}: there is no tool {shortened(value.tool)} whose travel is "
                    f"known: choose from {', '.join(self._travels)}"
                )
            rows = _array(what, value.rows, limits)
            at = rows[:, 0]
            refuse_places(f"{what}: the travels", at, "from 0 mm", bool(at[0] >= 0))
            along = self._travels[value.tool]
            if not any(map(along, LoadSteps(self.steps).ends())):
                raise ValueError(
                    f"{what} follows the travel of {value.tool!r}, which does not "
                    "move: name a tool that moves, or state rows of the share of the "
                    "phase"
                )
            return Part(what, between, rows, along, "travel {:g} mm")
        value = value.tolist() if isinstance(value, ndarray) else value  # or a number
        if isinstance(value, _ROWS) and len(value) and isinstance(value[0], _ROWS):
            rows = _array(what, value, limits)
            at = rows[:, 0]
            valid = bool(at[0] >= 0 and at[-1] == 1)
            refuse_places(f"{what}: the shares", at, "to 1", valid)
            start = [[0.0, *before]] if at[0] > 0 else np.empty((0, rows.shape[1]))
            return Part(what, between, np.vstack([start, rows]))
        given = np.ravel(np.asarray(value, dtype=object)).tolist()
        if len(given) != limits.components:
            raise _wrong(what, value, limits)
        end = _array(what, [[0.0, *given]], limits)[0, 1:]
        begin = end if name == "friction" else before
        return Part(what, between, np.array([[0.0, *begin], [1.0, *end]]))


def _same(some: Sequence[Any], others: Sequence[Any], at: Sequence[float]) -> bool:
    """True if amounts have the same values at load factors, within round-off."""

    def values(amounts: Sequence[Any]) -> ndarray:
        found = [x(t) if callable(x) else x for x in amounts for t in at]
        parts = [y for x in found for y in (x if isinstance(x, tuple) else [x])]
        return np.hstack([[], *map(np.ravel, parts)])

    one, other = values(some), values(others)
    return one.shape == other.shape and np.allclose(one, other, SAME, SAME)


def _listed(what: str, given: Any) -> tuple[Any, ...]:
    """A user's list as a tuple."""
    if not isinstance(given, Iterable):
        raise ValueError(f"{what} must be a list of {what}, got {shortened(given)}")
    return tuple(given)


def _refuse_phases(phases: Sequence[Phase], tools: Sequence[str]) -> None:
    """Refuse phases without names or steps, and unknown tools or quantities."""
    if not phases:
        raise ValueError("a process has at least one phase")
    names = [getattr(phase, "name", None) for phase in phases]
    for phase in phases:
        if not isinstance(phase, Phase):
            raise ValueError(f"a phase must be a Phase, got {shortened(phase)}")
        if not (isinstance(phase.name, str) and phase.name):
            raise ValueError(
                f"the name of a phase must be text, got {shortened(phase.name)}"
            )
        if names.count(phase.name) > 1:
            raise ValueError(f"two phases have the name {phase.name!r}: rename one")
        what = f"phase {phase.name!r}"
        refuse_in_files(what, phase.name)
        refuse_steps(f"{what}: steps", phase.steps)
        _refuse_unknown(what, phase.tools, tools)


def _refuse_unknown(what: str, stated: Any, tools: Sequence[str]) -> None:
    """Refuse changes of unknown tools, or of quantities that tools do not have."""
    if not isinstance(stated, Mapping):
        raise ValueError(
            f"{what}: tools must be a dictionary by names of tools, got "
            f"{shortened(stated)}"
        )
    known = LIMITS.keys()
    for tool, changes in stated.items():
        _refuse_unknown_tool(what, tool, tools)
        if not isinstance(changes, Mapping):
            raise ValueError(
                f"{what}: changes of {tool!r} must be a dictionary with some of "
                f"{', '.join(known)}, got {shortened(changes)}"
            )
        for quantity in changes:
            if quantity not in known:
                raise ValueError(
                    f"{what}: tool {tool!r} has no {shortened(quantity)}: choose "
                    f"from {', '.join(known)}"
                )


def _refuse_unknown_tool(what: str, tool: Any, tools: Sequence[str]) -> None:
    if tool not in tools:
        raise ValueError(
            f"{what}: there is no tool {shortened(tool)}: choose from "
            f"{', '.join(tools)}"
        )


def _axis(name: str, axis: Any) -> tuple[ndarray, ndarray]:
    """Validated direction of an axis, and point on it."""
    what = f"axis of {name!r}"
    try:
        direction, point = (real_numbers(what, x) for x in axis)
        valid = (
            direction.shape == point.shape == (3,)
            and np.isfinite([direction, point]).all()
            and direction.any()
        )
    except (TypeError, ValueError):
        valid = False
    if not valid:
        raise ValueError(
            f"{what} must be a direction, not zero, and a point on it, each three "
            f"numbers, got {shortened(axis)}"
        )
    return direction, point


def _wrong(what: str, value: Any, of: Limits) -> ValueError:
    """Error of a value that has another shape."""
    numbers = "a number" if of.components == 1 else f"{of.components} numbers"
    return ValueError(
        f"{what} must be {numbers}, or rows of a share and {numbers}, got "
        f"{shortened(value)}"
    )


def _array(what: str, rows: Any, of: Limits) -> ndarray:
    """Validated rows, shape (n, 1 + components)."""
    try:
        entries = [
            np.hstack([np.asarray(x, dtype=object) for x in row]) for row in rows
        ]
    except (TypeError, ValueError):
        entries = []
    known = {1 + of.components} == {x.size for x in entries}
    if not known or any(
        isinstance(x, bool) or not isinstance(x, Real) for row in entries for x in row
    ):
        raise _wrong(what, rows, of)
    array = np.array(entries, dtype=float)
    if not np.isfinite(array).all():
        raise ValueError(f"{what} must be finite, got {shortened(rows)}")
    values = array[:, 1:]
    if (wrong := values[(values < of.least) | (values > of.most)]).size:
        raise ValueError(f"{what} must be {of.kind}, got {wrong[0]:g}{of.unit}")
    return array


def _text(values: ndarray, of: Limits) -> str:
    text = ", ".join(f"{x:g}" for x in values)
    return f"({text}){of.unit}" if values.size > 1 else f"{text}{of.unit}"


def _travel(t: float, tool: Any) -> float:
    """Distance from the initial position in mm, see `contact.travel`."""
    return float(np.linalg.norm(travelled(f"tool {tool.name!r}", tool.motion, t)))
