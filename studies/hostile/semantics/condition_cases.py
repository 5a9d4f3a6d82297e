"""Conditions that must be refused, and odd ones that must not."""

from collections.abc import Callable
from typing import Any

import numpy as np

from skfem_textile import Condition

from .specimen import INF, NAN, Case, Moves, Specimen, fails, held_bottom, lifted

_UP = (0.0, 1.0)


def _where(where: Any) -> Case:
    return Case(lambda b: b.with_clamp(where, 0.1, _UP), "'c'")


def _direction(direction: Any) -> Case:
    return Case(lambda b: b.with_clamp("top", 0.1, direction), "'c'")


def _value(value: Any) -> Case:
    return Case(lambda b: b.with_clamp("top", value, _UP), "'c'")


def _vector(value: Any) -> Case:
    return Case(lambda b: b.with_clamp("top", value), "'c'")


def _both(c: Condition, d: Condition) -> Case:
    return Case(lambda b: b.run({"clamp": b.clamp, "c": c, "d": d}), "'c' and 'd'")


def _all(conditions: Any) -> Case:
    return Case(lambda b: b.run(conditions), "condition")


def _late(bad: float) -> Callable:
    """A value that is bad at load factor 0.5 only."""
    return lambda X, t: np.where(t == 0.5, bad, 0.1 * t) + 0 * X[0]


class _Odd:
    """An object of a class that no argument takes."""


_REFUSED = {
    **{
        f"on {where!r}": _where(where) for where in ("inside", "", "bottom\n", "Bottom")
    },
    "on None": _where(None),
    "on half a node": _where(3.5),
    "on no number": _where([NAN]),
    "on node -1": _where([0, -1]),
    "on node 99": _where([15, 99]),
    "on node 2^70": _where([2**70]),
    "on nothing": _where([]),
    "on an object": _where(_Odd()),
    "on a set": _where({1, 2}),
    "on names": _where(["top", "left"]),
    "on ragged lists": _where([[1], [2, 3]]),
    "on a short mask": _where([True, False]),
    "on a mask of none": _where(np.zeros(16, dtype=bool)),
    "where nothing is": _where(lambda X: X[0] > 9),
    "where it is a number": _where(lambda X: X[0]),
    "where it is one bool": _where(lambda X: True),
    "where it is of wrong shape": _where(lambda X: X > 1),
    "where it is None": _where(lambda X: None),
    "where it fails": _where(fails),
    "where it takes nothing": _where(lambda: True),
    "along zero": _direction((0, 0)),
    "along NaN": _direction((NAN, 1)),
    "along infinity": _direction((INF, 0)),
    "along three": _direction((1, 2, 3)),
    "along one": _direction(1.0),
    "along a word": _direction("up"),
    "along complex": _direction((1j, 0)),
    "along ragged lists": _direction([[1], [1, 2]]),
    "along an object": _direction(_Odd()),
    "along too many": _direction(np.ones((2, 7))),
    "along what fails": _direction(fails),
    "along what is None": _direction(lambda X: None),
    "along what is zero once": _direction(lambda X: X - X[:, :1]),
    "along what is too much": _direction(lambda X: np.ones((3, 3))),
    "by NaN": _value(NAN),
    "by infinity": _value(-INF),
    "by complex": _value(1 + 2j),
    "by a word": _value("far"),
    "by None": _value(None),
    "by an object": _value(_Odd()),
    "by a dict": _value({}),
    "by ragged lists": _value([[1], [1, 2]]),
    "by too few": _value([0.1, 0.1]),
    "by a vector along a direction": _value(np.ones((2, 4))),
    "by what fails": _value(fails),
    "by what is None": _value(lambda X, t: None),
    "by what is complex": _value(lambda X, t: 1j * X[0]),
    "by what is a word": _value(lambda X, t: "far"),
    "by what is of wrong shape": _value(lambda X, t: X),
    "by what takes one": _value(lambda X: X[0]),
    "by NaN at half": _value(_late(NAN)),
    "by infinity at half": _value(_late(INF)),
    "by one number": _vector(3.0),
    "by three": _vector((1.0, 2.0, 3.0)),
    "by vectors of too few": _vector(np.ones((2, 3))),
    "by vectors turned": _vector(np.ones((4, 2))),
    "by vectors with NaN": _vector((0.1, NAN)),
    "by complex vectors": _vector((0.1, 1j)),
    "by words": _vector(("a", "b")),
    "by what is a row": _vector(lambda X, t: X[0]),
    "two on a node": _both(Condition("top", (0, 0.1)), Condition([15], (0.1, 0))),
    "two along lines": _both(
        Condition("top", 0.1, _UP), Condition("top", 0.2, direction=(0, -2))
    ),
    "two at half alone": _both(
        Condition("top", lambda X, t: t + 0 * X[0], _UP),
        Condition("top", lambda X, t: t**2 + 0 * X[0], _UP),
    ),
    "no conditions": _all({}),
    "conditions None": _all(None),
    "a list of conditions": _all([Condition("bottom")]),
    "a condition": _all(Condition("bottom")),
    "a word": _all("bottom"),
    "a word for a condition": _all({"c\n": "bottom"}),
    "a class for a condition": _all({"c": Condition}),
    "None for a condition": _all({"c": None}),
    "an odd name": _all({"c\n\x1b": Condition("x\ny")}),
}


