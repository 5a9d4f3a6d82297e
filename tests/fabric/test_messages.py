"""Messages about laws, fabrics, directions, and their files; each is one line.

Those about single arguments of a fabric are in `tests.solve.test_hostile_arguments`.
"""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Asymmetric,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    Full,
    Linear,
    Locking,
    OnePoint,
    Ply,
    Polynomial,
    Pretensioned,
    Tabulated,
    TensionOnly,
)
from skfem_textile.fabric import CrimpedYarns, Softening
from skfem_textile.fabric.directions import AlongCurve, FibreDirections
from skfem_textile.fabric.files import read_law
from skfem_textile.fabric.law import refuse_other_units
from tests.helpers import refused


def parametrized(cases):
    return pytest.mark.parametrize(("call", "text"), cases)


# Parameters of laws


def of(law, *arguments, **options):
    return lambda: law(*arguments, **options)


def table(*arguments, **options):
    return of(Tabulated, *arguments, **options)


SHORT, LINE = Tabulated([0, 0.01], [0, 1]), Linear(1.0)
LIFTED = Tabulated([0, 0.01], [1, 2])
LAWS = [
    (table([0.0], [0.0]), "a table requires at least two points, got 1"),
    (table([0, 0.1, 0.1], [0, 1, 2]), "point 3: the argument 0.1 must"),
    (
        table([0, 0.1], [0, np.nan]),
        "point 2: both numbers must be finite, got 0.1, nan",
    ),
    (table([0.0, 0.1], [0.0]), r"same number of values, got shapes \(2,\) and \(1,\)"),
    (table("ab", [0.0]), "arguments must be real-valued"),
    (
        table([0, 1], [0, 1], "cubic"),
        "extrapolation must be refuse or linear, got 'cub",
    ),
    (
        table([-1, 1], [0, 1], odd=True),
        "have arguments >= 0 and.* but point 1 is -1, 0",
    ),
    (table([0, 1], [0.5, 1], odd=True), "the value 0 at 0, but point 1 is 0, 0.5"),
    (table([0.1, 1], [0.5, 1]), "covers 0.1 to 1, which excludes 0, the state at rest"),
    (table([0, 1e-300], [0, 1e300]), "the table overflows"),
    (table([0, 60], [0, 1]), "in degrees"),
    (of(Polynomial, ()), "coefficients must be finite numbers"),
    (of(Polynomial, (1, "a")), "coefficients must be finite"),
    (of(CrimpToe, 1e5, 0.0, 1.0), "toe must be a finite number > 0, got 0.0"),
    (of(CrimpToe, 1e5, 0.1, -1.0), "initial stiffness must be a finite number >= 0, g"),
    (of(CrimpToe, 1e4, 3, 1.0), "in per cent"),
    (of(Locking, 0.5, None), "locking angle must be a finite number > 0, got None"),
    (of(Locking, 0.1, 40.0), "in degrees"),
    (of(TensionOnly, LINE, 0.0), "width must be a finite number > 0, got 0.0"),
    (
        of(TensionOnly, Pretensioned(LINE, 3.0)),
        "must be zero at rest, but is 3 N/mm th",
    ),
    (of(TensionOnly, SHORT, 0.02), "the switch at 0.02, but its domain is 0 to 0.01"),
    (of(Asymmetric, LINE, SHORT), "must be defined from 0 to the switch at -0.0001,"),
    (of(TensionOnly, 3.0), r"law must be a law, such as Linear\(5e3\), got 3.0"),
    (of(TensionOnly, Linear(np.ones(3))), "uniform over the elements; define a fabric"),
    (of(Pretensioned, SHORT, 3.0), "reaches only 1 N/mm at a strain of 0.01, less tha"),
    (
        of(Pretensioned, LIFTED, 0.5),
        "tension of 1 N/mm at zero strain, more than the pre",
    ),
    (of(Fabric, 1e3, -np.ones(30)), r"^shear stiffness must be .*, got -1\.0$"),
]


@parametrized(LAWS)
def test_a_parameter_of_a_law_is_refused(call, text):
    refused(call, text)


def crimp(**changed):
    good = {"stiffness": 1e4, "crimp": 0.01, "bending": 1.0, "toe": 1e-3}
    return lambda: CrimpInterchange(**good | {"initial_stiffness": 1.0} | changed)


