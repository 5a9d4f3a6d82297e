"""Laws and fabrics in files."""

import json

import numpy as np
import pytest

import skfem_textile
from skfem_textile import (
    Asymmetric,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from skfem_textile.fabric.fabric_file import (
    read_fabric,
    read_law,
    write_fabric,
    write_law,
)

SHEAR = (
    Sin2(0.1),
    Polynomial((0.1, 0.0, 1 / 3), sine=True),
    Locking(0.1, 1.0),
    Tabulated([0.0, 0.5], [0.0, 0.1], odd=True),
)
TENSION = (
    Linear(1e5),
    TensionOnly(CrimpToe(1e5, 0.004, 10.0)),
    Asymmetric(Linear(1e5), Linear(10.0)),
    Pretensioned(Linear(1e3), 5.0),
)
CRIMPED = CrimpInterchange(1e4, 0.01, 1, 1e-3, 1)


@pytest.mark.parametrize("law", [*SHEAR, *TENSION, CRIMPED])
def test_a_law_comes_back_to_the_last_digit(law, tmp_path):
    write_law(law, tmp_path / "law.json")
    assert repr(read_law(tmp_path / "law.json")) == repr(law)


def test_every_law_of_the_library_has_a_file():
    laws = {type(law) for law in (*SHEAR, *TENSION, CRIMPED, TENSION[1].law)}
    public = [getattr(skfem_textile, name) for name in skfem_textile.__all__]
    assert laws == {one for one in public if is_law(one)}


def is_law(one):
    """Whether it is the class of a law with parameters."""
    own = one.__module__.startswith("skfem_textile.fabric.") if callable(one) else False
    return own and hasattr(one, "tangent") and hasattr(one, "__dataclass_fields__")


@pytest.mark.parametrize("tension", [1e5, (TENSION[1], 3.0), CRIMPED])
def test_a_fabric_comes_back(tension, tmp_path):
    fabric = Fabric(tension, SHEAR[1], (1.0, 2.0), (-1.0, 0.3))
    write_fabric(fabric, tmp_path / "fabric.json")
    found = read_fabric(tmp_path / "fabric.json")
    assert repr(found.laws) == repr(fabric.laws)
    x = np.zeros((2, 1, 1))
    np.testing.assert_array_equal(found.directions(x), fabric.directions(x))


def test_what_differs_from_place_to_place_is_refused(tmp_path):
    for fabric, said in (
        (Fabric(np.ones(3)), "from element to element"),
        (Fabric(1.0, warp=lambda x: x), "warp differs from place to place"),
        (Fabric(1.0, weft=np.ones((2, 3)) * [[0], [1]]), "weft differs from place"),
    ):
        with pytest.raises(ValueError, match=said):
            write_fabric(fabric, tmp_path / "fabric.json")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "no JSON"),
        ("[]", "an object with the 'name' of a law"),
        ('{"name": "Cubic"}', "'Cubic' is none of Linear"),
        (
            '{"name": "Sin2", "stiffness": 1, "angle": 2}',
            "Sin2 has no parameter 'angle'",
        ),
        ('{"name": "Sin2"}', "Sin2: .*stiffness"),
        ('{"name": "Sin2", "stiffness": -1}', "stiffness must be"),
    ],
)
def test_what_is_no_law_is_refused_in_one_line(content, said, tmp_path):
    (tmp_path / "law.json").write_text(content)
    with pytest.raises(ValueError, match=said) as told:
        read_law(tmp_path / "law.json")
    assert str(told.value).startswith(str(tmp_path / "law.json"))
    assert "\n" not in str(told.value)


def test_a_fabric_that_lacks_a_part_is_refused(tmp_path):
    (tmp_path / "fabric.json").write_text(json.dumps({"tension": {}}))
    with pytest.raises(ValueError, match="an object of tension, shear, warp, weft"):
        read_fabric(tmp_path / "fabric.json")
