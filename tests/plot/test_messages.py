"""Messages about pictures that cannot be drawn."""

import re
from functools import partial

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Outline
from skfem_textile.fabric.directions import FibreDirections
from skfem_textile.mesh import requirements
from tests.helpers import refused
from tests.plot.conftest import own

pv = pytest.importorskip("pyvista")
plot = pytest.importorskip("skfem_textile.plot")
pictures = pytest.importorskip("skfem_textile.plot.pictures")
offscreen = pytest.importorskip("skfem_textile.plot.pyvista_drawing")
curves = pytest.importorskip("skfem_textile.plot.curves").curves

FINITE = "two finite limits in ascending order, got"
ENDLESS = np.r_[np.zeros(5), np.nan, np.zeros(6)]


def field(label, values):
    return plot.Field(label, lambda ply, u: values)


def small_plotter():
    plotter = pv.Plotter(off_screen=True, shape=(2, 2), window_size=(60, 60))
    plotter.subplot(1, 1)
    return plotter


SIZES = 0, np.nan, (80, 0), (1, 2, 3), (80, 15), 5
LIMITS = (0, 0), (0, np.inf), (np.nan, 1), (1, 2, 3)
ONES, GAP = field("Ones", np.ones(3)), field("Gap", ENDLESS)

ROWS = [
    *((partial(plot.shear_angle, size=size), "size") for size in SIZES),
    *((partial(plot.shear_angle, clim=ends), FINITE) for ends in LIMITS),
    (partial(plot.shear_angle, cmap="no"), "unknown colour map 'no'"),
    (partial(plot.shear_angle, state=5), "no state 5: a result contains 5 states"),
    (partial(plot.field, field=ONES), r"one value for each .* of shape \(3,\)"),
    (partial(plot.field, field=GAP), "Gap: the value in element 5 is not finite"),
    (partial(plot.field, field="shear"), "unknown field 'shear': choose one of shear_"),
    (
        lambda r: plot.fibre_strain(r, plotter=small_plotter()),
        r"2 panels require as many subplots .* has 1$",
    ),
    (
        lambda r: plot.fibre_strain(r, plotter=small_plotter(), filename="x.svg"),
        "a plotter cannot draw vector graphics",
    ),
    (
        lambda r: plot.shear_angle(r, plotter=small_plotter(), size=(8, 8)),
        "with a plotter, size must be the width of its window",
    ),
    (
        lambda r: plot.fibre_strain(r, r, titles=["one"]),
        "2 results require 2 titles, got 1",
    ),
    (lambda r: plot.shear_angle(), "pass at least one result, or"),
    (lambda r: plot.shear_angle(None), "pictures require a Result, not a NoneType"),
    (
        lambda r: plot.draped(r.states[-1]),
        r"for a state .* pass Result\.of_state\(ply",
    ),
    (lambda r: plot.draped(r), "a ply does not lie on a tool"),
    (lambda r: plot.to_pyvista(r, r), "a grid shows one result, got 2"),
    (lambda r: plot.view(r, r), "a view shows one result, got 2"),
    (lambda r: plot.animation(r, r), "filename must be a path, not a Result"),
    (partial(plot.shear_angle, filename="nowhere/x.png"), "the folder .* does not exi"),
    (
        partial(plot.export_gltf, filename="x.glb"),
        r"only to \.gltf files: name it x\.g",
    ),
    (
        lambda r: plot.singular_fibres(Outline([[0, 1, 0], [0, 0, 1]]), None, "a.gif"),
        r"name it a\.png",
    ),
    (
        lambda r: plot.mesh_and_fibres(
            MeshQuad().refined(1), FibreDirections.of_angles([0] * 3, [90] * 3)
        ),
        "3 fibre directions for 4 elements",
    ),
]


@pytest.mark.parametrize(("draw", "message"), ROWS)
def test_a_picture_that_cannot_be_drawn_is_refused_in_one_line(
    result, draw, message, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ValueError, FileNotFoundError), match=message) as refusal:
        draw(result)
    assert "\n" not in str(refusal.value)
    assert list(tmp_path.iterdir()) == []


OF_A_BASIS = [
    (lambda draw, b, u, f, r: draw(b, u), r"with its displacement and a fabric: pa"),
    (lambda draw, b, u, f, r: draw(b, f, u), "fabric must be a Fabric"),
    (lambda draw, b, u, f, r: draw(r.ply, u), r"not a Ply, or \(basis, u, fabric"),
    (lambda draw, b, u, f, r: draw(b, u, f, state=1), "there is no state 1: a result"),
    (lambda draw, b, u, f, r: draw(), "pass at least one result, or"),
]


