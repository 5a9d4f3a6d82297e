from pathlib import Path

import numpy as np
import pytest

from studies.angles import cases as cases_of_angles
from studies.angles import study as angles
from studies.angles.cases import ACROSS, ANGLES
from studies.laws import study
from studies.laws.study import (
    LINEAR,
    QUADS,
    SPECIMEN,
    STUDY,
    TRIANGLES,
)

PUBLISHED = Path(__file__).parents[2] / "docs"


def test_the_shared_case_has_one_reference_and_one_limit_in_both_studies():
    """The stored loads of the linear law agree with the study of angles."""
    scene = SPECIMEN.scene(QUADS.mesh(16, 1))
    inextensible = scene.load(SPECIMEN.shear_law, 1.0)
    reference = cases_of_angles.stored()[SPECIMEN, ANGLES[-1]]["load"] * inextensible
    rows = STUDY.stored(PUBLISHED / "laws")
    assert study.converged(rows, LINEAR) == pytest.approx(reference, rel=2e-3)
    of_angles = angles.errors(angles.COMPARED.read(PUBLISHED / "angles"))
    for method, elements in ((QUADS, "quads"), (TRIANGLES, "triangles")):
        for across in ACROSS:
            here = study.errors(rows, LINEAR, method, across)
            stored = of_angles[SPECIMEN, ANGLES[-1], elements, across]
            np.testing.assert_allclose(here, stored, atol=1e-5)
            limit = 100 * cases_of_angles.limit(SPECIMEN.inclination, across)
            assert f"within {limit:g} %" in study.judged(rows)