def yarns(**changed):
    good = {"yarns": (Softening(400.0), Softening(300.0)), "crimp": 0.1, "springs": 0.1}
    return lambda: CrimpedYarns(**good | changed)


BOTH = CrimpInterchange(1e4, 0.01, 1.0, 1e-3, 1.0)


@parametrized(
    [
        (crimp(stiffness=(1.0, -1.0)), "stiffness must be a finite number > 0, got -1"),
        (crimp(crimp=(0.1, np.nan)), "crimp must be a finite number >= 0, got nan"),
        (crimp(crimp=(0.1, 0.1, 0.1)), "crimp must be a number or a pair"),
        (crimp(bending=0.0), "bending must be a finite number > 0, got 0.0"),
        (crimp(toe=np.inf), "toe must be a finite number > 0, got inf"),
        (crimp(initial_stiffness=-1), "initial stiffness must be a finite number >= 0"),
        (
            crimp(stiffness=np.ones(500)),
            "stiffness must be .* uniform over the element",
        ),
        (lambda: Fabric(1e4, BOTH), "shear: CrimpInterchange is a law of both"),
        (lambda: Fabric((BOTH, 1e4)), "tension: CrimpInterchange is a law of both"),
        (lambda: TensionOnly(BOTH), "law must be a law of one strain"),
        (yarns(crimp=0.0), "crimp"),
        (yarns(springs=-1.0), "springs"),
        (yarns(yarns=(1.0, 2.0)), "yarn"),
        (yarns(coupling=np.nan), "coupling"),
    ]
)
def test_a_law_of_both_families_is_refused(call, text):
    refused(call, text)


def at_rest(force):
    return TensionOnly(Tabulated([0, 1e-4], [force, 1.0]))


@pytest.mark.parametrize(
    ("call", "accepted", "value", "text"),
    [
        (lambda x: refuse_other_units("x", x, "tension"), 0.5, 2.0, "largest strain"),
        (lambda x: refuse_other_units("x", x, "bending"), 0.5, 2.0, "radius of 1 mm"),
        (
            lambda x: refuse_other_units("x", np.pi / 2 * (1 + x), "shear"),
            *(3e-10, 3e-9, "a right angle"),
        ),
        (lambda x: crimp(crimp=x)(), 0.4, 0.6, "at most 0.5, such as 0.01"),
        (lambda x: yarns(crimp=x)(), 0.8, 1.2, "a ratio of at most 1,"),
        (at_rest, 3e-10, 3e-9, "must be zero at rest"),
    ],
)
def test_a_value_is_refused_beyond_a_limit(call, accepted, value, text):
    call(accepted)
    refused(lambda: call(value), text)


# Fabrics and directions

MESH = MeshQuad().refined(1).with_subdomains({"left": [0, 1], "right": [2, 3]})


def fabric(**arguments):
    return lambda: Fabric(**arguments)


def ply(of, mesh=MESH):
    return lambda: Ply(mesh, of, OnePoint(0.0))


HALF = Fabric(10.0, 1.0)
VECTOR, FINITE = "must be a vector", "must be a non-zero finite vector"
# Fibres are parallel on x = 1/8 only: at the centres of some elements.
PARALLEL_ONCE = Fabric(warp=lambda x: np.stack([x[0] - 0.125, 1 + 0 * x[0]]))


@parametrized(
    [
        (fabric(warp=np.ones((2, 5)), weft=np.ones((2, 4))), f"weft {VECTOR}"),
        (fabric(warp=lambda x: x, weft=(0, 0)), f"weft {FINITE}"),
        (ply(PARALLEL_ONCE, MeshQuad().refined(2)), "parallel"),
        (ply(Fabric(warp=np.eye(2)[:, [0] * 5])), "one vector per element"),
        (ply({"left": HALF}), "are not in any subdomain with a fabric"),
        (ply({"left": HALF, "rigth": HALF}), "no subdomain 'rigth'"),
        (ply({"left": HALF, "right": 1e4}), "'right' requires a Fabric"),
        (lambda: FibreDirections.of_angles([0.0], [0.0]), "parallel"),
        (lambda: FibreDirections.of_angles([0.0], [np.inf]), "finite"),
        (lambda: FibreDirections.of_angles([], []), "shape"),
        (
            lambda: FibreDirections.of_angles([0.0, 1.0], [90.0]),
            "are 2 warp dire.* but 1",
        ),
        (of(AlongCurve, [[0.0], [0.0]]), "points of a reference curve must have"),
        (of(AlongCurve, [[0, 0], [1, 1]]), "must be distinct"),
        (of(AlongCurve, [[0, np.nan], [0, 1]]), "must be finite"),
        (of(AlongCurve, [[0, 1, 0], [0, 0, 0]]), "must not turn back on itself"),
    ]
)
def test_a_fabric_or_direction_is_refused(call, text):
    refused(call, text)


