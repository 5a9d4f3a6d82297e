"""Pictures of formed plies: tools where they stand, sections and forces."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, Ply, Result, Tool, drape
from skfem_textile.contact import (
    Phase,
    Process,
    box_of,
    placed_tools,
    tool_forces,
    tool_history,
    travels,
)
from skfem_textile.drape import Axes
from tests.helpers.forming import GAP, RADIUS, SIDE, SYMMETRY, blank

plot = pytest.importorskip("skfem_textile.plot")
pytest.importorskip("pyvista")
Figure = pytest.importorskip("matplotlib.figure").Figure
Image = pytest.importorskip("PIL.Image")
shapes_of = pytest.importorskip("skfem_textile.plot.fields").shapes_of
stage_of = pytest.importorskip("skfem_textile.plot.pictures").stage_of
fields = pytest.importorskip("skfem_textile.plot.fields")


@pytest.fixture(autouse=True, scope="module")
def coarse():
    """Tools of few triangles, which take little time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(placed_tools, "__defaults__", (12,))
        yield


@pytest.fixture
def without_tools(hemisphere):
    ply = Ply(hemisphere.ply.mesh, Fabric(1.0, 0.1), dimension=3)
    return Result.of_state(ply, {}, hemisphere.states[0])


def shares(path):
    """Shares of pixels with a colour and with a grey of tools."""
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    spread = np.ptp(pixels, axis=2)
    grey = (spread < 3) & (pixels[..., 0] > 130) & (pixels[..., 0] < 240)
    return (spread > 30).mean(), grey.mean()


@pytest.mark.dear("the first picture of pixels, which imports pyvista")
def test_ply_and_tools_are_drawn_in_three_panels(hemisphere, tmp_path, monkeypatch):
    plot.formed(hemisphere, filename=tmp_path / "formed.png")
    coloured, grey = shares(tmp_path / "formed.png")
    assert coloured > 0.09
    assert grey > 0.05
    monkeypatch.setattr(Figure, "savefig", lambda _, file, **__: file.touch())
    figure = plot.formed(hemisphere, titles=["A"], filename=tmp_path / "formed.pdf")
    words = [text.get_text() for text in figure.axes[0].texts]
    for word in ("Shear angle (°)", "Warp", "Weft"):
        assert word in words
    assert " ".join(words).count("A, load factor 1.00, punch 15.0 mm") == 3
    assert "0" in words  # of the shear angle only
    assert words.count("0") == 1


@pytest.mark.dear("a picture of tools, and a run between tools")
def test_phases_are_drawn_at_their_ends(tmp_path, monkeypatch):
    """Two in a row, with the travels there; of a stopped run also its last state."""
    monkeypatch.setattr(Figure, "savefig", lambda _, file, **__: file.touch())
    punch = Tool(drape.Sphere(RADIUS, (0, 0, -RADIUS)), name="punch")
    phases = [Phase(x, 1, {"punch": {"motion": (0, 0, z)}}) for x, z in HEIGHTS.items()]
    process = Process(phases, [punch])
    run = LoadStepper(blank(2, terms=process.tools), EDGES, process.steps)
    result = run.run()
    for part, seen in (result, 3), (replace(result, states=result.states[:3]), 2):
        figure = plot.phases(part, process, filename=tmp_path / "phases.pdf")
        words = " ".join(text.get_text() for text in figure.axes[0].texts)
        titles = [f"{x}: punch {z:.1f} mm" for x, z in HEIGHTS.items()]
        assert [title in words for title in titles] == [True] * seen + [False] * (
            3 - seen
        )
    nothing = replace(result, states=result.states[:1])
    with pytest.raises(ValueError, match="no load step was completed"):
        plot.phases(nothing, process)
    of_clamps = lambda _, at: {"grip_force_N": at.load_factor}  # noqa: E731
    monkeypatch.setattr(type(result), "clamp_forces", of_clamps)
    panels = plot.tool_force(result, process=process).axes
    assert [axes.get_title() for axes in panels] == [*HEIGHTS]
    assert [x.get_label() for x in panels[2].lines] == ["punch", "grip"]
    assert panels[2].lines[0].get_xdata() == pytest.approx([3.0, 2.0])
    assert panels[2].lines[1].get_ydata() == pytest.approx([2 / 3, 1.0])
    sections = plot.section(result, states=process.at_ends(result)).axes
    titles = [axes.get_title().partition(", ")[2] for axes in sections]
    assert titles == [f"punch {z:.1f} mm" for z in HEIGHTS.values()]


