"""A checkpoint of another run is refused, however little tells them apart."""

from dataclasses import dataclass

import numpy as np
import pytest

from skfem_textile import (
    CheckpointError,
    Condition,
    CrimpInterchange,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Sin2,
)
from tests.helpers import Coupled, distorted
from tests.helpers.strip_runs import assert_same, interrupted_at, stepper


def test_a_law_of_both_strains_is_resumed_and_told_from_another(tmp_path):
    laws = [CrimpInterchange(1e4, c, 1.0, 1e-2, 100.0) for c in (0.01, 0.02)]
    interrupted_at(tmp_path / "c", 0.3, E=laws[0])
    with pytest.raises(CheckpointError, match=r"warp law was Crimp.*, is Crimp.*0.02"):
        stepper(tmp_path / "c", E=laws[1]).run(resume=True)
    whole = stepper(None, E=laws[0]).run()
    assert_same(stepper(tmp_path / "c", E=laws[0]).run(resume=True), whole)


class Hidden(Coupled):
    """A law whose repr does not tell its coupling."""

    def __repr__(self):
        return "Hidden()"


def test_a_coupling_that_the_repr_hides_is_told_apart(tmp_path):
    interrupted_at(tmp_path / "c", 0.3, E=Hidden(1e4, 100.0))
    told = "its values of the tensions beside a stretched family differ"
    with pytest.raises(CheckpointError, match=told):
        stepper(tmp_path / "c", E=Hidden(1e4, 101.0)).run(resume=True)


@pytest.mark.parametrize(
    ("other", "what"),
    [
        ({"C_s": 2.0}, r"formulation was OnePoint\(stabilisation=1.0.* is .*=2.0"),
        ({"E": 1e10}, "warp law was Linear.*10000.0.* is .*10000000000.0"),
        ({"E": (1e4, 2e4)}, "weft law was"),
        ({"E": CrimpInterchange(1e4, 0.01, 1.0, 1e-3, 1.0)}, "warp law was Linear"),
        ({"kind": "rate"}, "formulation was .*'energy'.* is .*'rate'"),
        ({"C_s": "auto"}, "formulation was .*1.0.* is .*'auto'"),
        ({"steps": 7}, "steps was"),
        ({"method": "plain"}, "method was"),
        ({"warn_only": []}, "warn_only was"),
    ],
)
def test_a_checkpoint_of_another_run_is_refused(half, other, what):
    with pytest.raises(CheckpointError, match=f"of another run: .*{what}") as error:
        stepper(half, **other).run(resume=True)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "other",
    [
        {"C_s": 2.0},
        {"shear": 1.0},
        {"shear": Sin2(0.5)},
        {"path": lambda t: t**2},
    ],
    ids=["stabilisation", "shear", "law", "path"],
)
def test_what_stiff_fibres_hide_is_told_apart_too(tmp_path, other):
    def square(C_s=1.0, shear=0.5, path=lambda t: t):
        mesh = distorted(1).with_defaults()
        ply = Ply(mesh, Fabric(1e10, shear), OnePoint(C_s))
        pull = Condition("top", lambda X, t: 0 * X + 0.1 * path(t))
        held = {"clamp": Condition("bottom"), "pull": pull}
        return LoadStepper(ply, held, 2, checkpoint=tmp_path / "c")

    square().run()
    with pytest.raises(CheckpointError, match="of another run"):
        square(**other).run(resume=True)


def test_a_state_of_another_run_is_refused(tmp_path):
    for name, E in (("a", 1e4), ("b", 2e4)):
        interrupted_at(tmp_path / name, 0.5, E=E)
    state = "state_000001.npz"
    (tmp_path / "b" / state).rename(tmp_path / "a" / state)
    with pytest.raises(CheckpointError, match=r"000001\.npz is of another run"):
        stepper(tmp_path / "a").run(resume=True)


@pytest.mark.parametrize("C_s", [("auto", 1.0), (1.0, "auto")])
def test_a_stabilisation_that_begins_as_the_automatic_one_is_not_taken_for_it(
    tmp_path, C_s
):
    """Here C_s is automatically 10⁻⁴ E = 1 N/mm: the first forces are the same."""
    interrupted_at(tmp_path / "c", 0.5, C_s=C_s[0])
    with pytest.raises(CheckpointError, match="another run: formulation was") as error:
        stepper(tmp_path / "c", C_s=C_s[1]).run(resume=True)
    assert "\n" not in str(error.value)


@dataclass(frozen=True)
class Cubic:
    """M_s = G Γ + a Γ³, of which the repr tells nothing."""

    a: float

    def energy(self, x):
        return 0.25 * x**2 + 0.25 * self.a * x**4

    def value(self, x):
        return 0.5 * x + self.a * x**3

    def tangent(self, x):
        return 0.5 + 3 * self.a * x**2

    def __repr__(self):
        return "Cubic()"


@pytest.mark.parametrize(
    ("other", "what"),
    [
        ({"shear": Cubic(1e-6)}, "values of the shear law differ"),
        ({"slope": (1.0, 0.3)}, "fixed directions differ"),
        ({"names": ("low", "high", "side")}, "conditions was"),
        ({"warp": (1.0, 1e-6)}, "fibre directions differ"),
    ],
)
def test_what_the_first_forces_do_not_tell_is_told_apart_too(tmp_path, other, what):
    def square(
        shear=None, slope=(1.0, 0.2), names=("clamp", "pull", "roll"), warp=(1.0, 0.0)
    ):
        fabric = Fabric(1e10, shear or Cubic(0.0), warp)
        ply = Ply(distorted(1).with_defaults(), fabric, OnePoint())
        middle = np.abs(ply.nodes - 0.5).sum(axis=0).argsort()[:1]
        held = (
            Condition("bottom"),
            Condition("top", 0.01, (0, 1)),
            Condition(middle, 0.0, slope),
        )
        conditions = dict(zip(names, held, strict=True))
        return LoadStepper(ply, conditions, 2, checkpoint=tmp_path / "c")

    square().run()
    with pytest.raises(CheckpointError, match=f"of another run: .*{what}"):
        square(**other).run(resume=True)
