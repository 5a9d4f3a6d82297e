"""Invalid conditions, laws and settings are rejected in one line.

Unusual valid ones are accepted and give an equilibrium with correct displacements.
"""

import re
import warnings
from collections.abc import Callable
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import strategies as st
from skfem import MeshQuad

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
    StepError,
    split,
)
from tests.helpers.hostile import (
    RIGHT,
    Family,
    WrongAnswerError,
    expect,
    expect_close,
    rejected,
    seeds,
)
from tests.helpers.hostile.sheets import jittered, sheet

NAN, INF, UP = np.nan, np.inf, (0.0, 1.0)


class Specimen:
    """A square of 3 mm in nine cells, whose inner nodes are moved at random."""

    def __init__(self, rng):
        base = jittered(sheet(3, 3, 3.0, 3.0), rng)
        self.mesh = MeshQuad(base.p, base.t).with_defaults()
        self.fabric = Fabric(50.0, 2.0, (1.0, 0.2), UP)
        self.formulation = [Full(), OnePoint(4.0)][int(rng.integers(2))]
        self.top = np.flatnonzero(self.mesh.p[1] == 3)
        self.bottom = np.flatnonzero(self.mesh.p[1] == 0)
        self.clamp = Condition("bottom")

    @property
    def ply(self):
        return Ply(self.mesh, self.fabric, self.formulation)

    def run(self, conditions, **settings):
        return LoadStepper(self.ply, conditions, **({"steps": 2} | settings)).run()

    def lift(self, *condition, fabric=None, **settings):
        """Load the specimen, its bottom held, by default with its top lifted."""
        self.fabric = fabric or self.fabric
        condition = Condition(*condition or ("top", 0.1, UP))
        return self.run({"clamp": self.clamp, "c": condition}, **settings)


class Case(NamedTuple):
    """A use of the library.

    ``says`` is a pattern of the message, None if the use must not be rejected;
    ``moves`` are nodes, a direction, and the displacements that the nodes must have. A
    ``loose`` case may be rejected, stop, or give an equilibrium.
    """

    act: Callable
    says: str | None
    moves: Callable | None = None
    loose: bool = False


class Unusual:
    """An object of a class that no argument accepts."""

    def __repr__(self):
        return "Unusual()"


def named(*values, **functions):
    """Values by their repr, and functions by name."""
    return {repr(x): x for x in values} | functions


def fails(*_):
    return 1 / 0


def held(specimen):
    return [(specimen.bottom, (1, 0), 0.0), (specimen.bottom, (0, 1), 0.0)]


def lifted(specimen):
    return [*held(specimen), (specimen.top, UP, 0.1)]


# Conditions


def late(bad):
    """A value that is invalid at load factor 0.5 only."""
    return lambda X, t: np.where(t == 0.5, bad, 0.1 * t) + 0 * X[0]


WHERE = named(
    *(None, "bottom\n", [NAN], [], [15, 99], [2**70], [[1], [2, 3]], [True, False]),
    Unusual(),
    a_mask_of_none=np.zeros(16, dtype=bool),
    where_nothing_is=lambda X: X[0] > 9,
    where_it_is_a_number=lambda X: X[0],
    where_it_is_of_wrong_shape=lambda X: X > 1,
    where_it_fails=fails,
    where_it_takes_nothing=lambda: True,
)
ALONG = named(
    *((0, 0), (NAN, 1), (1, 2, 3), "up", (1j, 0), [[1], [1, 2]]),
    what_fails=fails,
    what_is_None=lambda X: None,
    what_is_zero_once=lambda X: X - X[:, :1],
)
BY = named(
    *(NAN, None, 1 + 2j, {}, [[1], [1, 2]], [0.1, 0.1]),
    a_vector_along_a_direction=np.ones((2, 4)),
    what_fails=fails,
    what_is_None=lambda X, t: None,
    what_is_complex=lambda X, t: 1j * X[0],
    what_takes_one=lambda X: X[0],
    NaN_at_half=late(NAN),
)
VECTORS = named(
    *(3.0, (1.0, 2.0, 3.0), (0.1, NAN), (0.1, 1j)),
    vectors_turned=np.ones((4, 2)),
    what_is_a_row=lambda X, t: X[0],
)
BOTH = {
    "two along lines": (
        Condition("top", 0.1, UP),
        Condition("top", 0.2, direction=(0, -2)),
    ),
    "two at half alone": (
        Condition("top", lambda X, t: t + 0 * X[0], UP),
        Condition("top", lambda X, t: t**2 + 0 * X[0], UP),
    ),
}
ALL = named(
    *({}, None, {"c\n": "bottom"}),
    a_class_for_a_condition={"c": Condition},
    an_odd_name={"c\n\x1b": Condition("x\ny")},
)


