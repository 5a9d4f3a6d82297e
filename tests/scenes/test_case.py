import json

import numpy as np
import pytest

from skfem_textile import Fabric, Force
from skfem_textile.cli import main as cli
from skfem_textile.scenes import Case, strip


def case(**more):
    scene = strip(size=(3, 4))
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    return Case(scene=scene, fabric=fabric, steps=2, **more)


def test_a_case_says_what_the_command_line_says(tmp_path):
    options = ("--size", "3x4", "--steps", "2", "--shear-stiffness", "0.5")
    out = ("--no-render", "--out", str(tmp_path))
    assert cli.main(["run", "strip", *options, *out]) == 0
    told = json.loads((tmp_path / "summary.json").read_text())
    one = case()
    found = one.summary(one.run())
    for name, value in found.items():
        if not name.endswith("time_s"):
            assert told[name] == value, name


def test_no_exact_answer_holds_beside_loads():
    loaded = case(loads=(Force("top", np.array([0.1, 0.2])),))
    found = loaded.summary(loaded.run())
    assert found["exact_answer"] == "none: forces act beside the scene's conditions"
    assert "displacement_error_rms" not in found


def test_what_does_not_fit_is_refused_as_the_stepper_is_built():
    with pytest.raises(ValueError, match="unknown solver 'abacus'"):
        case(solver="abacus").stepper()
