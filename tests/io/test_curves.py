"""Curves in space from tables and DXF files."""

import numpy as np
import pytest

from skfem_textile import io

POINTS = np.array([[0.5, 20.25, -3.0], [1.0, 0.0, 2.5], [1000.5, 7.0, 0.0]])

FIRST = (0, 0), (100, 0)  # ends of a line


def table(path, separator=",", header=("x", "y", "z"), mark=".", scale=1.0):
    rows = [[f"{scale * v!r}".replace(".", mark) for v in x] for x in POINTS.tolist()]
    lines = [separator.join(row) for row in ([list(header)] if header else []) + rows]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("separator", "mark"),
    [(",", "."), (";", "."), (";", ","), ("\t", ","), (" ", "."), (" ", ",")],
)
@pytest.mark.parametrize("header", [("x", "y", "z"), ("# X (MM)", "Y [mm]", "z"), None])
def test_tables_of_all_separators_are_the_same_curve(tmp_path, separator, mark, header):
    file = table(tmp_path / "curve.csv", separator, header, mark)
    np.testing.assert_allclose(io.read_curve(file), POINTS.T)


def test_the_unit_of_a_header_counts(tmp_path):
    header = ("x (m)", "y (m)", "z (m)")
    file = table(tmp_path / "curve.csv", ";", header, scale=1e-3)
    np.testing.assert_allclose(io.read_curve(file), POINTS.T)


def drawing(units=4):
    ezdxf = pytest.importorskip("ezdxf")
    file = ezdxf.new("R2000", units=units)
    return file, file.modelspace()


def written(folder, file):
    file.saveas(folder / "curve.dxf")
    return folder / "curve.dxf"


def test_a_dxf_curve_is_read_in_space_and_in_its_unit(tmp_path):
    file, space = drawing(units=6)
    space.add_polyline3d((POINTS.T / 1000).T.tolist())
    np.testing.assert_allclose(io.read_curve(written(tmp_path, file)), POINTS.T)


def test_lines_and_arcs_of_a_dxf_that_meet_are_one_curve(tmp_path):
    """A stadium of the width 20 mm and the length 50 mm, drawn in any order.

    Ends meet within 1e-5 of the extent, 0.5 µm.
    """
    file, space = drawing()
    space.add_line((-15, -10), (15 - 4e-4, -10))
    space.add_arc((-15, 0), 10, 90, 270)
    space.add_line((-15, 10), (15 - 4e-4, 10))
    space.add_arc((15, 0), 10, -90, 90)
    x, y, _ = io.read_curve(written(tmp_path, file))
    area = 0.5 * abs(x @ np.roll(y, -1) - np.roll(x, -1) @ y)
    assert area == pytest.approx(600 + np.pi * 100, rel=1e-3)


@pytest.mark.parametrize(
    "others",
    [
        [((0, 20), (9, 20))],
        [((100.002, 0), (150, 0))],
        [((100, 0), (150, 0)), ((100, 0), (150, 9))],
    ],
)
def test_curves_that_do_not_continue_one_another_are_refused(tmp_path, others):
    """Apart by far or by 2 µm, and at a branch."""
    file, space = drawing()
    for ends in (FIRST, *others):
        space.add_line(*ends)
    with pytest.raises(ValueError, match=r"several curves on layer '0' .* each file"):
        io.read_curve(written(tmp_path, file))


def test_what_is_hidden_or_no_line_of_a_dxf_is_ignored_in_one_line(tmp_path, caplog):
    file, space = drawing(units=14)  # decimetres
    file.layers.add("off").off()
    space.add_circle((0, 0), 5, dxfattribs={"layer": "off"})
    space.add_text("text")
    file.blocks.new("ring").add_circle((0, 0), 1)
    space.add_blockref("ring", (2, 0), dxfattribs={"xscale": 3, "yscale": 3})
    x, y, z = io.read_curve(written(tmp_path, file))
    np.testing.assert_allclose(np.hypot(x - 200, y), 300)
    assert not z.any()
    (line,) = caplog.messages
    assert line.endswith("curve.dxf: ignored: 1 hidden CIRCLE, 1 TEXT")


@pytest.mark.parametrize("corners", [[*FIRST, (100, 60), (0, 60)], [*FIRST, (9, 9)]])
def test_a_closed_curve_of_a_dxf_is_closed(tmp_path, corners):
    """It is refused where a chord would close it."""
    file, space = drawing()
    polyline = space.add_lwpolyline(corners)
    path = written(tmp_path, file)
    with pytest.raises(ValueError, match=r"'0' is open: its ends .* apart; close it"):
        io.read_curve(path, 3)
    assert io.read_curve(path).shape == (3, len(corners))
    polyline.close()
    read = io.read_curve(written(tmp_path, file), 3)
    np.testing.assert_allclose(read[:, 0], read[:, -1])


def test_an_unknown_unit_of_a_dxf_is_refused(tmp_path):
    file, space = drawing()
    file.header["$INSUNITS"] = 99
    space.add_line(*FIRST)
    with pytest.raises(ValueError, match=r"the unit 99 of \$INSUNITS is unknown"):
        io.read_curve(written(tmp_path, file))


@pytest.mark.parametrize("content", [b"", b"nothing", b"0\nSECTION\n2\nHEADER\n9"])
def test_a_damaged_dxf_is_refused_without_words_of_ezdxf(tmp_path, content):
    pytest.importorskip("ezdxf")
    file = tmp_path / "curve.dxf"
    file.write_bytes(content)
    with pytest.raises(ValueError, match="is damaged, or is not a DXF file: save it"):
        io.read_curve(file)


def test_what_ezdxf_logs_about_a_file_is_omitted(tmp_path, capfd, caplog):
    """A property of a class of the file is taken as the beginning of another one."""
    file, space = drawing()
    space.add_line(*FIRST)
    path = written(tmp_path, file)
    lines = path.read_text().splitlines()
    lines[lines.index("ObjectDBX Classes") - 1] = "0"
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(io.read_curve(path), [[0, 100], [0, 0], [0, 0]])
    assert not caplog.messages
    assert capfd.readouterr() == ("", "")