def _on_top(where: Callable[[Specimen], Any]) -> Case:
    """A condition on the top, which is given in another way than by name."""
    return Case(lambda b: b.with_clamp(where(b), 0.1, _UP), None, lifted(0.1))


def _rising(direction: Any, value: Any = 0.1) -> Case:
    return Case(lambda b: b.with_clamp("top", value, direction), None, lifted(0.1))


def _right(X: Any) -> Any:
    """The right side without its lower end."""
    return (X[0] == 3) & (X[1] > 0)


def _every_node(specimen: Specimen) -> Moves:
    return [
        (np.arange(16), (1, 0), 0.03 * specimen.mesh.p[1]),
        (np.arange(16), (0, 1), 0.0),
    ]


_SOUND = {
    "a name": _on_top(lambda b: "top"),
    "numbers": _on_top(lambda b: b.top[::-1]),
    "numbers twice": _on_top(lambda b: [*b.top, *b.top]),
    "short numbers": _on_top(lambda b: b.top.astype(np.uint8)),
    "a mask": _on_top(lambda b: b.mesh.p[1] == 3),
    "a list of bools": _on_top(lambda b: (b.mesh.p[1] == 3).tolist()),
    "a function": _on_top(lambda b: lambda X: X[1] > 2.9),
    "a long direction": _rising((0, 1e6)),
    "a tiny direction": _rising((0.0, 1e-300)),
    "a list": _rising([0, 2]),
    "downwards": _rising((0, -3), -0.1),
    "a direction each": _rising(lambda X: np.array([0 * X[0], 1 + X[0]])),
    "an integer array": _rising(np.array([0, 1])),
    "a number of numpy": _rising(_UP, np.float64(0.1)),
    "a number each": _rising(_UP, [0.1] * 4),
    "what is one number": _rising(_UP, lambda X, t: 0.1 * t),
    "twice the same": Case(
        lambda b: b.run(
            {
                "clamp": b.clamp,
                "c": Condition("top", 0.1, _UP),
                "d": Condition("top", -0.1, (0, -2)),
            }
        ),
        None,
        lifted(0.1),
    ),
    "all nodes": Case(
        lambda b: b.run(
            {"c": Condition(range(16), lambda X, t: [[0.03 * t], [0]] * X[::-1])}
        ),
        None,
        _every_node,
    ),
    "a whole vector": Case(
        lambda b: b.with_clamp("top", (0.05, 0.1)),
        None,
        lambda b: [*held_bottom(b), (b.top, (1, 0), 0.05), (b.top, (0, 1), 0.1)],
    ),
    "a slope": Case(
        lambda b: b.run(
            {"clamp": b.clamp, "c": Condition(_right, 0.05, direction=(3, 4))}
        ),
        None,
        lambda b: [*held_bottom(b), (np.flatnonzero(_right(b.mesh.p)), (3, 4), 0.05)],
    ),
}

#: Plies that may move as a rigid body, and odd values: a run may stop, or be refused in
#: one line; its result must be in equilibrium.
_LOOSE = {
    "held at a node": Case(lambda b: b.run({"c": Condition([0])}), ""),
    "held along x": Case(
        lambda b: b.run({"c": Condition("bottom", direction=(1, 0))}), ""
    ),
    "a roller alone": Case(
        lambda b: b.run({"c": Condition("top", 0.1, direction=(1, 1))}), ""
    ),
    "held at a node, pulled at one": Case(
        lambda b: b.run({"c": Condition([0]), "d": Condition([15], (0.1, 0.1))}), ""
    ),
    "by 1e308": _value(1e308),
    "by 1e30": _value(1e30),
    "turned inside out": Case(
        lambda b: b.run(
            {"clamp": b.clamp, "c": Condition("top", (0.0, -7.0))}, max_halvings=2
        )
    ),
    "at once at t = 0": _value(lambda X, t: 0.1 + 0 * X[0]),
    "a word of a number": _value("0.1"),
    "true": _value(True),
}
LOOSE = {name: case._replace(names="") for name, case in _LOOSE.items()}

CASES = {**_REFUSED, **_SOUND, **LOOSE}
