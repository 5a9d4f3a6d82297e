"""Laws in files; fabrics are in tests/io/test_fabrics.py."""

import pytest

import skfem_textile.fabric
from skfem_textile import (
    Asymmetric,
    CrimpInterchange,
    CrimpToe,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from skfem_textile.fabric import CrimpedYarns, Softening, TangentShear, TwoLaws
from skfem_textile.fabric.files import read_law, write_law

SHEAR = (
    Sin2(0.1),
    Polynomial((0.1, 0.0, 1 / 3), sine=True),
    Locking(0.1, 1.0),
    Tabulated([0.0, 0.5], [0.0, 0.1], odd=True),
    TangentShear(0.1, 0.7, 0.8),
)
TENSION = (
    Linear(1e5),
    TensionOnly(CrimpToe(1e5, 0.004, 10.0)),
    Asymmetric(Linear(1e5), Linear(10.0)),
    Pretensioned(Linear(1e3), 5.0),
)
BOTH = (
    CrimpInterchange(1e4, 0.01, 1, 1e-3, 1),
    CrimpedYarns((Softening(4e2, 3.0), Linear(1e3)), 0.1, (0.1, 1 / 3), 2.0),
    TwoLaws(Linear(1e5), Linear(1e3)),
)


@pytest.mark.parametrize("law", [*SHEAR, *TENSION, *BOTH])
def test_a_law_comes_back_to_the_last_digit(law, tmp_path):
    write_law(law, tmp_path / "law.json")
    assert repr(read_law(tmp_path / "law.json")) == repr(law)


def test_every_law_of_the_library_has_a_file():
    laws = {type(law) for law in (*SHEAR, *TENSION, *BOTH, TENSION[1].law)}
    laws.add(Softening)  # within another
    names = skfem_textile.fabric.__all__
    public = [getattr(skfem_textile.fabric, name) for name in names]
    assert laws == {one for one in public if is_law(one)}


def is_law(one):
    """Whether it is the class of a law with parameters."""
    own = one.__module__.startswith("skfem_textile.fabric.") if callable(one) else False
    return own and hasattr(one, "tangent") and hasattr(one, "__dataclass_fields__")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "no JSON"),
        ("[]", "an object with the 'kind' of a law"),
        ("3", "an object with the 'kind' of a law"),
        ('{"kind": "AlongCurve", "points": [[0, 1], [0, 1]]}', "with the 'kind' of a"),
        ('{"kind": "Cubic"}', "no law 'Cubic'"),
        (
            '{"kind": "Sin2", "stiffness": 1, "angle": 2}',
            "Sin2 has no parameter 'angle'",
        ),
        ('{"kind": "Sin2"}', "Sin2 needs the parameter 'stiffness'"),
        ('{"kind": "Sin2", "stiffness": -1}', "stiffness must be"),
    ],
)
def test_what_is_no_law_is_refused_in_one_line(content, said, tmp_path):
    (tmp_path / "law.json").write_text(content)
    with pytest.raises(ValueError, match=said) as told:
        read_law(tmp_path / "law.json")
    assert str(told.value).startswith(str(tmp_path / "law.json"))
    assert "\n" not in str(told.value)
