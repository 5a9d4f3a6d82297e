"""Laws, fabrics, formulations and settings that must be refused, and odd sound ones."""

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    Macro,
    OnePoint,
    PlainNewton,
    Ply,
    Quadratic,
    split,
)

from .specimen import INF, NAN, Case, Specimen, fails, lifted


class _Law:
    """A linear law whose parts may be replaced."""

    def __init__(self, **parts: Any) -> None:
        for name, part in parts.items():
            setattr(self, name, part)

    def energy(self, x: Any) -> Any:
        return 5.0 * x**2

    def value(self, x: Any) -> Any:
        return 10.0 * x

    def tangent(self, x: Any) -> Any:
        return np.full(np.shape(x), 10.0)


def _not_a_number(x: Any) -> Any:
    return x * NAN


_NAN_LAW = _Law(energy=_not_a_number, value=_not_a_number, tangent=_not_a_number)


def _overwrites(x: Any) -> Any:
    x[...] = 0.0
    return x


_ODD_NUMBERS: dict[str, Any] = {
    "-1": -1.0,
    "NaN": NAN,
    "infinite": INF,
    "None": None,
    "a word": "stiff",
    "a number in a word": "10",
    "complex": 1j,
    "an array": np.ones(3),
    "a list": [],
    "a fraction": Fraction(-1, 2),
    "a decimal": Decimal("NaN"),
    "a class": Linear,
}


def _fabric(names: str | None, **parts: Any) -> Case:
    def act(specimen: Specimen) -> Any:
        Ply(specimen.mesh, Fabric(**({"shear": 1.0} | parts)), specimen.formulation)

    return Case(act, names)


def _law(part: str, value: Any, names: str = "law") -> Case:
    return _fabric(names, tension=_Law(**{part: value}))


_FABRICS = {
    **{f"tension {k}": _fabric("tension", tension=v) for k, v in _ODD_NUMBERS.items()},
    **{f"shear {k}": _fabric("shear", shear=v) for k, v in _ODD_NUMBERS.items()},
    "three tensions": _fabric("tension", tension=(1, 2, 3)),
    "a bad tension of two": _fabric("tension", tension=(1, -2)),
    "no stiffness": _fabric("no stiffness", tension=0.0, shear=0.0),
    "warp zero": _fabric("warp", warp=(0, 0)),
    "warp NaN": _fabric("warp", warp=(NAN, 1)),
    "warp complex": _fabric("warp", warp=(1j, 0)),
    "warp a word": _fabric("warp", warp="right"),
    "warp None": _fabric("warp", warp=None),
    "warp of three": _fabric("warp", warp=(1, 0, 0)),
    "warp ragged": _fabric("warp", warp=[[1], [1, 2]]),
    "warp of ten elements": _fabric("warp", warp=np.ones((2, 10)) * [[1], [0]]),
    "warp turned": _fabric("warp", warp=np.ones((9, 2)) * [1, 0]),
    "weft zero once": _fabric("weft", weft=np.eye(9)[[8, 0]]),
    "weft parallel": _fabric("parallel", weft=(-2, 0)),
    "weft parallel once": _fabric(
        "parallel", weft=lambda x: np.array([x[0], 0 * x[0]])
    ),
    "warp fails": _fabric("warp", warp=fails),
    "warp gives None": _fabric("warp", warp=lambda x: None),
    "warp gives too much": _fabric("warp", warp=lambda x: np.ones((3, 3))),
    "warp takes nothing": _fabric("warp", warp=lambda: (1, 0)),
    "weft gives NaN": _fabric("weft", weft=lambda x: x * NAN),
}

