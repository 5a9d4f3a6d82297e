"""Results in 3D: views and glTF files."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

pv = pytest.importorskip("pyvista")
Image = pytest.importorskip("PIL.Image")
plot = pytest.importorskip("skfem_textile.plot")
in_space = pytest.importorskip("skfem_textile.plot.in_space")

MEDIA = Path(__file__).parents[2] / "examples" / "media"


def test_a_gltf_file_is_valid_and_in_metres_with_y_upwards(draped, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / "x.gltf"
    plot.export_gltf(draped, file)
    assert [x.name for x in tmp_path.iterdir()] == [file.name]
    scene = trimesh.load(file)
    assert len(scene.geometry) == 6  # ply, two families on both sides, and tool
    assert all(np.isfinite(x.vertices).all() for x in scene.geometry.values())
    ply = max(scene.geometry.values(), key=lambda x: hasattr(x.visual, "uv"))
    ply = ply.copy().apply_transform(scene.graph.get(scene.graph.nodes_geometry[0])[0])
    moved = np.pad(draped.ply.mesh.p, ((0, 1), (0, 0)))
    moved = moved + draped.ply.nodal(draped.u)[:, : moved.shape[1]]
    height = 1e-3 * np.ptp(moved[2])
    assert np.ptp(ply.vertices[:, 1]) == pytest.approx(height, rel=1e-4)


def test_a_gltf_file_contains_its_data_and_colours_without_a_tint(draped, tmp_path):
    plot.export_gltf(draped, tmp_path / "x.gltf", fibres=False)
    content = json.loads((tmp_path / "x.gltf").read_text())
    parts = content["buffers"] + content["images"]
    assert all(part.get("uri", "data:").startswith("data:") for part in parts)
    ply, tool = content["materials"]
    assert ply["pbrMetallicRoughness"]["baseColorFactor"] == [1, 1, 1, 1]
    assert ply["doubleSided"]
    assert tool["doubleSided"]
    assert len(content["meshes"]) == 2


@pytest.mark.dear("a window of pyvista is opened")
def test_a_view_without_trame_is_a_picture(result, monkeypatch):
    """As in Jupyter, off screen."""
    monkeypatch.setattr(pv, "OFF_SCREEN", True)
    monkeypatch.setattr(pv.global_theme, "notebook", True)
    monkeypatch.setattr(in_space, "is_installed", lambda name: False)
    picture = result.view(field="displacement")
    assert isinstance(picture, Image.Image)
    pixels = np.asarray(picture.convert("RGB")).astype(int)
    assert (np.ptp(pixels, axis=2) > 30).mean() > 0.03


def test_every_element_of_a_view_has_its_value(draped):
    plotter = in_space._plotter([draped], field="weft_strain", state=1)
    surface = plotter.actors[next(iter(plotter.actors))].mapper.dataset
    values = plot.FIELDS["weft_strain"].values(draped.ply, draped.states[1].u)
    drawn = surface.point_data["values"].reshape(-1, 4)
    np.testing.assert_allclose(drawn, np.tile(values[:, None], 4))
    plotter.close()


@pytest.mark.slow
def test_the_scripts_of_the_pages_write_their_files(tmp_path, draped, monkeypatch):
    """With few elements and steps."""
    script = runpy.run_path(str(MEDIA / "forming_animation.py"))
    written = []
    monkeypatch.setattr(plot, "animation", lambda of, file, **_: written.append(file))
    script["draw"](script["formed"](elements=6, steps=1), tmp_path)
    assert [file.name for file in written] == ["forming.gif"]
    script = runpy.run_path(str(MEDIA / "results_in_3d.py"))
    for name, result in script["results"](size=4).items():
        plot.export_gltf(result, tmp_path / f"{name}.gltf")
    assert len(list(tmp_path.glob("*.gltf"))) == 3
