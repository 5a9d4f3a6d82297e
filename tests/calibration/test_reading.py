"""Files of testing machines are read as written, or refused with both readings."""

import numpy as np
import pytest

from skfem_textile.calibration import Format, read_recordings

MOVED = np.linspace(0.0, 30.0, 40)


def write(tmp_path, content, name="test.csv"):
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


def read(tmp_path, content, **form):
    return read_recordings(write(tmp_path, content), Format(**form))


@pytest.mark.parametrize(
    ("text", "encoding", "sign"),
    [
        (
            'Probe für Müller\n"Zeit";"Standardweg";"Standardkraft"\n"s";"mm";"N"\n'
            '"0,0";"0,0";"0,0"\n"1,0";"1,5";"-2,5"\n"2,0";"3,0";"-9,0"\n',
            "latin-1",
            -1,
        ),
        (
            "Name\tfabric\nTime\tForce\tStroke\tTime\tForce\tStroke\n"
            "s\tkN\tm\ts\tkN\tm\n0\t0\t0\t0\t0\t0\n"
            "1\t0.0025\t0.0015\t1\t0.005\t0.0015\n2\t0.009\t0.003\t\t\t\n",
            "utf-16",
            1,
        ),
        (
            "# sampling rate 10 Hz\nload_cell[lbf]  position[in]\n0  0\n"
            "0.562022  0.0590551\n2.023281  0.1181102\n",
            "utf-8",
            1,
        ),
        (
            "Déplacement in mm;Charge in mN\n0,0;0,0\n1,5;2500,0\n3,0;9000,0\n",
            "cp1252",
            1,
        ),
    ],
    ids=["quoted cells", "side by side", "spaces", "units in words"],
)
def test_exports_of_machines_are_read_as_written(tmp_path, text, encoding, sign):
    first, *more = read(tmp_path, text.encode(encoding))
    np.testing.assert_allclose(first.columns["displacement"], [0, 1.5, 3], atol=1e-5)
    np.testing.assert_allclose(first.columns["force"], [0, 2.5, 9], atol=1e-5)
    assert ("sign of force turned" in first.statements[0]) == (sign < 0)
    for one in more:
        np.testing.assert_allclose(one.columns["force"], [0, 5], atol=1e-5)


def test_the_reading_is_stated(tmp_path):
    text = "Prüfung\nWeg in mm;Kraft in kN\n0,0;0,0\n1,5;-0,25\n3,0;-0,5\n"
    (recording,) = read(tmp_path, text.encode("latin-1"))
    assert recording.rows.tolist() == [3, 4, 5]
    assert recording.columns["force"].tolist() == [0.0, 250.0, 500.0]
    assert recording.statements == (
        "read: encoding cp1252, separator semicolon, decimal comma, displacement from "
        "column 1 (Weg, mm), force from column 2 (Kraft, kN), sign of force turned",
    )


def test_columns_come_in_any_order_with_their_units(tmp_path):
    header = "Load (kN),time (s), Angle [deg],extension [ cm ]\n"
    (recording,) = read(tmp_path, f"{header}1,2,90,4\n")
    columns = recording.columns
    assert set(columns) == {"force", "shear angle", "displacement"}
    assert columns["force"].tolist() == [1000.0]
    assert columns["displacement"].tolist() == [40.0]
    assert columns["shear angle"] == pytest.approx([np.pi / 2])


def test_options_overrule_the_content(tmp_path):
    text = "displacement (mm),other (mm),force (N)\n1,2,3\n2,4,6\n"
    units = {"force": "kN"}
    (one,) = read(
        tmp_path,
        text,
        columns={"displacement": 2},
        units=units,
        signs={"force": -1, "displacement": 1},
    )
    assert one.columns["displacement"].tolist() == [2.0, 4.0]
    assert one.columns["force"].tolist() == [-3000.0, -6000.0]
    (two,) = read(tmp_path, text, columns={"displacement": "other"})
    assert two.columns["displacement"].tolist() == [2.0, 4.0]
    doubtful = "displacement (mm);force (N)\n1,234;2,345\n2,234;4,345\n"
    for mark, factor in ((",", 1), (".", 1000)):
        (three,) = read(tmp_path, doubtful, decimal=mark)
        assert three.columns["force"] == pytest.approx([2.345 * factor, 4.345 * factor])
    (four,) = read(tmp_path, "force (N)\n1,5\n2,5\n", separator=";")
    assert four.columns["force"].tolist() == [1.5, 2.5]