_LAWS = {
    "the energy of another law": _law("energy", lambda x: 7 * x**2),
    "the value of another law": _law("value", lambda x: 11 * x),
    "the tangent of another law": _law("tangent", lambda x: 9 + 0 * x),
    "a tangent of wrong sign": _law("tangent", lambda x: -10 + 0 * x),
    "an energy that fails": _law("energy", fails),
    "a value of one number": _law("value", lambda x: 3.0),
    "a value of None": _law("value", lambda x: None),
    "a complex value": _law("value", lambda x: 10 * x + 0j),
    "a value of bools": _law("value", lambda x: x > 0),
    "a value of wrong shape": _law("value", lambda x: np.ones(4)),
    "a value that spoils": _law("value", _overwrites),
    "a tangent that is no function": _law("tangent", 10.0),
    "a domain of one": _law("domain", (1.0,)),
    "a domain of words": _law("domain", ("low", "high")),
    "a domain turned": _law("domain", (0.1, -0.1)),
    "a domain of NaN": _law("domain", (NAN, NAN)),
    "a domain of one number": _law("domain", 3.0),
    "NaN everywhere": Case(
        lambda b: LoadStepper(
            Ply(b.mesh, Fabric(_NAN_LAW, 1.0), Full()), {"clamp": b.clamp}
        ).run(),
        "law",
    ),
}


def _ply(names: str, *arguments: Callable[[Specimen], Any]) -> Case:
    return Case(lambda b: Ply(*(argument(b) for argument in arguments)), names)


def _formulation(names: str, make: Callable[[], Any]) -> Case:
    return Case(lambda b: Ply(b.mesh, b.fabric, make()), names)


_PLIES = {
    "no mesh": _ply("mesh", lambda b: None, lambda b: b.fabric, lambda b: Full()),
    "a mesh in a word": _ply(
        "mesh", lambda b: "m", lambda b: b.fabric, lambda b: Full()
    ),
    "a number for a fabric": _ply(
        "abric", lambda b: b.mesh, lambda b: 1.0, lambda b: Full()
    ),
    "a class for a fabric": _ply(
        "abric", lambda b: b.mesh, lambda b: Fabric, lambda b: Full()
    ),
    "a formulation in a word": _formulation("ormulation", lambda: "full"),
    "a formulation's class": _formulation("ormulation", lambda: OnePoint),
    "no formulation": _formulation("ormulation", lambda: None),
    "stabilisation Auto": _formulation("stabilisation", lambda: OnePoint("Auto")),
    "stabilisation None": _formulation("stabilisation", lambda: OnePoint(None)),
    "stabilisation complex": _formulation("stabilisation", lambda: OnePoint(1j)),
    "stabilisation in an array": _formulation(
        "stabilisation", lambda: OnePoint(np.ones(2))
    ),
    "kind magic": _formulation("kind", lambda: OnePoint(1.0, "magic")),
    "kind None": _formulation("kind", lambda: OnePoint(1.0, None)),
    "kind in a list": _formulation("kind", lambda: OnePoint(1.0, ["energy"])),
    "auto with rates": _formulation("auto", lambda: OnePoint("auto", "rate")),
    "macro-elements that were refined": _ply(
        "split",
        lambda b: split(b.mesh).refined(),
        lambda b: b.fabric,
        lambda b: Macro(),
    ),
    "one deviation of macro-elements": _formulation(
        "deviation", lambda: Macro(deviation=3.0)
    ),
    "deviations in words": _formulation(
        "deviation", lambda: Macro(deviation=("a", "b"))
    ),
    "ragged deviations": _formulation(
        "deviation", lambda: Macro(deviation=((1, 2), 3))
    ),
    "deviation -1": _formulation("deviation", lambda: Quadratic(-1.0)),
    "deviation in a word": _formulation("deviation", lambda: Quadratic("x")),
    "quadratic triangles of what was split": _ply(
        "split", lambda b: split(b.mesh), lambda b: b.fabric, lambda b: Quadratic()
    ),
}


def _settings(names: str, **settings: Any) -> Case:
    return Case(lambda b: b.run({"clamp": b.clamp}, **settings), names)


