"""Processes in phases: tools move, press and rub in one phase after the other.

n phases have equal shares 1/n of the load factor, so that a phase keeps its load
factors if later ones change.  What a phase does not state keeps its value.
"""

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy import ndarray

from ..mesh.user_input import real_numbers, shortened
from ..solve.continuation import ends_of_parts
from ..solve.result import Result
from .tool import MOST_FRICTION, Holder, Tool, rotated_and_moved


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


class _Quantity(NamedTuple):
    """Number of components, unit, limits, and whether it may jump between phases."""

    components: int = 1
    unit: str = ""
    least: float = -np.inf
    most: float = np.inf
    jumps: bool = False


_QUANTITIES = {
    "motion": _Quantity(3, " mm"),
    "rotation": _Quantity(1, " rad"),
    "gap": _Quantity(1, " mm", 0.0),
    "pressure": _Quantity(1, " N/mm2", 0.0),
    "force": _Quantity(1, " N", 0.0),
    "friction": _Quantity(1, "", 0.0, MOST_FRICTION, jumps=True),
    "loads": _Quantity(),
}
_OF_TOOLS, _OF_HOLDERS = (
    ("motion", "rotation", "friction"),
    ("gap", "pressure", "force"),
)

# Types of rows, and of a vector.
_ROWS = list, tuple, ndarray

# Relative difference of two values that is round-off.
_SAME = 1e-9


class InPhases:
    """Amount as a function of the load factor, by rows in each phase.

    Parameters
    ----------
    steps
        Numbers of steps of the phases.
    """

    def __init__(self, steps: tuple[int, ...]) -> None:
        self._steps, self._ends = steps, ends_of_parts(len(steps))
        self._pieces: list[tuple[ndarray, Callable[[float], float] | None]] = []

    def append(self, rows: ndarray, along: Callable[[float], float] | None) -> None:
        """Add the rows of the next phase: its share, or what is ``along``, and values.

        ``along`` is a function of the load factor.
        """
        self._pieces.append((rows, along))

    def __call__(self, t: float) -> Any:
        """Value at a load factor."""
        return self.value(max(bisect_left(self._ends, t) - 1, 0), t)

    def value(self, phase: int, t: float) -> Any:
        """Value at a load factor in a phase, which may differ where two phases meet."""
        rows, along = self._pieces[phase]
        first, last = self._ends[phase : phase + 2]
        x = along(t) if along else (t - first) / (last - first)
        at, *columns = rows.T
        values = [float(np.interp(x, at, column)) for column in columns]
        return np.array(values) if values[1:] else values[0]

    @property
    def load_factors(self) -> list[float]:
        """Load factors at the ends of the phases, and of rows within them."""
        found = {*self._ends}
        for (rows, along), first in zip(self._pieces, self._ends, strict=False):
            if along is None:
                found |= {first + share / len(self._steps) for share in rows[1:-1, 0]}
        return sorted(found)

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """Refuse steps, given by the load factors at their ends, that pass an end."""
        if not {*self._ends[1:]} <= {*load_factors}:
            raise ValueError(
                f"a step must end where a phase ends: use the steps of the process, "
                f"{self._steps}"
            )


