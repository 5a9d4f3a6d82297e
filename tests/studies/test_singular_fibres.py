"""Outlines drawn at random, a subset of the study."""

import pytest

from studies.singular_fibres.outlines import FAULTS, Drawn


@pytest.mark.parametrize("number", [1, 3, 5, 7, 11, 43, 65, 12])
def test_meshes_of_valid_outlines(number):
    """The area is exact, names are kept, and angles are at least 10° if they can be."""
    (row,) = Drawn(number).rows()
    assert row["refused"] == ""
    assert row["missing"] == ""
    assert row["circles"] or abs(row["area_error"]) < 1e-9
    assert row["kind"] == "net" or row["elsewhere"] > 10


@pytest.mark.parametrize("number", [9, 19, 29, 39])
def test_invalid_outlines_are_refused_with_the_place(number):
    """One line with coordinates."""
    drawn = Drawn(number)
    (row,) = drawn.rows()
    assert drawn.fault in FAULTS
    assert "\n" not in row["refused"]
    assert "(" in row["refused"]