def test_a_folder_contains_one_recording_per_file(tmp_path):
    for name in ("b.csv", "a.txt", "notes.md"):
        write(tmp_path, "displacement (mm)\tforce (N)\n0\t0\n1\t2\n", name)
    assert [one.name for one in read_recordings(tmp_path)] == ["a.txt", "b.csv"]


def test_a_uniaxial_test_is_read(tmp_path):
    text = "Dehnung;Standardkraft\n%;N\n0,00;0,1\n0,10;15,2\n0,20;31,4\n"
    (recording,) = read(tmp_path, text)
    assert recording.columns["strain"] == pytest.approx([0.0, 0.001, 0.002])
    assert set(recording.columns) == {"strain", "force"}


def test_thousands_are_read_where_a_number_decides(tmp_path):
    text = "displacement (mm);force (N)\n0,5;1.234,5\n1,5;12.345,0\n"
    (recording,) = read(tmp_path, text)
    assert recording.columns["force"].tolist() == [1234.5, 12345.0]
    quoted = 'displacement (mm),force (N)\n0.5,"1,234.5"\n1.5,"12,345"\n'
    assert read(tmp_path, quoted)[0].columns["force"].tolist() == [1234.5, 12345.0]


def test_a_break_does_not_turn_the_sign_of_the_displacement(tmp_path):
    """Many small forces at the largest displacements, unlike in a turned test."""
    moved = np.arange(60.0)
    force = np.where(moved < 45, moved**2, 1.0)
    for sign in (1, -1):
        rows = (f"{sign * x:g};{f:g}" for x, f in zip(moved, force, strict=True))
        text = "\n".join(["displacement (mm);force (N)", *rows])
        (one,) = read(tmp_path, text)
        np.testing.assert_array_equal(one.columns["displacement"], moved)
        turned = "sign of displacement turned" in one.statements[0]
        assert turned == (sign < 0)


def test_weights_are_forces(tmp_path):
    text = "displacement (mm);load (kp);load (gf)\n1;2;2\n"
    for column, force in ((2, 19.6133), (3, 0.0196133)):
        (one,) = read(tmp_path, text, columns={"force": column})
        assert one.columns["force"] == pytest.approx(force)


@pytest.mark.parametrize("last", ["40.5-3", "40;3", "40,2.1.3"])
def test_a_damaged_last_row_is_named(tmp_path, last):
    rows = "".join(f"{i},{0.1 * i}\n" for i in range(40))
    (recording,) = read(tmp_path, f"displacement (mm),force (N)\n{rows}{last}\n")
    (note,) = [text for text in recording.statements if "row" in text]
    assert note.startswith("row 42: ")
    assert note.endswith("left out")


def test_rows_without_numbers_are_named(tmp_path):
    rows = [f"{x},{2 * x}" for x in range(40)]
    rows[7], rows[9], rows[12] = "7,OVERLOAD", "9,", "pause"
    rows += ["mean of all"]
    text = "\n".join(["displacement (mm),force (N)", *rows])
    (recording,) = read(tmp_path, text)
    said = " ".join(recording.complete("displacement", "force").statements)
    assert "rows 9, 14: no numbers of the table ('7,OVERLOAD')" in said
    assert "row 11 without numbers" in said
    assert recording.rows.size == 38


HEADING = "Displacement (mm);Force (N)"


def table(moved, force, *titles, heading=HEADING):
    rows = (f"{x:.4f};{f:.4f}" for x, f in zip(moved, force, strict=True))
    return "\n".join([*titles, heading, *rows, ""])


def test_tables_whose_displacement_goes_on_are_segments_of_one_test(tmp_path):
    """Also of unloading, of other units, without units, and of few rows."""
    x = np.append(MOVED, MOVED[::-1])
    f = 0.1 * x**2
    metres, bare = "Displacement (m);Force (kN)", "Displacement;Force"
    text = "\n".join(
        [
            table(x[:30], f[:30]),
            table(x[30:33] / 1e3, f[30:33] / 1e3, "Page 2", heading=metres),
            table(x[33:60] / 1e3, f[33:60] / 1e3, heading=bare),
            table(x[60:], f[60:]),
        ]
    )
    (one,) = read(tmp_path, text)
    np.testing.assert_allclose(one.columns["displacement"], x, atol=0.06)
    np.testing.assert_allclose(one.columns["force"], f, atol=0.06)
    assert "4 tables, from rows 2, 35, 40, 69 on, are segments of one test" in (
        one.statements
    )


