"""Options of pictures: plotters, colours, limits, states, formats, and rejections."""

import re
from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import StepError
from tests.helpers.pictures import coloured

pv = pytest.importorskip("pyvista")
matplotlib = pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")
plot = pytest.importorskip("skfem_textile.plot")
drawing = pytest.importorskip("skfem_textile.plot.drawing")
sheet = pytest.importorskip("skfem_textile.plot.sheet")


def test_panels_are_drawn_from_the_active_subplot_on_with_a_given_scale(result):
    plotter = pv.Plotter(off_screen=True, shape=(2, 2), window_size=(600, 600))
    for place, results in (((0, 1), [result]), ((1, 0), [result] * 2)):
        plotter.subplot(*place)
        how = {"clim": (0, 40), "cmap": "magma", "plotter": plotter}
        assert plot.shear_angle(*results, state=1, **how) is plotter
    assert coloured(plotter) == [((0.0, 40.0), "magma")] * 3
    assert [len(r.actors) > 5 for r in plotter.renderers] == [False, True, True, True]


def test_several_results_share_one_scale_that_holds_all_values(result):
    less = replace(result, states=result.states[:3])
    both = coloured(plot.shear_angle(less, result))
    assert both[0] == both[1] == coloured(plot.shear_angle(result))[0]
    assert coloured(plot.shear_angle(less)) != both[:1]
    ((low, high), _), _ = both
    largest = np.degrees(result.ply.shear_angle(result.u)).max()
    assert low <= 0 < largest <= high < 1.5 * largest


def test_a_state_is_drawn_in_its_deformed_shape(result, sheets):
    plot.field(result, field="displacement", state=1)
    ((drawn, _),) = sheets
    u = result.ply.nodal(result.states[1].u)
    np.testing.assert_allclose(
        drawn.panels[0].shape.points[:, :2], (result.ply.mesh.p + u).T, atol=1e-12
    )
    mean = u[:, result.ply.mesh.t].mean(axis=1)
    np.testing.assert_allclose(drawn.panels[0].values, np.hypot(*mean), atol=1e-12)


def test_values_beyond_the_limits_have_arrows(result, sheets):
    for clim, ends in (((5, 30), (3, 3)), ((0, 30), (0, 3)), ((-1, 90), (0, 0))):
        plot.shear_angle(result, clim=clim)
        (bar,) = sheets[-1][1].legends[0].bars
        assert tuple(map(len, bar.tips)) == ends


@pytest.mark.parametrize(
    "suffix",
    [
        *("svg", "pdf"),
        pytest.param("eps", marks=pytest.mark.dear("the only EPS that is written")),
    ],
)
def test_vector_files_contain_vectors(result, tmp_path, suffix):
    file = tmp_path / f"x.{suffix}"
    figure = plot.shear_angle(result, filename=file)
    assert isinstance(figure, matplotlib.figure.Figure)
    begins = {"svg": b"<?xml", "pdf": b"%PDF", "eps": b"%!PS-Adobe-3.0 EPSF"}
    written = file.read_bytes()
    assert written.startswith(begins[suffix])
    assert b"<image" not in written
    assert b"/Subtype /Image" not in written
    assert [p.name for p in tmp_path.iterdir()] == [file.name]


def test_colours_of_vectors_and_pixels_agree(result, tmp_path):
    plot.shear_angle(result, filename=tmp_path / "pixels.png", show_edges=False)
    figure = plot.shear_angle(result, filename=tmp_path / "x.svg", show_edges=False)
    figure.savefig(tmp_path / "vectors.png", dpi=150)
    pixels, vectors = (
        np.asarray(Image.open(tmp_path / name).convert("RGB").resize((100, 90)), int)
        for name in ("pixels.png", "vectors.png")
    )
    assert np.abs(pixels - vectors).mean() < 4
    assert (np.abs(pixels - vectors).max(axis=-1) > 60).mean() < 0.02


def test_the_picture_of_a_failure_shows_reason_and_position(result, sheets):
    error = StepError("stopped at load factor 0.5: folded", result, np.array([3, 7]))
    plot.verdict(error)
    ((drawn, _),) = sheets
    (panel,) = drawn.panels
    assert panel.title == str(error)
    assert panel.marked.tolist() == [3, 7]
    assert drawn.legends[0].keys == [
        ("Elements where the step was rejected", "#E6007E")
    ]
    least = result.ply.least_area_ratio(result.u)
    np.testing.assert_allclose(panel.values, least)