#: Travel of the punch in mm at the end of each phase.
HEIGHTS = {"touch": 1.0, "up": 3.0, "down": 2.0}

EDGES = {name: Condition(name) for name in ("right", "top")} | SYMMETRY


def test_every_picture_has_the_travel(hemisphere, tmp_path, monkeypatch):
    """Also of a state in the middle, and beside the names of formulations."""
    monkeypatch.setattr(Figure, "savefig", lambda _, file, **__: file.touch())
    stage = "oad factor 0.67, punch 10.0 mm"
    for picture, results, titles in (
        (plot.fibre_strain, 1, [f"Warp, l{stage}", f"Weft, l{stage}"]),
        (plot.fibre_directions, 1, [f"Fibre directions, l{stage}"]),
        (plot.field, 2, [f"macro-elements, l{stage}"] * 2),
    ):
        file = tmp_path / f"{picture.__name__}.pdf"
        figure = picture(*[hemisphere] * results, state=2, size=400, filename=file)
        words = " ".join(text.get_text() for text in figure.axes[0].texts)
        for title in set(titles):
            assert words.count(title) == titles.count(title), (picture, words)


def test_a_tool_that_returns_has_its_travel_in_every_title():
    """At the end of the run it is where it began."""
    result = of_table(lambda t: (0.0, 0.0, 4 * t * (t - 1)))
    titles = [stage_of(result, state) for state in result.states]
    assert titles[-1] == "Load factor 1.00, table 0.0 mm"
    assert titles[1] == "Load factor 0.50, table 1.0 mm"


def test_a_tool_that_only_turns_has_its_angle(tmp_path):
    def turned(t):
        c, s = np.cos(0.2 * t), np.sin(0.2 * t)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.zeros(3)

    result = of_table(turned)
    titles = [stage_of(result, state) for state in result.states]
    assert titles[1:] == [
        "Load factor 0.50, table 5.7°",
        "Load factor 1.00, table 11.5°",
    ]
    head, *rows = str(result).splitlines()
    assert "table (°)" in head
    assert [row.split()[1] for row in rows[:3]] == ["0.00", "5.73", "11.46"]
    degrees = tool_history(result)["table_rotation_deg"]
    assert degrees == pytest.approx(np.degrees([0.0, 0.1, 0.2]), abs=1e-12)


def of_table(motion):
    """A ply above a table that moves, at three load factors."""
    x = np.linspace(0, SIDE, 3)
    table = Tool(drape.Plane(), motion=motion, side=1, name="table")
    mesh = MeshQuad.init_tensor(x, x)
    ply = Ply(mesh, Fabric(1.0, 0.1), terms=[table], dimension=3)
    clamp = {"all": Condition(lambda X: X[0] >= 0)}
    return LoadStepper(ply, clamp, steps=2).run()


def of_tools(result):
    """True for each tool that is drawn in the last state, by name."""
    box = box_of(result.ply, [result.states[-1]])
    (placed,) = placed_tools(result.ply, result.states[-1:], *box)
    return {tool.name: fields._faces_viewer(tool) for tool in placed}


def test_only_faces_towards_the_viewer_are_drawn(hemisphere):
    """The die above the ply faces down and hides nothing; the holder faces up."""
    (shape,) = shapes_of([hemisphere], [hemisphere.states[-1]])
    names = {name for name, drawn in of_tools(hemisphere).items() if drawn}
    assert names == {"punch", "holder"}
    x, y = shape.tool.points.T[:2, shape.tool.triangles]
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    assert (area > 0).all()
    assert 50 < area.size == shape.tool.shades.size


def test_tools_move_in_a_box_that_stays(hemisphere):
    """Of all frames of an animation."""
    states = hemisphere.states
    shapes = shapes_of([hemisphere] * len(states), states)
    tops = [shape.tool.points[:, 1].max() for shape in shapes]
    assert np.ptp([shape.tool.points[:, 0].min() for shape in shapes]) < 2.0
    assert len(tops) == len(states)


def test_an_animation_has_a_frame_per_state(hemisphere, tmp_path):
    result = replace(hemisphere, states=hemisphere.states[::3])
    plot.animation(result, tmp_path / "a.gif", size=60)
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == len(result.states)
    titles = [stage_of(hemisphere, state) for state in hemisphere.states]
    assert titles[0] == "Load factor 0.00, punch 0.0 mm"
    assert titles[-1] == "Load factor 1.00, punch 15.0 mm"