def test_tables_that_begin_anew_are_several_tests(tmp_path):
    x = np.append(MOVED, MOVED[::-1])
    loops = "\n".join([table(x, 0.1 * x**2), table(x, 0.2 * x**2)])
    assert len(read(tmp_path, loops)) == 2
    named = [
        table(x[i : i + 20], x[i : i + 20], f"Probe {i // 40}") for i in (0, 20, 40)
    ]
    assert len(read(tmp_path, "\n".join(named))) == 2


@pytest.mark.parametrize("between", ["", "Specimen 2"])
def test_specimens_below_one_heading_are_several_tests(tmp_path, between):
    first, second = (table(MOVED, k * MOVED**2).splitlines() for k in (0.1, 0.2))
    one, two = read(tmp_path, "\n".join([*first, between, *second[1:], ""]))
    for test, k in ((one, 0.1), (two, 0.2)):
        np.testing.assert_allclose(test.columns["force"], k * MOVED**2, atol=1e-4)
        assert not any("left out" in text for text in test.statements)


def test_a_title_separates_specimens_that_return_to_their_beginning(tmp_path):
    x = np.append(MOVED, MOVED[::-1])
    first, second = (table(x, k * x**2).splitlines() for k in (0.1, 0.2))
    text = "\n".join(["Specimen 1", *first, "Specimen 2", *second[1:], ""])
    assert len(read(tmp_path, text)) == 2


@pytest.mark.parametrize("between", ["", "pause of 5 s"])
def test_a_table_with_blank_lines_or_comments_is_one_test(tmp_path, between):
    x = np.tile(np.append(MOVED, MOVED[::-1]), 2)
    heading, *rows = table(x, x**2).splitlines()
    lines = [heading, *rows[:10], between, *rows[10:80], between, *rows[80:]]
    (one,) = read(tmp_path, "\n".join(lines))
    assert one.columns["force"].size == x.size


def test_a_biaxial_test_in_pages_is_one_test(tmp_path):
    """Also if the transverse strain decreases."""
    heading = "warp strain (-);weft strain (-);warp force (N);weft force (N)"
    x = np.linspace(0.0, 0.05, 60)
    rows = [f"{a:.6f};{-0.2 * a:.6f};{3e3 * a:.3f};{0.0:.3f}" for a in x]
    pages = ["\n".join([heading, *rows[i : i + 20]]) for i in (0, 20, 40)]
    (one,) = read(tmp_path, "\n\n".join(pages))
    assert one.columns["warp strain"].size == 60
    anew = "\n\n".join("\n".join([heading, *rows]) for _ in range(2))
    assert len(read(tmp_path, anew)) == 2


def test_a_clock_decides_whether_a_returned_test_goes_on(tmp_path):
    x = np.append(MOVED, MOVED[::-1])
    for pause, tests in ((0.5, 1), (-40.0, 2), (600.0, 2)):
        time = 0.5 * np.arange(x.size)
        lines = []
        for start in (0.0, time[-1] + pause):
            rows = zip(x, x**2, time + start, strict=True)
            lines += ["Displacement (mm);Force (N);Time (s)"]
            lines += [f"{a:.4f};{b:.4f};{c:.2f}" for a, b, c in rows]
        assert len(read(tmp_path, "\n".join(lines))) == tests


def test_readings_below_repeated_headings_are_of_one_strip(tmp_path):
    page = "overhang (mm);chord angle (deg)\n{}.5;41.5\n{}.75;41.5\n"
    text = page.format(100, 101) + page.format(99, 102)
    (one,) = read(tmp_path, text)
    assert one.columns["overhang"].size == 4


NOISE = np.random.default_rng(3).standard_normal(200)
RISE = np.linspace(0.0, 30.0, 200)


def test_noisy_cycles_and_breaks_are_no_noise(tmp_path):
    cycles = 15 * (1 - np.cos(np.arange(200) / 3))
    broken = np.where(RISE < 8, RISE, 0.1)
    for moved, force in ((cycles, cycles), (RISE, broken)):
        text = table(moved + 0.2 * NOISE, force + 0.2 * NOISE[::-1])
        (one,) = read(tmp_path, text)
        assert one.columns["force"].size == 200
