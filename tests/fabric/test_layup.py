"""Lay-ups in the usual notation, and fabrics that are turned."""

from functools import partial

import numpy as np
import pytest

from skfem_textile import Fabric
from skfem_textile.fabric.directions import AlongCurve
from skfem_textile.fabric.layup import layup_angles_deg, turned
from skfem_textile.fabric.regions import RegionalDirection
from tests.helpers import refused


@pytest.mark.parametrize(
    ("text", "angles"),
    [
        ("[0/90, ±45]s", (0, 45, 45, 0)),
        ("[0/90, ±45]2s", (0, 45, 0, 45, 45, 0, 45, 0)),
        ("[0/90,+-45]2", (0, 45, 0, 45)),
        (" [ 30 , 30/120, -45/45 , 90/0, 45/-45 ] ", (30, 30, -45, 90, 45)),
        ("[−22.5, .5, 10°/100°]S", (-22.5, 0.5, 10, 10, 0.5, -22.5)),
        ("[-0/90]", (0,)),
    ],
)
def test_a_lay_up_lists_the_warp_of_each_ply_from_the_bottom(text, angles):
    assert layup_angles_deg(text) == angles


def test_two_angles_of_a_ply_agree_with_the_fabric():
    assert layup_angles_deg("[0/60, 30/-90, -30/30]", 60) == (0, 30, -30)
    text = "'0/90' with 90° from warp to weft, but the fabric has 60°"
    refused(lambda: layup_angles_deg("[0/60, 0/90]", 60), text)
    text = "'±30' with 120° from warp to weft, but the fabric has 90°"
    refused(lambda: layup_angles_deg("[±30]"), text)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("0/90, ±45", "has no plies in one pair of brackets"),
        ("[0/90], [45]", "ends with ', [45]'"),
        ("", "has no plies in one pair of brackets"),
        ("[]", "has a ply '', which is neither an angle"),
        ("[0/90,]", "has a ply '', which is neither an angle"),
        ("[0/90, 45]x", "ends with 'x', which is neither s nor a number"),
        ("[0/90]0s", "ends with '0s'"),
        ("[0/90]s2", "ends with 's2'"),
        ("[0/90, warp]", "has a ply 'warp'"),
        ("[0/45/90]", "has a ply '0/45/90'"),
        ("[±-45]", "has a ply '±-45'"),
        ("[٣]", "has a ply '٣'"),
        ("[nan]", "has a ply 'nan'"),
        ("[0\n/inf]", "n/inf', which is neither an angle"),
        ("[1e3]", "has a ply '1e3'"),
        (None, "'None' has no plies"),
    ],
)
def test_an_unreadable_lay_up_is_refused_with_its_part(text, part):
    with pytest.raises(ValueError, match="the lay-up") as error:
        layup_angles_deg(text)
    message = str(error.value)
    assert part in message
    assert "\n" not in message
    assert message.endswith("a lay-up is written as '[0/90, ±45]s'")


def test_the_size_of_a_lay_up_and_of_its_angles_is_limited():
    assert len(layup_angles_deg("[0, 36000]50s")) == 200
    refused(lambda: layup_angles_deg("[0]201"), "has 201 plies, more than 200")
    text = "'36001': angles must be within ±36000°"
    refused(lambda: layup_angles_deg("[36001]"), text)


def test_a_fabric_turns_by_exact_right_angles():
    fabric = turned(Fabric(warp=(2, 0), weft=(0, 1)), 90)
    assert fabric.warp.tolist() == [0, 2]
    assert fabric.weft.tolist() == [-1, 0]


def rays(x, centre):
    return x - np.reshape(centre, (2,) + (1,) * (x.ndim - 1))


ARC = AlongCurve(np.array([[0.0, 10.0, 20.0], [0.0, 0.0, 10.0]]))


@pytest.mark.parametrize(
    "warp",
    [
        (1.0, 2.0),
        np.array([[1.0, 2.0, 3.0], [0.0, 1.0, -1.0]]),
        partial(rays, centre=(-5, -7)),
        ARC,
        RegionalDirection([(1.0, 0.5), ARC], np.array([0, 1, 0])),
    ],
    ids=["vector", "per element", "function", "along a curve", "regions"],
)
def test_every_kind_of_direction_turns_at_its_points(warp):
    fabric = Fabric(1e3, 0.1, warp=warp, weft=(-1.0, 0.7), bending=(1.0, 2.0))
    x = np.random.default_rng(1).random((2, 3, 4))
    element = np.arange(3)[:, None]
    before, after = (f.directions(x, element) for f in (fabric, turned(fabric, 30)))
    for A, B in zip(before, after, strict=True):
        A, B = np.broadcast_arrays(A, B)
        angle = np.arctan2(A[0] * B[1] - A[1] * B[0], (A * B).sum(axis=0))
        assert np.degrees(angle) == pytest.approx(30)
    assert turned(fabric, 30).bending == fabric.bending


def test_an_angle_that_is_not_finite_is_refused():
    refused(lambda: turned(Fabric(), np.nan), "angles must be finite")
