"""Pictures compared with stored ones, in a measure sensitive to wrong colour scales.

As a script it redraws the stored pictures.
"""

from pathlib import Path

import numpy as np
import pytest

from skfem_textile import StepError
from tests.helpers.pictures import coloured
from tests.plot.conftest import of_strip

pv = pytest.importorskip("pyvista")
Image = pytest.importorskip("PIL.Image")
plot = pytest.importorskip("skfem_textile.plot")
lines = pytest.importorskip("skfem_textile.plot.sheet")

FOLDER = Path(__file__).parent / "references"

#: Width in pixels to which pictures are reduced, so that hinting of letters and
#: smoothing of edges, which differ between machines, hardly count.
WIDTH = 160

#: Largest mean difference, of 255, of the colours of two pictures that are the same.
#: Without the smoothing of edges the pictures differ by up to 1.5, those with thin
#: fibres most.  A scale that is longer by a fifth, or other colours, differ by at
#: least 2.1.
SAME = 1.8


def failed_run():
    text = "stopped at load factor 1: folded"
    return StepError(text, of_strip()[0], np.array([3, 7]))


DRAWN = {
    "fibre_strain": lambda **how: plot.fibre_strain(of_strip()[0], **how),
    "shear_angle": lambda **how: plot.shear_angle(*of_strip(), **how),
    "verdict": lambda **how: plot.verdict(failed_run(), of_strip()[1], **how),
    "contact_sheet": lambda **how: plot.contact_sheet(*of_strip(), **how),
    "fibre_directions": lambda **how: plot.fibre_directions(*of_strip(), **how),
}


def reduced(pixels):
    """A picture of the width `WIDTH`, each pixel the mean of the pixels it covers."""
    image = Image.fromarray(pixels)
    height = round(image.height * WIDTH / image.width)
    return image.resize((WIDTH, height), Image.Resampling.BOX)


def difference(plotter, name):
    """The mean difference of the colours from the stored picture."""
    picture = reduced(plotter.screenshot(return_img=True))
    with Image.open(FOLDER / f"{name}.png") as stored:
        assert picture.size == stored.size
        both = [np.asarray(x.convert("RGB"), dtype=float) for x in (picture, stored)]
    return np.abs(both[0] - both[1]).mean()


@pytest.mark.parametrize("name", DRAWN)
def test_a_picture_agrees_with_the_stored_one(name):
    assert difference(DRAWN[name](), name) < SAME


def test_unsmoothed_edges_are_tolerated(monkeypatch):
    """Some machines cannot smooth them."""
    monkeypatch.setattr("pyvista.global_theme.multi_samples", 1)
    name = "fibre_directions"  # the thinnest lines
    assert difference(DRAWN[name](), name) < SAME


@pytest.mark.parametrize(
    ("name", "wrong"), [("fibre_strain", "longer"), ("verdict", "colours")]
)
def test_a_wrong_scale_is_detected(name, wrong):
    (((low, high), _),) = {*coloured(DRAWN[name]())}
    how = {"colours": {"cmap": "plasma"}, "longer": {"clim": (1.2 * low, 1.2 * high)}}
    assert difference(DRAWN[name](**how[wrong]), name) > SAME


def test_swapped_fibres_are_detected(monkeypatch):
    """The warp has the colour of the weft."""
    monkeypatch.setattr(lines, "WARP", lines.WEFT)
    name = "fibre_directions"
    assert difference(DRAWN[name](), name) > SAME


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, draw in DRAWN.items():
        reduced(draw().screenshot(return_img=True)).save(FOLDER / f"{name}.png")