def lines_of(axes):
    """Ends of all lines of the ply in a section, shape (n, 2)."""
    return np.vstack(axes.collections[-1].get_segments())


def test_a_section_cuts_the_ply_on_the_plane(hemisphere, tmp_path):
    """From the top of the punch to the edge of the ply, on the punch and the plate."""
    angle = np.pi / 4
    file = tmp_path / "section.png"
    (axes,) = plot.section(hemisphere, file, angle=angle, states=[-1]).axes
    assert file.stat().st_size > 1000
    ends = lines_of(axes)
    ply, u = hemisphere.ply, hemisphere.u
    x = ply.positions(u)
    on = np.isclose(ply.nodes[1], np.tan(angle) * ply.nodes[0])
    reach = np.hypot(*x[:2, on]).max()
    assert ends[:, 0].max() == pytest.approx(reach)
    assert ends[:, 0].min() == pytest.approx(0.0, abs=1e-9)
    assert ends[:, 1].max() == pytest.approx(x[2].max(), abs=0.01)
    from_centre = np.hypot(ends[:, 0], ends[:, 1] - (15.0 - RADIUS - GAP / 2))
    assert from_centre.min() > RADIUS - 0.3
    assert axes.get_title() == "Load factor 1.00, punch 15.0 mm"


def test_a_section_is_in_the_axes_of_the_tools(hemisphere):
    x = np.linspace(0, SIDE, 3)
    mesh = MeshQuad.init_tensor(x, x)
    moved = Axes(np.array([5.0, 6.0, 500.0])).of_tool
    table = Tool(drape.Plane((0, 0, -1)), stated=moved)
    ply = Ply(mesh, Fabric(1.0, 0.1), terms=[table], dimension=3)
    result = Result.of_state(
        ply, {}, replace(hemisphere.states[0], u=ply.basis.zeros())
    )
    for angle, first in ((0.0, 5.0), (0.5, 0.0)):
        (axes,) = plot.section(result, angle=angle).axes
        ends = lines_of(axes)
        assert ends[:, 1] == pytest.approx(500.0)
        assert ends[:, 0].min() == pytest.approx(first)
        face = np.vstack(axes.collections[1].get_segments())
        assert face[:, 1] == pytest.approx(499.0)
        assert axes.get_ylim()[0] < 499 < 500 < axes.get_ylim()[1]


def test_sections_show_the_process_in_steps(hemisphere):
    figure = plot.section(hemisphere)
    assert len(figure.axes) == 4
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["ply", "punch", "die", "holder"]
    span = np.ptp([figure.axes[0].get_xlim(), figure.axes[0].get_ylim()], axis=1)
    width, height = figure.get_size_inches()  # of two panels, and 1.2 of their labels
    assert height - 1.2 == pytest.approx(width * span[1] / span[0])


def test_forces_are_drawn_over_the_travel(hemisphere, tmp_path):
    figure = plot.tool_force(hemisphere, tmp_path / "force.png")
    (axes,) = figure.axes
    forces = tool_forces(hemisphere)
    assert [line.get_label() for line in axes.lines] == list(forces)
    for line in axes.lines:
        assert line.get_xdata() == pytest.approx(travels(hemisphere)["punch"])
        assert line.get_ydata() == pytest.approx(forces[line.get_label()])
    assert axes.get_xlabel() == "Travel of punch (mm)"
    figure.draw_without_rendering()
    label = axes.yaxis.label.get_window_extent()
    assert 0 <= label.y0 < label.y1 <= figure.bbox.height


def test_a_run_that_stopped_is_drawn_at_its_travel(stopped, tmp_path):
    result = stopped.result
    *_, axes = plot.section(result).axes
    assert axes.get_title() == "Load factor 0.50, punch 5.0 mm"
    highest = result.ply.positions(result.u)[2].max()
    assert lines_of(axes)[:, 1].max() == pytest.approx(highest, abs=0.01)
    assert highest == pytest.approx(5.0 - GAP / 2, abs=0.4)
    plot.verdict(stopped, filename=tmp_path / "refused.png")
    assert shares(tmp_path / "refused.png")[1] > 0.02


def test_a_ply_without_tools_is_refused(without_tools):
    for picture in (plot.formed, plot.section, plot.tool_force):
        with pytest.raises(ValueError, match="no tools between which it is formed"):
            picture(without_tools)