_ODD_STEPS: tuple[Any, ...] = (
    *(0, -1, 1.5, "3", None, NAN, INF, 10**22, 1_000_001, 1e300, [2], 2 + 1j, ()),
    *("", b"2", 1e-320, -INF, {}, Decimal("1.5"), Fraction(1, 2)),
)

_RUNS = {
    **{f"steps {x!r}": _settings("steps", steps=x) for x in _ODD_STEPS},
    "method magic": _settings("method", method="magic"),
    "no method": _settings("nonlinear solver", method=None),
    "methods in a list": _settings("nonlinear solver", method=["newton"]),
    "a method's class": _settings("nonlinear solver", method=PlainNewton),
    "a method of no iteration": _settings("iteration", method=PlainNewton(0)),
    "a number for a method": _settings("nonlinear solver", method=3),
    "check magic": _settings("check", warn_only=["magic"]),
    "a check alone": _settings("check", warn_only="work"),
    "checks None": _settings("check", warn_only=None),
    "a number for a check": _settings("check", warn_only=[3]),
    "a list for a check": _settings("check", warn_only=[[]]),
    "halvings -1": _settings("max_halvings", max_halvings=-1),
    "halvings 1.5": _settings("max_halvings", max_halvings=1.5),
    "halvings NaN": _settings("max_halvings", max_halvings=NAN),
    "halvings in a word": _settings("max_halvings", max_halvings="3"),
    "halvings None": _settings("max_halvings", max_halvings=None),
    "halvings 10^6": _settings("max_halvings", max_halvings=10**6),
    "solver magic": _settings("solver", solver="magic"),
    "solver None": _settings("solver", solver=None),
    "solver in a list": _settings("solver", solver=["auto"]),
    "on_step 3": _settings("on_step", on_step=3),
    "on_iteration a word": _settings("on_iteration", on_iteration="print"),
    "checkpoint 3": _settings("checkpoint", checkpoint=3),
    "checkpoint with a zero": _settings("checkpoint", checkpoint="a\0b"),
    "resume without a checkpoint": Case(
        lambda b: LoadStepper(b.ply, {"clamp": b.clamp}).run(resume=True), "checkpoint"
    ),
    "no ply": Case(lambda b: LoadStepper(None, {"clamp": b.clamp}), "ply"),
    "a mesh for a ply": Case(lambda b: LoadStepper(b.mesh, {"clamp": b.clamp}), "ply"),
}


def _sound(**settings: Any) -> Case:
    return Case(lambda b: b.lift(**settings), None, lifted(0.1))


def _of(fabric: Callable[[], Fabric]) -> Case:
    def act(specimen: Specimen) -> Any:
        ply = Ply(specimen.mesh, fabric(), OnePoint(2.0))
        conditions = {"c": specimen.clamp, "d": Condition("top", 0.1, (0, 1))}
        return LoadStepper(ply, conditions, 2).run()

    return Case(act, None, lifted(0.1))


_SOUND = {
    "two steps as a float": _sound(steps=2.0),
    "two steps of numpy": _sound(steps=np.int64(2)),
    "checks in a set": _sound(warn_only={"work"}),
    "a method as such": _sound(method=PlainNewton()),
    "stiffness of numpy": _of(lambda: Fabric(np.float32(10), np.int64(2))),
    "a stiffness each": _of(lambda: Fabric([10.0, 20.0], 1.0)),
    "a law of its own": _of(lambda: Fabric(_Law(), 1.0)),
    "a wide domain": _of(lambda: Fabric(_Law(domain=(-1, INF)), 1.0)),
    "fibres of any length": _of(lambda: Fabric(10.0, 1.0, (1e-300, 0), (0, 1e150))),
    "fibres turned over": _of(lambda: Fabric(10.0, 1.0, (0, -1), (1, 0))),
}

CASES = {**_FABRICS, **_LAWS, **_PLIES, **_RUNS, **_SOUND}