@pytest.mark.parametrize("name", ["fibre_strain", "to_pyvista", "view"])
@pytest.mark.parametrize(("call", "message"), OF_A_BASIS)
def test_a_basis_requires_its_displacement_and_fabric(result, name, call, message):
    refused(lambda: call(getattr(plot, name), *own(result), result), message)


def test_a_displacement_on_a_basis_has_no_checks_tool_or_infinite_values(result):
    basis, u, fabric = own(result)
    refused(lambda: plot.verdict(basis, u, fabric), "has no checks: pass a Result")
    refused(lambda: plot.draped(basis, u, fabric), "does not lie on a tool")
    folded, message = -basis.mesh.p.T.ravel(), r"value in element \d+ is not finite"
    with np.errstate(all="ignore"):
        refused(lambda: plot.fibre_strain(basis, folded, fabric), message)


@pytest.mark.parametrize("name", ["animation", "export_gltf", "section", "tool_force"])
def test_what_needs_the_states_of_a_run_names_what_draws_a_basis(result, name):
    text = "requires the Result of a run, not a DisplacementBasis: .* draw .basis, u,"
    refused(lambda: getattr(plot, name)(result.ply.basis, "x.png"), text)
    refused(lambda: plot.formed(*own(result)), text)


def drawers(results):
    """Every function that draws into a file, and its suffixes."""
    lines = {"a": ([1, 2], [1, 2])}
    pictures = (".png", ".svg", ".pdf", ".eps")
    for drawn in ("field", "fibre_strain", "shear_angle", "contact_sheet"):
        yield pictures, partial(getattr(plot, drawn), *results)
    yield pictures, partial(plot.fibre_directions, *results)
    yield pictures, partial(plot.verdict, *results)
    yield (".gif", ".webm", ".mp4"), partial(plot.animation, results[0])
    yield pictures, partial(curves, {"title": lines}, "mm", "N")


@pytest.mark.parametrize("suffix", [".tif", ".mp4", ".png", ".gif", ".5"])
def test_an_unsupported_suffix_is_rejected(results, tmp_path, monkeypatch, suffix):
    def works(*_, **__):
        raise AssertionError("worked")

    for work in ("pyvista.Plotter", "matplotlib.figure.Figure.__init__"):
        monkeypatch.setattr(work, works)
    monkeypatch.setattr(type(results[0].ply), "law_strain", works)
    for written, draw in drawers(results):
        if suffix not in written:
            message = f"can be written only to {', '.join(written)} files: name it"
            refused(partial(draw, filename=tmp_path / f"x{suffix}"), re.escape(message))
    assert list(tmp_path.iterdir()) == []


def test_a_missing_pyvista_is_named_and_not_needed_for_vectors_and_plane_plies(
    result, draped, tmp_path, monkeypatch
):
    monkeypatch.setattr(requirements, "is_installed", lambda name: name != "pyvista")
    written = "flat.gif", "flat.png", "x.pdf"
    plot.animation(result, tmp_path / "flat.gif")
    plot.fibre_directions(result, filename=tmp_path / "flat.png")
    plot.fibre_directions(draped, filename=tmp_path / "x.pdf")
    message = r"picture in space requires pyvista: pip install 'skfem-textile\[plot\]'$"
    for draw in (
        lambda: plot.fibre_directions(draped, filename=tmp_path / "x.png"),
        lambda: plot.animation(draped, tmp_path / "x.gif"),
        result.view,
        lambda: plot.fibre_directions(result),
    ):
        with pytest.raises(ImportError, match=message):
            draw()
    assert sorted(p.name for p in tmp_path.iterdir()) == [*written]


def test_a_missing_ffmpeg_is_named_before_anything_is_drawn(
    result, tmp_path, monkeypatch
):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(pictures, "_sheets", None)
    with pytest.raises(FileNotFoundError, match="ffmpeg, which is not installed") as no:
        plot.animation(result, tmp_path / "x.webm")
    assert "\n" not in str(no.value)
    assert list(tmp_path.iterdir()) == []


def test_the_missing_off_screen_gl_is_named(result, monkeypatch):
    monkeypatch.setattr(offscreen, "_can_draw", lambda environment: False)
    offscreen.require_offscreen.cache_clear()
    try:
        with pytest.raises(RuntimeError, match="install the Debian packages libegl1"):
            plot.shear_angle(result)
    finally:
        offscreen.require_offscreen.cache_clear()