@dataclass(frozen=True)
class _Moving:
    """Rotation about an axis through a point, then a translation, in phases."""

    translation: Callable[[float], ndarray]
    rotation: InPhases
    axis: Sequence[float]
    point: ndarray

    def __call__(self, t: float) -> tuple[ndarray, ndarray]:
        """Rotation matrix about the origin, and translation, at a load factor."""
        moved, angle = self.translation(t), self.rotation(t)
        return rotated_and_moved(moved, np.degrees(angle), self.axis, self.point)

    @property
    def load_factors(self) -> list[float]:
        """See `InPhases.load_factors`."""
        both = (
            getattr(x, "load_factors", ()) for x in (self.translation, self.rotation)
        )
        return sorted({t for factors in both for t in factors})

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """See `InPhases.check_steps`."""
        self.rotation.check_steps(load_factors)


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
    phases
        The phases.
    tools
        The tools, whose motions, friction and so on are functions of the load factor.
    steps
        Numbers of steps, for `LoadStepper`.
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
        self.phases = tuple(phases)
        _refuse_phases(self.phases, [tool.name for tool in tools])
        self.names = [phase.name for phase in self.phases]
        self.steps = tuple(phase.steps for phase in self.phases)
        self._ends = ends_of_parts(len(self.phases))
        moving = [self._moving(tool, (axes or {}).get(tool.name)) for tool in tools]
        self._travels = {x.name: partial(_travel, motion=x.motion) for x in moving}
        self.tools = tuple(map(self._changing, moving))
        self.loads = self._amount("loads", 0.0, [x.loads for x in self.phases])

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

    def at_ends(self, result: Result) -> list[int]:
        """Indices of the states at the ends of phases, and of the last state."""
        factors = [state.load_factor for state in result.states]
        ends = [i for i, t in enumerate(factors) if t in self._ends[1:]]
        return ends if factors[-1] in self._ends else [*ends, len(factors) - 1]

    def _moving(self, tool: Any, axis: Any) -> Any:
        """A tool with the motion that the phases state."""
        stated = [phase.tools.get(tool.name, {}) for phase in self.phases]
        what = f"motion of {tool.name!r}"
        motion = self._amount(what, np.zeros(3), [x.get("motion") for x in stated])
        what = f"rotation of {tool.name!r}"
        rotation = self._amount(what, 0.0, [x.get("rotation") for x in stated])
        if motion is None and rotation is None:
            return tool
        if callable(tool.motion) or (tool.motion is not None and np.any(tool.motion)):
            raise ValueError(
                f"tool {tool.name!r} has a motion besides the motions of phases, which "
                "would put it in two places: omit one of them"
            )
        if rotation is None:
            return replace(tool, motion=motion)
        direction, point = axis or ((0.0, 0.0, 1.0), np.zeros(3))
        moved = _Moving(motion or _unmoved, rotation, direction, np.asarray(point))
        return replace(tool, motion=moved)

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
                    f"{own[0]}, or give it a {quantity} instead before the first phase"
                    if own
                    else f"{where} has no {quantity}: a holder states its {quantity} "
                    "before the first phase"
                )
            if callable(start):
                raise ValueError(
                    f"{where} has a {quantity} that is a function of the load factor, "
                    f"and another in phases: state its {quantity} at the start"
                )
            changed[quantity] = self._amount(
                f"{quantity} of {tool.name!r}", start, stated
            )
        return replace(tool, **changed)

    def _amount(
        self, of: str, start: Any, stated: Sequence[InPhase | None]
    ) -> InPhases | None:
        """Amount by its values in each phase; None if no phase states it.

        ``of`` is the quantity and its tool in messages, ``start`` the value before the
        first phase.
        """
        if all(value is None for value in stated):
            return None
        quantity, amount = _QUANTITIES[of.partition(" ")[0]], InPhases(self.steps)
        before, left = np.ravel(start), "before it is"
        for k, (phase, value) in enumerate(zip(self.phases, stated, strict=True)):
            what = f"phase {phase.name!r}: {of}"
            given = before if value is None else value
            amount.append(*self._rows(what, given, before, quantity, phase.steps))
            begins = np.ravel(amount.value(k, self._ends[k]))
            if not (quantity.jumps or np.allclose(begins, before, _SAME, _SAME)):
                raise ValueError(
                    f"{what} begins with {_text(begins, quantity)}, but {left} "
                    f"{_text(before, quantity)}"
                )
            before = np.ravel(amount.value(k, self._ends[k + 1]))
            left = f"phase {phase.name!r} leaves it at"
        return amount

    def _rows(
        self, what: str, value: Any, before: ndarray, of: _Quantity, steps: int
    ) -> tuple[ndarray, Callable[[float], float] | None]:
        """Rows of one phase and what they are along, see `InPhases.append`."""
        if isinstance(value, OverTravel):
            if value.tool not in self._travels:
                raise ValueError(
                    f"{what}: there is no tool {shortened(value.tool)} whose travel is "
                    f"known: choose from {', '.join(self._travels)}"
                )
            rows = _array(what, value.rows, of)
            if (np.diff(rows[:, 0]) <= 0).any() or rows[0, 0] < 0:
                raise ValueError(
                    f"{what}: the travels of the rows must increase from 0 mm, got "
                    f"{_text(rows[:, 0])}"
                )
            return rows, self._travels[value.tool]
        if isinstance(value, _ROWS) and len(value) and isinstance(value[0], _ROWS):
            return _of_shares(what, _array(what, value, of), before, steps), None
        given = np.ravel(np.asarray(value, dtype=object)).tolist()
        if len(given) != of.components:
            raise _wrong(what, value, of)
        end = _array(what, [[0.0, *given]], of)[0, 1:]
        begin = end if of.jumps else before
        return np.array([[0.0, *begin], [1.0, *end]]), None