@pytest.mark.parametrize("quantity", ["shear_angle", "weft_strain"])
def test_the_argument_at_the_end_of_a_law_is_shown(result, sheets, quantity):
    error = StepError("stopped", result, np.array([3, 7]), quantity)
    plot.verdict(result, error)
    drawn = sheets[0][0]
    assert drawn.legends[0].scale.label == plot.FIELDS[quantity].label
    assert [panel.marked.tolist() for panel in drawn.panels] == [[], [3, 7]]
    plot.verdict(error, field="displacement")
    assert sheets[1][0].legends[0].scale.label == "Displacement (mm)"


def test_a_verdict_is_written_in_words(result, sheets):
    plot.verdict(result)
    verdict = result.states[-1].verdict
    title = sheets[0][0].panels[0].title
    assert title.startswith("Load factor 1: stable, smallest area ratio ")
    assert f"{verdict.min_det_F:.3g}" in title
    assert sheets[0][0].legends[0].keys == []


def test_any_field_is_animated_on_one_scale(result, tmp_path):
    number = plot.Field("State (-)", lambda ply, u: np.full(12, np.abs(u).max()))
    file = tmp_path / "x.gif"
    plot.animation(result, file, field=number, cmap="gray", clim=(0, 100), size=40)
    with Image.open(file) as moving:
        assert moving.n_frames == 5
        assert moving.size[0] == round(40 / 25.4 * 150)
        for i, state in enumerate(result.states):
            moving.seek(i)
            grey = np.asarray(moving.convert("L"), float)
            expected = 255 * np.abs(state.u).max() / 100
            assert (np.abs(grey - expected) < 3).sum() > 0.1 * grey.size


def greys(scale, values):
    """Grey levels in which values are printed (ITU-R BT.601)."""
    share = (np.asarray(values) - scale.low) / (scale.high - scale.low)
    return scale.colours(share)[:, :3] @ [0.299, 0.587, 0.114]


@pytest.mark.parametrize("name", plot.FIELDS)
def test_fields_are_legible_in_grey_and_zero_is_marked_if_they_have_a_sign(
    result, sheets, name
):
    """Magnitudes have one order of greys; zero is the lightest if there is a sign."""
    plot.field(result, field=name)
    label = sheets[0][0].legends[0].scale.label
    assert label == plot.FIELDS[name].label
    unitless = label == "Area relative to initial area"
    assert unitless or re.search(r"\((°|%|N/mm|mm)\)$", label)
    (bar,) = sheets[0][1].legends[0].bars
    scale = bar.scale
    down, up = np.linspace(0, scale.low, 60), np.linspace(0, scale.high, 60)
    if plot.FIELDS[name].signed:
        (mark,) = bar.zero
        share = (mark.x + 0.5 * mark.width - bar.box.x) / bar.box.width
        assert scale.low + share * (scale.high - scale.low) == pytest.approx(0.0)
        below, above = bar.box.y - mark.y, mark.y + mark.height - bar.box.y
        assert 0 < below == pytest.approx(above - bar.box.height)
        assert greys(scale, [0.0]) > 0.95
        assert all((np.diff(greys(scale, x)) <= 0.004).all() for x in (down, up))
    else:
        assert bar.zero == []
        assert (np.diff(greys(scale, up)) >= -0.004).all()


def test_values_of_equal_size_have_equally_strong_colours(result):
    """Where one sign reaches further than the other."""
    scale = sheet.Scale.of("x", (-10.0, 40.0), "RdBu_r", None, signed=True)
    assert (scale.low, scale.high) == (-10.0, 40.0)
    weak, strong = greys(scale, [-10.0, 10.0])
    assert weak == pytest.approx(strong, abs=0.05)
    assert greys(scale, [40.0]) < weak - 0.3


def test_a_given_colour_map_is_used_as_a_whole(result):
    (_, name), *_ = coloured(plot.shear_angle(result, cmap="magma", clim=(0, 40)))
    assert name == "magma"
    of = plot.fields.scale_of(plot.FIELDS["shear_angle"], [np.ones(1)], "magma", (0, 4))
    assert of.colours(0.0) == matplotlib.colormaps["magma"](0.0)
    assert not of.signed
