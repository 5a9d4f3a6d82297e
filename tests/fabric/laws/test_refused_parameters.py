"""Parameters that make no law."""

import numpy as np
import pytest

from skfem_textile import (
    Asymmetric,
    CrimpToe,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Tabulated,
    TensionOnly,
)

REFUSED = {
    "one point": (
        lambda: Tabulated([0.0], [0.0]),
        "a table needs at least two points, got 1",
    ),
    "falling": (
        lambda: Tabulated([0.0, 0.2, 0.1], [0.0, 1.0, 2.0]),
        "point 3: 0.1 comes after 0.2; the first column must increase",
    ),
    "twice": (lambda: Tabulated([0, 0.1, 0.1], [0, 1, 2]), "point 3: 0.1 comes after"),
    "not finite": (
        lambda: Tabulated([0.0, 0.1], [0.0, np.nan]),
        "point 2: 0.1, nan are not finite numbers",
    ),
    "of two lengths": (
        lambda: Tabulated([0.0, 0.1], [0.0]),
        r"two rows of as many numbers, got shapes \(2,\) and \(1,\)",
    ),
    "text": (lambda: Tabulated("ab", [0.0]), "arguments must be real numbers"),
    "another extrapolation": (
        lambda: Tabulated([0, 1], [0, 1], "cubic"),
        "extrapolation must be refuse or linear, got 'cubic'",
    ),
    "odd of both signs": (
        lambda: Tabulated([-1, 1], [0, 1], odd=True),
        "an odd law is given for arguments >= 0 and .* but point 1 is -1, 0",
    ),
    "odd with a jump": (
        lambda: Tabulated([0, 1], [0.5, 1], odd=True),
        "vanishes at 0, but point 1 is 0, 0.5",
    ),
    "without rest": (
        lambda: Tabulated([0.1, 1], [0.5, 1]),
        "the table goes from 0.1 to 1 and leaves out 0, where the ply is at rest",
    ),
    "too steep": (
        lambda: Tabulated([0, 1e-300], [0, 1e300]),
        "the table rises faster than numbers go",
    ),
    "no coefficient": (lambda: Polynomial(()), "coefficients must be finite numbers"),
    "one that is none": (lambda: Polynomial((1, "a")), "coefficients must be finite"),
    "a number": (lambda: Polynomial(3.0), "coefficients must be finite numbers"),
    "no toe": (
        lambda: CrimpToe(1e5, 0.0, 1.0),
        "toe must be a finite number > 0, got 0.0",
    ),
    "negative": (
        lambda: CrimpToe(1e5, 0.1, -1.0),
        "initial stiffness must be a finite number >= 0, got -1.0",
    ),
    "no angle": (
        lambda: Locking(0.5, None),
        "locking angle must be a finite number > 0, got None",
    ),
    "no width": (
        lambda: TensionOnly(Linear(1.0), 0.0),
        "width must be a finite number > 0, got 0.0",
    ),
    "force at rest": (
        lambda: TensionOnly(Pretensioned(Linear(1e3), 3.0)),
        "law must vanish at rest, but is 3 N/mm there",
    ),
    "wider than the law": (
        lambda: TensionOnly(Tabulated([0, 0.01], [0, 1]), 0.02),
        "law must hold from 0 to the switch at 0.02, but its domain is 0 to 0.01",
    ),
    "compression without a law": (
        lambda: Asymmetric(Linear(1.0), Tabulated([0, 0.01], [0, 1])),
        "compression must hold from 0 to the switch at -0.0001",
    ),
    "no law": (
        lambda: TensionOnly(3.0),
        r"law must be a law, such as Linear\(5e3\), got 3.0",
    ),
    "by element": (
        lambda: TensionOnly(Linear(np.ones(3))),
        "law must be the same law in every element; give each subdomain a fabric",
    ),
    "a tension out of reach": (
        lambda: Pretensioned(Tabulated([0, 0.01], [0, 2]), 3.0),
        "the law has only 2 N/mm at a strain of 0.01, less than the pretension 3",
    ),
    "in tension already": (
        lambda: Pretensioned(Tabulated([0, 0.01], [1, 2]), 0.5),
        "the law has 1 N/mm at rest, more than the pretension 0.5",
    ),
}


@pytest.mark.parametrize(("build", "message"), REFUSED.values(), ids=REFUSED)
def test_parameters_that_make_no_law_are_refused_in_one_line(build, message):
    with pytest.raises(ValueError, match=message) as refusal:
        build()
    assert "\n" not in str(refusal.value)
