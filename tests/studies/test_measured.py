"""Published measurements: what the files contain, and the stored predictions."""

from pathlib import Path

import numpy as np
import pytest

from skfem_textile.cases import case_from_file
from studies.common.tables import having
from studies.measured import angle, normalised, published
from studies.measured.published import BIAS, DATA, FABRICS, FRAMES
from studies.measured.study import STUDY

STORED = STUDY.stored(Path(__file__).parents[2] / "docs" / "measured")


def test_every_file_begins_with_its_source():
    files = sorted(DATA.rglob("*.csv"))
    for lines in published.sources().values():
        assert any(line.startswith("# Source: ") for line in lines) or not lines
    without = [name for name, lines in published.sources().items() if not lines]
    assert len(files) == 10
    assert without == ["shear.csv"]  # a law of comfor_hemisphere, which has a source


def test_all_curves_of_the_benchmark_are_predicted():
    bias, frames = (
        [c.name for f in FABRICS for c in published.of_fabric(f, test)]
        for test in (BIAS, FRAMES)
    )
    assert (len(bias), len(frames)) == (18, 15)
    for test, law, n in ((BIAS, FRAMES, 18), (BIAS, BIAS, 18), (FRAMES, BIAS, 15)):
        rows = having(STORED, test=test, law=law)
        assert len({(row["fabric"], row["name"]) for row in rows}) == n


def test_a_picture_frame_is_converted_to_its_force_and_back():
    curve = published.of_fabric("plain", FRAMES)[2]
    gamma, force = np.radians(curve.x), curve.specimen.force
    assert curve.test.normalised(gamma, force) == pytest.approx(curve.y)
    assert curve.specimen.angle == pytest.approx(gamma)


def test_the_net_of_the_library_has_the_published_theoretical_angle():
    data = published.columns("cao2008/shear_angle_150x450.csv")
    theory = np.degrees(angle.TEST.shear_angle(data["displacement_mm"]))
    assert theory == pytest.approx(data["pin_jointed_deg"], abs=0.05)


def test_normalised_forces_exceed_the_limit_of_their_formula():
    rows = normalised.Normalised("plain").rows()
    assert rows
    assert all(row["factor"] > row["limit"] for row in rows)


def test_forces_of_figure_40_exceed_figure_38_increasingly():
    rows = [row for row in STORED if "fig_38" in row]
    ratios = [row["20C_10mm_per_min"] / row["fig_38"] for row in rows]
    assert ratios == sorted(ratios)
    assert (ratios[0], ratios[-1]) == pytest.approx((1.42, 3.17), abs=0.01)


def test_slip_begins_within_five_degrees_of_the_departure_less_slack():
    rows = [row for row in STORED if row.get("density") == 4]
    found, first = angle.departures(rows), angle.onset(rows, "max_slip_index", 1.0)
    assert abs(first - found.net) < 5
    assert abs(first - found.model) < 5
    assert abs(first - found.raw) > 5  # as the page states


@pytest.mark.slow
def test_the_case_of_the_hemisphere_is_built():
    case = case_from_file(DATA / "comfor_hemisphere" / "hemisphere.toml")
    moments = case.fabric.shear_law.value(np.radians([10.0, 20.0, 30.0, 40.0]))
    assert moments == pytest.approx([0.0073, 0.0183, 0.0327, 0.0452], abs=1e-4)