def phase_table(result: Result, process: Process) -> list[dict[str, Any]]:
    """Figures at the ends of phases, a row each.

    ``phase``, its name; ``share``, the share of it that is completed, 1 except in the
    last state of a run that stopped early; ``load_factor``; of each tool
    ``NAME_travel_mm``, ``NAME_force_N`` and so on, see `tool_history`;
    ``max_shear_angle_deg``; ``max_draw_in_mm``; ``wrinkle_risk_share_of_area``; and
    ``energy_lost`` in N·mm, by friction and by laws, if any is lost.

    Parameters
    ----------
    result
        Result of a run of the process.
    process
        The process.
    """
    from .figures import tool_history
    from .risks import share_of_area, wrinkle_risk
    from .shape import draw_in

    ply, history, rows = result.ply, tool_history(result), []
    columns = {k: x for k, x in history.items() if k.endswith(_TABLED)}
    for i in process.at_ends(result):
        state = result.states[i]
        t, u, name = state.load_factor, state.u, process.phase_at(state.load_factor)
        risk = wrinkle_risk(ply, u, state.parameters)
        share = (t - process.begin(name)) * len(process.phases)
        row: dict[str, Any] = {
            "phase": name,
            "share": round(share, _DIGITS),
            "load_factor": t,
            **{key: column[i].item() for key, column in columns.items()},
            "max_shear_angle_deg": float(np.degrees(np.abs(ply.shear_angle(u)).max())),
            "max_draw_in_mm": float(draw_in(ply, u).inwards.max()),
            "wrinkle_risk_share_of_area": share_of_area(ply, risk),
        }
        if state.energy_lost:
            row["energy_lost"] = sum(state.energy_lost.values())
        rows.append(row)
    return rows


# Ends of the columns of `tool_history` in the table of phases, and digits of a share.
_TABLED = ("_travel_mm", "_rotation_deg", "_force_N", "_distance_mm")
_DIGITS = 9


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
        steps, what = phase.steps, f"phase {phase.name!r}"
        whole = isinstance(steps, int | np.integer) and not isinstance(steps, bool)
        if not (whole and steps >= 1):
            raise ValueError(
                f"{what}: steps must be a whole number of at least 1, got "
                f"{shortened(steps)}"
            )
        _refuse_unknown(what, phase.tools, tools)


def _refuse_unknown(what: str, stated: Any, tools: Sequence[str]) -> None:
    """Refuse changes of unknown tools, or of quantities that tools do not have."""
    if not isinstance(stated, Mapping):
        raise ValueError(
            f"{what}: tools must be a dictionary by names of tools, got "
            f"{shortened(stated)}"
        )
    known = *_OF_TOOLS, *_OF_HOLDERS
    for tool, changes in stated.items():
        if tool not in tools:
            raise ValueError(
                f"{what}: there is no tool {shortened(tool)}: choose from "
                f"{', '.join(tools)}"
            )
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


def _wrong(what: str, value: Any, of: _Quantity) -> ValueError:
    """Error of a value that has another shape."""
    numbers = "a number" if of.components == 1 else f"{of.components} numbers"
    return ValueError(
        f"{what} must be {numbers}, or rows of a share and {numbers}, got "
        f"{shortened(value)}"
    )


def _array(what: str, rows: Any, of: _Quantity) -> ndarray:
    """Validated rows, shape (n, 1 + components)."""
    try:
        array = np.array([np.hstack(row) for row in rows], dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1] != 1 + of.components:
        raise _wrong(what, rows, of)
    if not np.isfinite(array).all():
        raise ValueError(f"{what} must be finite, got {shortened(rows)}")
    if (
        wrong := array[:, 1:][(array[:, 1:] < of.least) | (array[:, 1:] > of.most)]
    ).size:
        size = (
            f"at least {of.least:g}"
            if of.most == np.inf
            else f"from {of.least:g} to {of.most:g}"
        )
        raise ValueError(f"{what} must be {size}{of.unit}, got {wrong[0]:g}{of.unit}")
    return array


def _of_shares(what: str, rows: ndarray, before: ndarray, steps: int) -> ndarray:
    """Rows of shares from 0 to 1; refused if they turn back within a step."""
    shares = rows[:, 0]
    if (np.diff(shares) <= 0).any() or shares[0] < 0 or shares[-1] != 1:
        raise ValueError(
            f"{what}: the shares of the rows must increase to 1, got {_text(shares)}"
        )
    if shares[0] > 0:
        rows = np.vstack([[0.0, *before], rows])
    change = np.diff(rows[:, 1:], axis=0)
    for share in rows[1:-1, 0][(change[:-1] * change[1:] < 0).any(axis=1)]:
        if abs(share * steps - round(share * steps)) > _SAME * steps:
            raise ValueError(
                f"{what} turns back at the share {share:g}, within one of {steps} "
                "steps: choose a number of steps of which one ends there"
            )
    return rows


def _text(values: ndarray, of: _Quantity | None = None) -> str:
    text = ", ".join(f"{x:g}" for x in values)
    return (
        f"({text}){of.unit}"
        if of and values.size > 1
        else f"{text}{of.unit if of else ''}"
    )


def _unmoved(t: float) -> ndarray:
    """Translation of zero."""
    return np.zeros(3)


def _travel(t: float, motion: Any) -> float:
    """Distance from the initial position in mm, see `contact.travel`."""
    first, now = (_translation(s, motion) for s in (0.0, t))
    return float(np.linalg.norm(now - first))


def _translation(t: float, motion: Any) -> ndarray:
    if motion is None:
        return np.zeros(3)
    moved = motion(t) if callable(motion) else t * real_numbers("motion", motion)
    return np.asarray(
        moved[1] if isinstance(moved, tuple | list) and len(moved) == 2 else moved
    )
