"""The example for scikit-fem has the formulas of the forms, and their solution."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from skfem import Basis, ElementVector, asm

from skfem_textile import (
    CENTRE,
    Fabric,
    HourglassBasis,
    hourglass,
    quad_basis,
    shear,
    tension,
)

EXAMPLE = Path(__file__).parents[2] / "docs" / "reference" / "woven_fabric.py"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(EXAMPLE))


def test_residual_tangent_and_stabilisation_are_those_of_the_forms(example):
    fabric = Fabric(example["E"], example["G"], warp=(1, 1), weft=(-1, 1))
    mesh, u = example["mesh"], example["u"]
    basis = quad_basis(mesh, CENTRE)
    for part in ("residual", "tangent"):
        terms = [getattr(term(fabric), part) for term in (tension, shear)]
        ours = sum(asm(form, basis, u=u) for form in terms)
        theirs = asm(example[part], basis, u=u)
        # Round-off of fibre strains, with the stiffness E.
        assert np.max(abs(theirs - ours)) <= 1e-14 * example["E"] * np.max(abs(ours))
    forms, corners = hourglass(fabric, example["C"]), HourglassBasis(mesh)
    at_rest = asm(forms.tangent, corners, u=basis.zeros())
    assert np.max(abs(example["K_hg"] - at_rest)) <= 1e-12 * np.max(abs(at_rest))


def test_the_middle_shears_as_with_inextensible_fibres(example):
    fixed = 90 - 2 * np.degrees(np.arccos((1 + 15 / 50) / np.sqrt(2)))
    middle = np.abs(example["mesh"].p[1, example["mesh"].t].mean(axis=0) - 50) < 6
    assert abs(np.median(example["angle"][middle]) - fixed) < 0.5
    assert example["locked"] > 10 * example["load"]


def test_the_fluctuation_of_a_linear_displacement_is_zero_on_any_mesh(example):
    regular = example["mesh"]
    p, inside = regular.p.copy(), regular.interior_nodes()
    p[:, inside] += np.random.default_rng(1).uniform(-1, 1, (2, inside.size))
    element = ElementVector(example["Fluctuation"]())
    basis = Basis(type(regular)(p, regular.t), element, intorder=2)
    linear = basis.zeros()
    linear[basis.nodal_dofs] = 0.1 * p[::-1]
    assert np.abs(basis.interpolate(linear).grad).max() < 1e-13