class Doubled(Linear):
    """A law with twice its energy."""

    def energy(self, x):
        return 2 * super().energy(x)


def test_the_family_or_the_shear_of_an_inconsistent_law_is_named():
    for of, text in (
        (Fabric((1.0, Doubled(1.0))), "^weft law, energy: at ε = "),
        (Fabric(1.0, Doubled(1.0)), "^shear law, energy: at Γ = "),
    ):
        refused(lambda fabric=of: Ply(MESH, fabric, Full()), text)


# Files


HEADER = "shear angle (deg),moment (N mm/mm2)\n"
FORM = "row 1: the header must be of the form"
CSV = [
    ("", "law.csv: the file is empty"),
    (b"\xff\xfe", "not a CSV file in UTF-8"),
    ("0,0\n1,1\n", f"{FORM} 'shear angle .*, got '0,0'"),
    ("shear angle (grad),moment (N/mm)\n0,0\n1,1", FORM),
    ("shear angle (deg),tension (N/mm)\n0,0\n1,1", FORM),
    (HEADER.replace(",", ";") + "0;0,5\n1.5;1", "both decimal points and commas"),
    (HEADER + "0,0\n", "law.csv, a table requires at least two points, got 1"),
    (HEADER + "0,0\n1,1,1\n", "row 3: two numbers are required, got '1,1,1'"),
    (HEADER + "0,0\n1,x\n", "row 3: two numbers are required, got '1,x'"),
    (HEADER + "0,0\n\n1,inf\n", "row 4: both numbers must be finite, got 1, inf"),
    (HEADER + "0,0\n\n2,1\n1,2", "row 5: the argument 1 must be larger than the pr"),
    (HEADER + "1,0\n2,1\n", "law.csv: the table covers 0.0174533 to .* excludes 0"),
    ("shear angle (rad),moment (N/mm)\n0,0\n40,2\n", "row 3: 40.*degrees"),
    ("shear angle (deg),moment (N/mm)\n0,0\n120,2\n", "row 3: 2.094.* rad$"),
    ("fibre strain (-),tension (N/mm)\n0,0\n3,9\n", "strain, 1: is the value in per"),
]


@pytest.mark.parametrize(("content", "text"), CSV)
def test_a_table_is_refused_with_file_and_row(tmp_path, content, text):
    file = tmp_path / "law.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    refused(lambda: Tabulated.from_csv(file), text)


def test_a_table_of_the_other_kind_is_refused(tmp_path):
    file = tmp_path / "law.csv"
    file.write_text(HEADER + "0,0\n1,1\n")
    assert Tabulated.from_csv(file, of="shear").values == (0.0, 1.0)
    text = r"must be of the form 'fibre strain \(-\),tension"
    refused(lambda: Tabulated.from_csv(file, of="tension"), text)


KIND = "'kind' is the name of a law"
JSON = [
    ("{", "not JSON"),
    ("3", f"an object whose key {KIND}"),
    ('{"kind": "AlongCurve", "points": [[0, 1], [0, 1]]}', KIND),
    ('{"kind": "Cubic"}', "unknown law 'Cubic'"),
    ('{"kind": "Sin2", "stiffness": 1, "angle": 2}', "Sin2 has no parameter 'angle'"),
    ('{"kind": "Sin2"}', "Sin2 requires the parameter 'stiffness'"),
    ('{"kind": "Sin2", "stiffness": -1}', "stiffness must be"),
]


@pytest.mark.parametrize(("content", "text"), JSON)
def test_a_file_of_a_law_is_refused_with_its_name(tmp_path, content, text):
    file = tmp_path / "law.json"
    file.write_text(content)
    assert refused(lambda: read_law(file), text).startswith(str(file))
