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


HEADER = "Load (kN),time (s), Angle [deg],extension [ cm ]\n"
OTHER = "displacement (mm),other (mm),force (N)\n1,2,3\n2,4,6\n"
DOUBTFUL = "displacement (mm);force (N)\n1,234;2,345\n2,234;4,345\n"
WEIGHTS = "displacement (mm);load (kp);load (gf)\n1;2;2\n"
GROUPED = "displacement (mm);force (N)\n0,5;1.234,5\n1,5;12.345,0\n"
QUOTED = 'displacement (mm),force (N)\n0.5,"1,234.5"\n1.5,"12,345"\n'

#: Rows (text, options, columns).
TEXTS = [
    (f"{HEADER}1,2,90,4\n", {}, {"force": 1e3, "shear angle": np.pi / 2}),
    (f"{HEADER}1,2,90,4\n", {}, {"displacement": 40.0}),
    ("Dehnung;Standardkraft\n%;N\n0,10;15,2\n", {}, {"strain": 1e-3, "force": 15.2}),
    (GROUPED, {}, {"force": [1234.5, 12345.0]}),
    (QUOTED, {}, {"force": [1234.5, 12345.0]}),
    (OTHER, {"columns": {"displacement": 2}}, {"displacement": [2.0, 4.0]}),
    (OTHER, {"columns": {"displacement": "other"}}, {"displacement": [2.0, 4.0]}),
    (OTHER, {"units": {"force": "kN"}}, {"force": [3e3, 6e3]}),
    (OTHER, {"signs": {"force": -1, "displacement": 1}}, {"force": [-3.0, -6.0]}),
    (DOUBTFUL, {"decimal": ","}, {"force": [2.345, 4.345]}),
    (DOUBTFUL, {"decimal": "."}, {"force": [2345.0, 4345.0]}),
    ("force (N)\n1,5\n2,5\n", {"separator": ";"}, {"force": [1.5, 2.5]}),
    (WEIGHTS, {"columns": {"force": 2}}, {"force": 19.6133}),
    (WEIGHTS, {"columns": {"force": 3}}, {"force": 0.0196133}),
]


@pytest.mark.parametrize(("text", "form", "columns"), TEXTS)
def test_columns_have_their_names_units_and_options(tmp_path, text, form, columns):
    (recording,) = read(tmp_path, text, **form)
    for name, values in columns.items():
        assert recording.columns[name] == pytest.approx(np.atleast_1d(values))


def test_other_columns_are_not_read(tmp_path):
    (recording,) = read(tmp_path, f"{HEADER}1,2,90,4\n")
    assert set(recording.columns) == {"force", "shear angle", "displacement"}


def test_a_folder_contains_one_recording_per_file(tmp_path):
    for name in ("b.csv", "a.txt", "notes.md"):
        write(tmp_path, "displacement (mm)\tforce (N)\n0\t0\n1\t2\n", name)
    assert [one.name for one in read_recordings(tmp_path)] == ["a.txt", "b.csv"]


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


def pages(*parts):
    """Pages of a biaxial test, whose transverse strain decreases."""
    heading = "warp strain (-);weft strain (-);warp force (N);weft force (N)"
    rows = [f"{x:.6f};{-0.2 * x:.6f};{3e3 * x:.3f};0" for x in np.linspace(0, 0.05, 60)]
    return "\n\n".join("\n".join([heading, *rows[part]]) for part in parts)


def with_clock(pause):
    """Two loops, the second of which begins after a pause in seconds."""
    lines = []
    for start in (0.0, 0.5 * LOOP.size + pause):
        lines += ["Displacement (mm);Force (N);Time (s)"]
        lines += [f"{x:.4f};{x**2:.4f};{start + i / 2}" for i, x in enumerate(LOOP)]
    return "\n".join(lines)


LOOP = np.append(MOVED, MOVED[::-1])
CYCLES = table(np.tile(LOOP, 2), np.tile(LOOP, 2) ** 2).splitlines()
FIRST, SECOND = (table(MOVED, k * MOVED**2) for k in (0.1, 0.2))
ONE_LOOP, OTHER_LOOP = (table(LOOP, k * LOOP**2) for k in (0.1, 0.2))
BELOW, LOOP_BELOW = (x.removeprefix(f"{HEADING}\n") for x in (SECOND, OTHER_LOOP))
PAUSED = CYCLES[:11], CYCLES[11:81], CYCLES[81:]
PARTS = [(LOOP[i : i + 20], f"Probe {i // 40}") for i in (0, 20, 40)]
READINGS = "overhang (mm);chord angle (deg)\n{}.5;41.5\n{}.75;41.5\n"

#: Rows (text, rows of each test).
FILES = [
    (ONE_LOOP + OTHER_LOOP, [80, 80]),
    ("".join(table(x, x, title) for x, title in PARTS), [40, 20]),
    (f"{FIRST}\n{BELOW}", [40, 40]),
    (f"{FIRST}Specimen 2\n{BELOW}", [40, 40]),
    (f"Specimen 1\n{ONE_LOOP}Specimen 2\n{LOOP_BELOW}", [80, 80]),
    ("\n\n".join("\n".join(part) for part in PAUSED), [160]),
    ("\npause of 5 s\n".join("\n".join(part) for part in PAUSED), [160]),
    (pages(slice(20), slice(20, 40), slice(40, 60)), [60]),
    (pages(slice(60), slice(60)), [60, 60]),
    (with_clock(0.5), [160]),
    (with_clock(-40.0), [80, 80]),
    (with_clock(600.0), [80, 80]),
    (READINGS.format(100, 101) + READINGS.format(99, 102), [4]),
]


@pytest.mark.parametrize(("text", "rows"), FILES)
def test_a_file_is_divided_into_its_tests(tmp_path, text, rows):
    """By motions that begin anew, titles, or a clock."""
    found = read(tmp_path, text)
    assert [one.rows.size for one in found] == rows
    said = " ".join(text for one in found for text in one.statements)
    assert ("left out" in said) == ("pause of" in text)


NOISE = np.random.default_rng(3).standard_normal(200)
RISE = np.linspace(0.0, 30.0, 200)


def test_noisy_cycles_and_breaks_are_no_noise(tmp_path):
    cycles = 15 * (1 - np.cos(np.arange(200) / 3))
    broken = np.where(RISE < 8, RISE, 0.1)
    for moved, force in ((cycles, cycles), (RISE, broken)):
        text = table(moved + 0.2 * NOISE, force + 0.2 * NOISE[::-1])
        (one,) = read(tmp_path, text)
        assert one.columns["force"].size == 200