def condition(says, *arguments):
    return Case(lambda s: s.lift(*arguments), f"^condition 'c': {says}")


SELECTS = (
    "(where (must be|selects no nodes|raised .*Error)|node numbers must be from 0 to 15"
    "|the mesh has no boundary .*'left', 'bottom')"
)
LEADS = (
    "direction (must be (a non-zero finite vector|a vector of 2 components,|"
    "real-valued)|raised)"
)
MOVES = (
    r"the value (is not finite at load factor 0|must be real-valued|raised .*Error|"
    r"must have shape \({}4,?\), not)"
)
CONTAINS = (
    "there are no conditions: specify|must be a mapping of names to Conditions|"
    "^condition 'c.*' must be a Condition such as .*, not|no boundary"
)
CONDITIONS = {
    **{f"on {name}": condition(SELECTS, at, 0.1, UP) for name, at in WHERE.items()},
    **{f"along {name}": condition(LEADS, "top", 0.1, n) for name, n in ALONG.items()},
    **{f"by {k}": condition(MOVES.format(""), "top", x, UP) for k, x in BY.items()},
    **{
        f"moved by {name}": condition(MOVES.format("2, "), "top", by)
        for name, by in VECTORS.items()
    },
    **{
        name: Case(
            lambda s, c=c, d=d: s.run({"clamp": s.clamp, "c": c, "d": d}),
            "'c' and 'd' disagree at node 1[25].* at load factor (1|0.5)$",
        )
        for name, (c, d) in BOTH.items()
    },
    **{
        f"conditions {name}": Case(lambda s, c=c: s.run(c), CONTAINS)
        for name, c in ALL.items()
    },
}


# Unusual but valid conditions


def right(X):
    """The right side without its lower end."""
    return (X[0] == 3) & (X[1] > 0)


def on(where):
    """A condition on the top, which is specified otherwise than by name."""
    return Case(lambda s: s.lift(where(s), 0.1, UP), None, lifted)


def rising(direction, value=0.1):
    return Case(lambda s: s.lift("top", value, direction), None, lifted)


LIFT, SAME = Condition("top", 0.1, UP), Condition("top", -0.1, (0, -2))
SOUND_CONDITIONS = {
    "numbers twice": on(lambda s: [*s.top, *s.top]),
    "short numbers": on(lambda s: s.top.astype(np.uint8)),
    "a list of bools": on(lambda s: (s.mesh.p[1] == 3).tolist()),
    "a function": on(lambda s: lambda X: X[1] > 2.9),
    "a tiny direction": rising((0.0, 1e-300)),
    "a direction each": rising(lambda X: np.array([0 * X[0], 1 + X[0]])),
    "a number each": rising(UP, [0.1] * 4),
    "what is one number": rising(UP, lambda X, t: 0.1 * t),
    "twice the same": Case(
        lambda s: s.run({"clamp": s.clamp, "c": LIFT, "d": SAME}), None, lifted
    ),
    "all nodes": Case(
        lambda s: s.run(
            {"c": Condition(range(16), lambda X, t: [[0.03 * t], [0]] * X[::-1])}
        ),
        None,
        lambda s: [
            (np.arange(16), (1, 0), 0.03 * s.mesh.p[1]),
            (np.arange(16), UP, 0.0),
        ],
    ),
    "a whole vector": Case(
        lambda s: s.lift("top", (0.05, 0.1)),
        None,
        lambda s: [*held(s), (s.top, (1, 0), 0.05), (s.top, UP, 0.1)],
    ),
    "a slope": Case(
        lambda s: s.lift(right, 0.05, (3, 4)),
        None,
        lambda s: [*held(s), (np.flatnonzero(right(s.mesh.p)), (3, 4), 0.05)],
    ),
}


def loose(act):
    return Case(act, "", loose=True)


# Plies that may move as a rigid body, and unusual values.
LOOSE = {
    "held along x": loose(
        lambda s: s.run({"c": Condition("bottom", direction=(1, 0))})
    ),
    "held at a node, pulled at one": loose(
        lambda s: s.run({"c": Condition([0]), "d": Condition([15], (0.1, 0.1))})
    ),
    "by 1e308": loose(lambda s: s.lift("top", 1e308, UP)),
    "by 1e30": loose(lambda s: s.lift("top", 1e30, UP)),
    "turned inside out": loose(lambda s: s.lift("top", (0.0, -7.0), max_halvings=2)),
    "at once at t = 0": loose(lambda s: s.lift("top", lambda X, t: 0.1 + 0 * X[0], UP)),
    "a word of a number": loose(lambda s: s.lift("top", "0.1", UP)),
    "true": loose(lambda s: s.lift("top", True, UP)),
}


