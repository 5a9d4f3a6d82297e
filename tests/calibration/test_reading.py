"""Files of testing machines are read as written, or refused with both readings."""

import numpy as np
import pytest

from skfem_textile.calibration import (
    BiasExtension,
    Format,
    Preparation,
    read_biaxial,
    read_recordings,
    read_specimens,
)
from studies.laboratory.machines import MACHINES, Export

MOVED = np.linspace(0.0, 30.0, 40)
CURVES = [(MOVED, 0.1 * MOVED**2), (MOVED[:30], 0.2 * MOVED[:30])]


def write(tmp_path, content, name="test.csv"):
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


def read(tmp_path, content, **form):
    return read_recordings(write(tmp_path, content), Format(**form))


@pytest.mark.parametrize("machine", MACHINES)
def test_exports_of_machines_are_read_as_written(machine, tmp_path):
    rng = np.random.default_rng(1)
    for _ in range(25):
        export = Export.drawn(machine, rng)
        recordings = read(tmp_path, export.written(CURVES))
        assert len(recordings) == 2
        for recording, (moved, force) in zip(recordings, CURVES, strict=True):
            columns = recording.columns
            np.testing.assert_allclose(columns["displacement"], moved, atol=1e-3)
            np.testing.assert_allclose(columns["force"], force, atol=1e-3)
            said = recording.statements[0]
            assert ("sign of force turned" in said) == (export.sign < 0)
            assert f", {export.force_unit})" in said


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        (
            "displacement,force (N)\n1,2\n",
            "'displacement' must be one of mm, .* it has none: .*--unit displacement",
        ),
        ("force (pound)\n1\n", "'force' must be one of N, .* got 'pound': convert"),
        ("force (kg)\n1\n", "got 'kg': use --unit force=kgf for the weight"),
        ("Усилие (Н),Путь (мм)\n1,2\n", "the columns are named Усилие, Путь: specify"),
        ("time (s)\n1\n", "row 2: the columns are named time"),
        ("1;2\n2;3\n", "row 1: the columns have no headings: .*--column force=2"),
        ("force (N),load (N)\n1,2\n", r"column 1 \('force'\) and column 2 \('load'\)"),
        ("force (N),displacement (mm)\n", "the file contains no rows"),
        ("force (N),displacement (mm)\n1,2\n1\n", "row 3: expected 2 .* got '1'"),
        ("force (N),displacement (mm)\nnan,2\n3,4\n", "row 2: expected 2 cells"),
        ("force (N),displacement (mm)\n2,3\n1e200,2\n", "row 3: expected 2 cells"),
        ("displacement (mm)\n1\n", "the column 'force' is missing: .*--column force=2"),
        (
            "shear angle (deg),normalised shear force (N/mm)\n1,2\n",
            "is already a law, and needs no fit",
        ),
        ("force (N)\n1\n", "a column 'displacement' or 'shear angle'"),
        ("displacement (N),force (mm)\n1,2\n", "whether columns are swapped"),
        (
            "displacement (mm);force (N)\n1,234;2,345\n2,234;4,345\n",
            "'1,234' may be 1.234 or 1234, .* --decimal ',' .* --decimal '.'",
        ),
        (
            "displacement (mm);force (N)\n1,2;2.3\n2,2;4.3\n",
            "numbers such as '1,2' and '2.3' have different decimal marks",
        ),
        (
            "displacement (mm),force (N)\n0,5,1,5\n1,5,2,5\n",
            "row 2: 4 numbers have no headings, or commas both separate columns",
        ),
        (
            "displacement (mm);force (N)\n0;-9\n1;-8\n2;-7\n3;-5\n4;-3\n5;-1\n",
            "force is negative and its magnitude decreases.*--sign force=-1",
        ),
        (b"PK\x03\x04abc", "the file is a workbook: save the sheet"),
        (b"\x00\x01\x02\x80\x00", "not a text file|no rows of numbers"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, text, message):
    with pytest.raises(ValueError, match=message) as error:
        read_specimens(write(tmp_path, text), BiasExtension(50.0, 100.0))
    assert "\n" not in str(error.value)
    assert "test.csv" in str(error.value)


def test_a_slack_requires_a_displacement(tmp_path):
    angles = write(tmp_path, "shear angle (deg),force (N)\n1,2\n5,9\n", "angles.csv")
    text = "warp strain (-),warp force (N),weft strain (-),weft force (N)\n0,1,0,1\n"
    strains, test = write(tmp_path, text, "strains.csv"), BiasExtension(50.0, 100.0)
    given, zero = Preparation(slack=2.0), Preparation(slack=0.0)
    message = "a slack of 2 mm requires a displacement, .* contains {}: omit --slack"
    with pytest.raises(ValueError, match=message.format("shear angles")):
        read_specimens(angles, test, choices=given)
    with pytest.raises(ValueError, match=message.format("strains")):
        read_biaxial(strains, (100.0, 100.0), choices=given)
    assert read_specimens(angles, test, choices=zero)[0].slack == 0.0
    assert not read_biaxial(strains, (100.0, 100.0), choices=zero)[0].slack_is_unknown


@pytest.mark.parametrize(
    ("form", "message"),
    [
        ({"units": {"time": "s"}}, "--unit time: unknown column: choose one of"),
        ({"separator": "x"}, "the separator must be one of"),
        ({"decimal": ";"}, "the decimal mark must be . or ,"),
        ({"columns": {"force": 7}}, "there are 2 columns, and no column 7"),
        ({"columns": {"force": "F"}}, "no column is named 'F'"),
        ({"encoding": "ascii"}, "not in the encoding 'ascii'"),
    ],
)
def test_invalid_options_are_refused(tmp_path, form, message):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, "Größe (mm),force (N)\n1,2\n", **form)


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


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            {"Strain1 (mm)": 0.05 * NOISE, "Load (N)": RISE, "Extension (mm)": RISE},
            r"column 1 \('Strain1'\) contains noise, not displacement: .*column 3 "
            r"\('Extension'\) with --column displacement=3",
        ),
        (
            {"Weg (mm)": np.cos(np.arange(200) / 4), "Kraft (N)": RISE},
            "column 1 .* not larger than its scatter.*: specify another column",
        ),
        (
            {"strain (-)": 0.01 + 0 * RISE, "force (N)": RISE},
            "column 1 .* contains noise, not strain",
        ),
        (
            {"Weg (mm)": RISE, "Kraft (N)": 5 + NOISE},
            r"column 2 \('Kraft'\) contains noise, not the force",
        ),
    ],
)
def test_columns_of_noise_are_refused_by_name(tmp_path, columns, message):
    rows = zip(*columns.values(), strict=True)
    lines = [";".join(columns), *(";".join(f"{x:.4f}" for x in row) for row in rows)]
    form = {"columns": {"displacement": 1}} if "Strain1 (mm)" in columns else {}
    with pytest.raises(ValueError, match=message) as error:
        read(tmp_path, "\n".join(lines), **form)
    assert "\n" not in str(error.value)


def test_noisy_cycles_and_breaks_are_no_noise(tmp_path):
    cycles = 15 * (1 - np.cos(np.arange(200) / 3))
    broken = np.where(RISE < 8, RISE, 0.1)
    for moved, force in ((cycles, cycles), (RISE, broken)):
        text = table(moved + 0.2 * NOISE, force + 0.2 * NOISE[::-1])
        (one,) = read(tmp_path, text)
        assert one.columns["force"].size == 200
