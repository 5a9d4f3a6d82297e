"""Pictures of results: colours, scales, titles, files, animations, load curves."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, Macro, Ply
from skfem_textile.fabric.directions import FibreDirections
from skfem_textile.io import read_fabric
from skfem_textile.mesh.splitting import split_cells
from skfem_textile.scenes import Case, buckling, strip
from tests.helpers.pictures import degrees_off

pv = pytest.importorskip("pyvista")
matplotlib = pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")
plot = pytest.importorskip("skfem_textile.plot")
shapes_of = pytest.importorskip("skfem_textile.plot.fields").shapes_of
Scale = pytest.importorskip("skfem_textile.plot.sheet").Scale
offscreen = pytest.importorskip("skfem_textile.plot.pyvista_drawing")
curves = pytest.importorskip("skfem_textile.plot.curves")


def test_strains_of_all_formulations_are_the_ones_that_enter_the_law(results, sheets):
    """Means of macro-elements, and strains at the points of other elements."""
    scene = strip(size=(3, 4))
    macro = Ply(scene.mesh, Fabric(1e4), Macro())
    both = LoadStepper(macro, scene.conditions, steps=4).run(), results[0]
    plot.fibre_strain(*both)
    ((drawn, _),) = sheets
    scale = drawn.legends[0].scale
    strains = np.concatenate([panel.values for panel in drawn.panels])
    assert 1.5 * strains.min() < scale.low <= strains.min() < 0
    assert strains.max() <= scale.high < 1.5 * strains.max()
    assert (scale.label, scale.signed) == ("Fibre strain (%)", True)
    for result, *families in zip(both, *drawn.rows, strict=True):
        for panel, strain in zip(
            families, result.ply.law_strain(result.u), strict=True
        ):
            largest = 100 * np.abs(strain).max(axis=-1)
            np.testing.assert_allclose(np.abs(panel.values), largest)
    largest = [np.abs(drawn.rows[0][i].values).max() for i in (0, 1)]
    assert largest[1] > 10 * largest[0]


@pytest.fixture(scope="module")
def arch():
    """A strip 100 mm × 25 mm that has buckled upwards."""
    scene = buckling(size=(6, 2))
    fabric = Fabric(1e5, 0.1, scene.warp, scene.weft, bending=(6.0, 6.0))
    return Case(scene=scene, fabric=fabric, steps=2).run()


def test_a_ply_in_space_is_drawn_in_perspective(arch):
    """Parallel edges converge, and elements are coloured where they are visible."""
    (shape,) = shapes_of([arch], arch.states[-1:])
    left, right = (
        np.flatnonzero(np.isclose(arch.ply.nodes[0], x)) for x in (0.0, 100.0)
    )
    far, near = (np.ptp(shape.points[at, :2], axis=0) for at in (left, right))
    assert abs(np.arctan2(*near) - np.arctan2(*far)) > 0.1
    assert np.ptp(shape.points[:, 1]) > 20
    plotter = plot.field(arch, field="displacement", clim=(0, 40))
    highest = shape.points[:, 2].argmax()
    element = np.flatnonzero((arch.ply.mesh.t == highest).any(axis=0))[:1]
    u = arch.ply.nodal(arch.u)
    moved = np.linalg.norm(u[:, arch.ply.mesh.t].mean(axis=1), axis=0)[element]
    expected = 255 * matplotlib.colormaps["cividis"](moved / 40)[:, :3]
    renderer, image = plotter.renderers[0], plotter.screenshot(return_img=True)
    renderer.SetWorldPoint(*shape.centres[element[0], :2], 0.0, 1.0)
    renderer.WorldToDisplay()
    column, row, _ = np.floor(renderer.GetDisplayPoint()).astype(int)
    np.testing.assert_allclose(image[-1 - row, column], expected[0], atol=3.0)


def test_vectors_of_a_ply_in_space_are_drawn_from_back_to_front(arch, tmp_path):
    figure = plot.field(arch, field="displacement", filename=tmp_path / "x.svg")
    faces = figure.axes[0].collections[0]
    assert len(faces.get_facecolors()) == arch.ply.mesh.nelements
    (shape,) = shapes_of([arch], arch.states[-1:])
    order = np.argsort(shape.centres[:, 2], kind="stable")
    x = np.array([path.vertices[:4, 0].mean() for path in faces.get_paths()])
    assert np.corrcoef(x, shape.centres[order, 0])[0, 1] > 0.999


def test_round_off_is_not_drawn_as_strain():
    assert Scale.of("Fibre strain (%)", (-1e-15, 1e-14), "RdBu_r").high > 1e-9


@pytest.mark.parametrize(("in_space", "used"), [(False, 0), (True, 2)])
def test_an_animation_has_a_frame_per_state_without_remains_of_others(
    results, arch, in_space, used, tmp_path, monkeypatch
):
    """The title is above the ply and the scale below, in space in one window.

    An animation of the states in reverse order has the same frames, except for the
    choice of the palette.
    """
    windows, new_plotter = [], offscreen.new_plotter
    monkeypatch.setattr(
        offscreen, "new_plotter", lambda *a: windows.append(a) or new_plotter(*a)
    )
    result = arch if in_space else results[0]
    forwards = replace(result, states=result.states[::2])
    backwards = replace(forwards, states=forwards.states[::-1])
    frames = []
    for result in (forwards, backwards):
        plot.animation(result, tmp_path / "motion.gif", size=40)
        with Image.open(tmp_path / "motion.gif") as moving:
            every = range(moving.n_frames)
            frames.append(
                [np.array(moving.seek(i) or moving.convert("L")) for i in every]
            )
    there, back = (np.array(one, dtype=float) for one in frames)
    assert len(windows) == used
    assert [p.name for p in tmp_path.iterdir()] == ["motion.gif"]
    assert np.abs(there - back[::-1]).mean() < 0.5
    assert np.abs(there - there[::-1]).mean() > 5
    assert len({frame.tobytes() for frame in there}) == len(forwards.states)
    for grey in there:
        assert (grey[:30] < 100).any()
        assert (grey[-50:] < 100).any()


def test_a_plotter_that_was_saved_is_drawn_into_again(results, tmp_path):
    """The second file is the same without the first one."""
    pixels = []
    for first in (tmp_path / "first.png", None):
        plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=(600, 400))
        for column, file in enumerate((first, tmp_path / "both.png")):
            plotter.subplot(0, column)
            plot.shear_angle(results[0], plotter=plotter, filename=file)
        with Image.open(tmp_path / "both.png") as picture:
            pixels.append(np.asarray(picture))
    np.testing.assert_array_equal(*pixels)


def test_load_curves_have_their_labels(tmp_path):
    lines = {"aligned": ([0, 1], [0, 2]), "irregular": ([0, 1], [0, 3])}
    figure = plot.curves({"Fig. 5": lines}, "mm", "N", tmp_path / "load.png")
    (axes,) = figure.axes
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()] == list(lines)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("mm", "N")
    pixels = pv.read(tmp_path / "load.png").point_data.active_scalars[:, :3]
    for line, colour in zip(axes.lines, curves.COLOURS, strict=False):
        assert line.get_color() == colour
        drawn = 255 * np.array(matplotlib.colors.to_rgb(colour))
        assert np.sum(np.abs(pixels - drawn).max(axis=1) < 2) > 500
    assert [line.get_ydata().tolist() for line in axes.lines] == [[0, 2], [0, 3]]


def test_a_band_with_two_ends_has_them_and_panels_may_share_their_axes():
    x, y, low, high = [0.0, 1.0], [0.0, 2.0], [0.0, 1.0], [0.0, 5.0]
    panels = {"mesh": {"run": (x, y, [0.0, 0.1])}, "fabric": {"run": (x, y, low, high)}}
    figure = plot.curves(panels, "mm", "N", same_scales=True)
    mesh, fabric = figure.axes
    corners = fabric.collections[0].get_paths()[0].vertices
    assert {(1.0, 1.0), (1.0, 5.0)} <= {tuple(map(float, one)) for one in corners}
    assert mesh.get_ylim() == fabric.get_ylim()
    labels = [one.get_text() for one in figure.legends[0].get_texts()]
    assert labels == ["run", "error interval", "samples of the fabric"]


@pytest.mark.parametrize(
    ("name", "titles", "lines"),
    [
        ("cao2008-plain-weave", ["Shear", "Tension (assumed)"], 10),
        ("farrell-woven-nylon", ["Shear", "Tension"], 1),
    ],
)
def test_the_laws_of_a_fabric_state_specimens_and_assumptions(name, titles, lines):
    found = read_fabric(name)
    shear, tension = plot.fabric_laws(found.fabric, found.origin).axes
    assert [shear.get_title(), tension.get_title()] == titles
    assert len(shear.lines) == lines  # of the specimens, and of the fabric
    assert len(shear.collections) == (lines > 1)  # the band


def test_a_half_width_is_drawn_as_a_band_in_the_colour_of_its_curve():
    half = np.array([0.0, 0.5, np.nan])
    lines = {"plain": ([0, 1, 2], [0, 2, 3]), "run": ([0, 1, 2], [0, 1, 2], half)}
    (axes,) = plot.curves({"": lines}, "mm", "N").axes
    (band,) = axes.collections
    assert matplotlib.colors.same_color(band.get_facecolor()[0, :3], curves.COLOURS[1])
    corners = np.concatenate([path.vertices for path in band.get_paths()])
    assert set(corners[corners[:, 0] == 1, 1]) == {0.5, 1.5}
    assert corners[:, 0].max() == 1  # without a half-width there is no band


def test_long_labels_of_load_curves_are_not_cut():
    """Three of them side by side would be wider than the figure."""
    lines = {f"{name} of two N/mm, glued": ([0, 1], [0, 1]) for name in "abc"}
    figure = plot.curves({"": lines}, "mm", "N")
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width


def test_titles_do_not_repeat_legends(results, sheets):
    one, moved = results[0], {"field": "displacement"}
    for picture, how in (
        (plot.field, moved),
        (plot.fibre_strain, {}),
        (plot.contact_sheet, {}),
        (plot.fibre_directions, {}),
    ):
        picture(one, **how)
        picture(one, titles=["mine"], **how)
    plot.field(*results, **moved)
    assert [[p.title for p in sheet.panels] for sheet, _ in sheets] == [
        [""],
        ["mine"],
        ["Warp", "Weft"],
        ["Warp, mine", "Weft, mine"],
        ["Warp", "Weft", ""],
        ["Warp, mine", "Weft, mine", "mine"],
        ["Fibre directions"],
        ["mine"],
        [result.ply.formulation.title for result in results],
    ]


def test_a_crash_of_vtk_is_survived(monkeypatch):
    monkeypatch.setattr(offscreen, "_DRAW", "import os; os.abort()")
    assert not offscreen._can_draw({})


def test_a_mesh_of_both_kinds_is_drawn_with_its_fibres_before_a_run(tmp_path):
    points = np.array([[0.0, 1, 2, 0, 1, 2], [0.0, 0, 0, 1, 1, 1]])
    quad, triangles = np.array([[0, 1, 4, 3]]).T, np.array([[1, 2, 4], [2, 5, 4]]).T
    mesh = split_cells(points, [quad, triangles])
    directions = FibreDirections.of_angles([0, 45, 90], [90, 135, 0])
    plotter = plot.mesh_and_fibres(mesh, directions)
    actors = plotter.renderers[0].actors.values()
    drawn = [actor.mapper.dataset for actor in actors if isinstance(actor, pv.Actor)]
    warp, _ = [x for x in drawn if isinstance(x, pv.PolyData)][-2:]
    ends = warp.points.reshape(-1, 2, 3)
    along, middle = ends[:, 1] - ends[:, 0], ends.mean(axis=1)
    above = middle[:, 0] + middle[:, 1] > 2  # the diagonal of the right square
    places = middle[:, 0] < 1, (middle[:, 0] > 1) & ~above, (middle[:, 0] > 1) & above
    for place, angle in zip(places, (0, 45, 90), strict=True):
        assert place.any()
        assert degrees_off(along[place].T, angle).max() < 0.1
    plot.mesh_and_fibres(mesh, directions, tmp_path / "mesh.png")
    assert (tmp_path / "mesh.png").exists()
    pictures = []
    for edges in (True, False):
        plotter = pv.Plotter(off_screen=True, window_size=(300, 300))
        options = {"plotter": plotter, "show_edges": edges}
        assert plot.mesh_and_fibres(mesh, directions, **options) is plotter
        pictures.append(plotter.screenshot(return_img=True).tobytes())
    assert pictures[0] != pictures[1]


@pytest.mark.parametrize(
    ("domain", "ends"),
    [
        ((-np.inf, np.inf), (-0.5, 0.5)),
        ((1.0, np.inf), (1.0, 2.0)),
        ((-np.inf, -1.0), (-2.0, -1.0)),
        ((-0.2, 0.3), (-0.2, 0.3)),
    ],
)
def test_a_law_is_drawn_over_the_finite_part_of_its_domain(domain, ends):
    law = SimpleNamespace(domain=domain)
    assert curves._ends(law, 0.5) == ends