# Fabrics, laws, formulations and settings


class Law:
    """A linear law whose parts may be replaced."""

    def __init__(self, **parts):
        vars(self).update(parts)

    def energy(self, x):
        return 5.0 * x**2

    def value(self, x):
        return 10.0 * x

    def tangent(self, x):
        return np.full(np.shape(x), 10.0)


def overwrites(x):
    x[...] = 0.0
    return x


def not_a_number(x):
    return x * NAN


NAN_LAW = Law(energy=not_a_number, value=not_a_number, tangent=not_a_number)

STIFFNESSES = named(
    *(-1.0, INF, None, "10", 1j, [], Linear, Decimal("NaN")), an_array=np.ones(3)
)
WARP = named(
    *((0, 0), (1j, 0), None, [[1], [1, 2]]),
    of_ten_elements=np.ones((2, 10)) * [[1], [0]],
    turned=np.ones((9, 2)) * [1, 0],
    fails=fails,
    gives_None=lambda x: None,
)
# Part of a law, and what it is instead.
LAWS = {
    "the energy of another law": ("energy", lambda x: 7 * x**2),
    "the tangent of another law": ("tangent", lambda x: 9 + 0 * x),
    "an energy that fails": ("energy", fails),
    "a value of None": ("value", lambda x: None),
    "a complex value": ("value", lambda x: 10 * x + 0j),
    "a value of wrong shape": ("value", lambda x: np.ones(4)),
    "a value that spoils": ("value", overwrites),
    "a tangent that is no function": ("tangent", 10.0),
    "a domain of words": ("domain", ("low", "high")),
    "a domain turned": ("domain", (0.1, -0.1)),
}


def fabric(says, **parts):
    return Case(
        lambda s: Ply(s.mesh, Fabric(**({"shear": 1.0} | parts)), s.formulation), says
    )


FABRICS = {
    **{f"tension {k}": fabric("tension", tension=v) for k, v in STIFFNESSES.items()},
    **{f"shear {k}": fabric("shear", shear=v) for k, v in STIFFNESSES.items()},
    **{f"warp {name}": fabric("warp", warp=warp) for name, warp in WARP.items()},
    **{name: fabric("law", tension=Law(**{k: v})) for name, (k, v) in LAWS.items()},
    "three tensions": fabric("tension", tension=(1, 2, 3)),
    "a bad tension of two": fabric("tension", tension=(1, -2)),
    "no stiffness": fabric("no stiffness", tension=0.0, shear=0.0),
    "weft zero once": fabric("weft", weft=np.eye(9)[[8, 0]]),
    "weft parallel": fabric("parallel", weft=(-2, 0)),
    "weft parallel once": fabric("parallel", weft=lambda x: np.array([x[0], 0 * x[0]])),
    "weft gives NaN": fabric("weft", weft=lambda x: x * NAN),
    "NaN everywhere": Case(
        lambda s: LoadStepper(
            Ply(s.mesh, Fabric(NAN_LAW, 1.0), Full()), {"clamp": s.clamp}
        ).run(),
        "law",
    ),
}


PLIES = {
    "a formulation's class": Case(
        lambda s: Ply(s.mesh, s.fabric, OnePoint), "ormulation"
    ),
    "kind magic": Case(lambda s: OnePoint(1.0, "magic"), "kind"),
    "kind in a list": Case(lambda s: OnePoint(1.0, ["energy"]), "kind"),
    "no mesh": Case(lambda s: Ply(None, s.fabric, Full()), "mesh"),
    "a number for a fabric": Case(lambda s: Ply(s.mesh, 1.0, Full()), "abric"),
    "a class for a fabric": Case(lambda s: Ply(s.mesh, Fabric, Full()), "abric"),
    "macro-elements that were refined": Case(
        lambda s: Ply(split(s.mesh).refined(), s.fabric, Macro()), "split"
    ),
}

# Pattern of the message, and values of a setting.
SETTINGS: tuple[tuple[str, str, tuple[Any, ...]], ...] = (
    (
        "steps must be a whole number from 1 to 1000000, got",
        "steps",
        (0, 1.5, "3", None, NAN, INF, 1_000_001, 1e300, 2 + 1j),
    ),
    ("steps of part 2 must be a whole", "steps", ([2, 0], (1, "x"), [1, [1]])),
    ("the sum of steps must be a whole number from 1", "steps", ([], [600_000] * 2)),
    ("max_halvings must be a whole number from 0 to 30, got", "max_halvings", (-1, 31)),
    ("unknown method .*: choose one of newton, plain", "method", ("magic",)),
    ("method must be a nonlinear solver or its", "method", (["newton"], PlainNewton)),
    ("maximum number of iterations must be at least 1", "method", (PlainNewton(0),)),
    ("unknown check .*choose one of", "warn_only", (["magic"], [[]])),
    ("warn_only must be a list of checks", "warn_only", ("work", None)),
    ("unknown solver .*: choose one of auto, cholmod", "solver", ("magic", ["auto"])),
    ("on_step must be a function, not 3", "on_step", (3,)),
    ("on_iteration must be a function, not 'print'", "on_iteration", ("print",)),
    ("checkpoint (must be the path of|.* is not a valid)", "checkpoint", (3, "a\0b")),
)


def setting(says, key, value):
    return Case(lambda s: s.run({"clamp": s.clamp}, **{key: value}), says)


RUNS = {
    **{
        f"{key} {value!r}": setting(says, key, value)
        for says, key, values in SETTINGS
        for value in values
    },
    "resume without a checkpoint": Case(
        lambda s: LoadStepper(s.ply, {"clamp": s.clamp}).run(resume=True),
        "there is no checkpoint to resume from",
    ),
    "no ply": Case(
        lambda s: LoadStepper(None, {"clamp": s.clamp}), "ply must be a Ply"
    ),
}


def sound(**settings):
    return Case(lambda s: s.lift(**settings), None, lifted)


SOUND_ARGUMENTS = {
    "two steps as a float": sound(steps=2.0),
    "two steps of numpy": sound(steps=np.int64(2)),
    "two numbers of steps": sound(steps=[2, 1]),
    "checks in a set": sound(warn_only={"work"}),
    "a method as such": sound(method=PlainNewton()),
    "stiffness of numpy": sound(fabric=Fabric(np.float32(10), np.int64(2))),
    "a stiffness each": sound(fabric=Fabric([10.0, 20.0], 1.0)),
    "a law of its own": sound(fabric=Fabric(Law(), 1.0)),
    "a wide domain": sound(fabric=Fabric(Law(domain=(-1, INF)), 1.0)),
    "fibres of any length": sound(fabric=Fabric(10.0, 1.0, (1e-300, 0), (0, 1e150))),
    "fibres turned over": sound(fabric=Fabric(10.0, 1.0, (0, -1), (1, 0))),
}

CASES = {
    **(CONDITIONS | SOUND_CONDITIONS | LOOSE),
    **(FABRICS | PLIES | RUNS | SOUND_ARGUMENTS),
}


def attempt(hostile):
    name, seed = hostile
    case, specimen = CASES[name], Specimen(np.random.default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            result = case.act(specimen)
        except StepError as stop:
            if case.loose:
                return rejected(stop)
            raise WrongAnswerError(f"stopped: {stop}") from None
        except ValueError as error:
            says = case.says
            expect(says is not None and re.search(says, str(error)), f"{says}: {error}")
            return rejected(error)
    expect(case.says is None or case.loose, f"taken: {result!r}")
    with np.errstate(all="ignore"):
        check_equilibrium(result, case.moves(specimen) if case.moves else ())
    return RIGHT


def check_equilibrium(result, moves):
    """Check equilibrium and the displacements of the conditions."""
    ply, state = result.ply, result.states[-1]
    u = ply.nodal(result.u)
    expect(np.isfinite(u).all(), "displacements that are not finite")
    for nodes, direction, value in moves:
        n = np.array(direction) / np.hypot(*direction)
        expect_close("moves", n @ u[:, nodes], value, 1e-9 * (1 + np.abs(value).max()))
    f = ply.nodal(ply.residual(state.u, state.load_factor, state.parameters))
    largest = np.abs(f).max() + 1e-6
    expect_close("sum of the forces", f.sum(axis=1), 0.0, 1e-9 * largest * len(f[0]))
    if moves:
        prescribed = np.concatenate([nodes for nodes, _, _ in moves])
        free = np.setdiff1d(np.arange(u.shape[1]), prescribed)
        expect_close("forces on free nodes", f[:, free], 0.0, 1e-6 * largest)


FAMILY = Family(
    "conditions",
    {name: st.tuples(st.just(name), seeds) for name in CASES},
    attempt,
    2500,
    short=100,
)


DEAR = {"turned inside out", "by 1e30"}


@pytest.mark.parametrize(
    "name", [pytest.param(k, marks=[pytest.mark.slow] * (k in DEAR)) for k in CASES]
)
def test_an_invalid_argument_is_rejected_and_a_valid_one_accepted(name):
    FAMILY.outcome((name, 1))
