"""Decks of parts are read as they mean, and their copies have the fibres of a ply.

Copies are read by the code below, which knows the angles of each format, not by the
package.
"""

import re
import shutil
import tempfile
from collections import Counter

import meshio
import numpy as np
import pytest
from hypothesis import strategies as st

from skfem_textile import MeshError, drape
from skfem_textile.io import read_part_deck, write_part_deck
from skfem_textile.io.layups import LAYERS
from skfem_textile.mesh.progress import unlogged
from tests.helpers.decks import keyword_blocks
from tests.helpers.hostile import (
    RIGHT,
    Family,
    expect_close,
    expect_equal,
    rejected_if_damaged,
    seeds,
)
from tests.helpers.hostile.damage import damaged
from tests.helpers.part_decks import FORMATS, deck

# Seed of the sample.
SEED = 20_261_130

REST = 0.36  # mm


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def normal_of(corners):
    """Normal by the order of nodes."""
    return unit(np.cross(corners[2] - corners[0], corners[-1] - corners[1]))


def families(corners):
    """Warp, weft and shear angle in an element, None where there is no ply."""
    x, y, _ = corners.mean(axis=0)
    upper = normal_of(corners)
    upper = upper if upper @ (0.3, 0.2, 1.0) > 0 else -upper
    turn, shear = 0.02 * x - 0.01 * y + 0.4, 0.6 * np.sin(0.01 * (x + y))
    if np.sin(0.15 * x + 0.06 * y) < -0.5:
        return None
    one = unit(np.cross(np.cross(upper, (0.8, 0.5, 0.3)), upper))
    two = np.cross(upper, one)
    angles = turn, turn + np.pi / 2 - shear
    return *(np.cos(a) * one + np.sin(a) * two for a in angles), shear


def fibres_on(mesh):
    """Fibres in the elements of a mesh."""
    corners = [mesh.points[:, c].T for cell in mesh.cells for c in cell.T]
    none = np.full(3, np.nan), np.full(3, np.nan), np.nan
    warp, weft, shear = zip(*(families(x) or none for x in corners), strict=True)
    axes = np.array(warp).T, np.array(weft).T
    axis = np.array([1.0, 0, 0])
    return drape.FibresInSpace(mesh, mesh.normals(), *axes, np.array(shear), axis)


def turned(corners, axis, degrees):
    """Axis projected onto an element, turned about the normal."""
    n, a = normal_of(corners), np.radians(degrees)
    x = unit(axis - n * (n @ axis))
    return np.cos(a) * x + np.sin(a) * np.cross(n, x)


# Readers of the copies: by instance and number, warp, weft and thickness


def whole(path):
    """Lines of an Abaqus deck with its include files."""
    for line in path.read_text().splitlines():
        found = re.match(r"\*include.*input=(.*)", line, re.I)
        yield from whole(path.parent / found[1].strip()) if found else [line]


def of_inp(made, path):
    tables, sets, layups, part = {}, {}, [], ""
    patches = {p.name.upper().removesuffix("-1"): p for p in made.patches}
    for keyword, given, rows in keyword_blocks("\n".join(whole(path)).encode()):
        if keyword in ("PART", "INSTANCE"):
            part = given.get("PART", given["NAME"]).upper()
        elif keyword in ("END PART", "END INSTANCE"):
            part = ""
        assert keyword != "DISTRIBUTION TABLE" or not part  # of the model
        name = given.get("ELSET", given.get("NAME", "")).upper()
        if keyword in ("DISTRIBUTION", "ORIENTATION"):
            tables[part, keyword, name] = rows
        elif keyword == "ELSET":
            sets.setdefault((part, name), []).extend(rows)
        elif keyword.endswith("SECTION"):
            layups.append((part, name, given, rows))
    found, assigned = {}, Counter()
    for part, name, given, layers in layups:
        numbers = [int(n) for row in sets[part, name] for n in row if n]
        assigned.update((part, n) for n in set(numbers))
        if "COMPOSITE" not in given:
            continue
        assert [row[4].split("_")[0] for row in layers] == [x for x, _ in LAYERS]
        axes = tables[part, "ORIENTATION", given["ORIENTATION"]][0][0]
        rows = {
            key: {x[0]: [*map(float, x[1:])] for x in tables[part, "DISTRIBUTION", key]}
            for key in (axes, *(row[0] for row in layers), layers[1][3])
        }
        for number in numbers:
            patch = patches[part]
            corners = patch.corners(number)
            a = patch.turn @ rows[axes][str(number)][:3]
            b = patch.turn @ rows[axes][str(number)][3:]
            np.testing.assert_allclose(np.cross(a, b), normal_of(corners), atol=1e-9)
            angle = rows[layers[1][3]][str(number)][0]
            shares = np.array([rows[row[0]][str(number)][0] for row in layers])
            thick = shares.sum()
            np.testing.assert_allclose(shares / thick, [x for _, x in LAYERS])
            both = turned(corners, a, 0.0), turned(corners, a, angle)
            found[patch.name, number] = *both, thick
    assert set(assigned.values()) == {1}  # each element has one section
    every = {(k, e) for k, p in patches.items() for e in p.elements}
    assert set(assigned) == every
    return found


def of_bdf(made, path):
    found, corners = {}, made.patches[0].corners
    text = "".join(
        x for x in path.read_text().splitlines(True) if not x.startswith("$")
    )
    for card in re.findall(r"^C(?:QUAD|TRIA)\d\*.*(?:\n\*.*)*", text, re.M):
        name = card[:6]
        words = [
            line[8 + 16 * k : 24 + 16 * k].strip()
            for line in card.splitlines()
            for k in range(4)
        ]
        fields = {"CQUAD4": (6, 4), "CTRIA3": (5, 3), "CQUAD8": (14, 4)}
        at, n = fields.get(name, (8, 3))
        thick = words[10 : 10 + n] if words[10:11] != [""] else [""]
        if thick in ([], [""]):
            continue
        assert len(set(thick)) == 1
        assert "." in words[at]  # an integer would be a coordinate system
        x = corners(int(words[0]))
        side = x[1] - x[0] if name != "CQUAD8" else x[1] + x[2] - x[0] - x[3]
        warp = turned(x, side, float(words[at]))
        found["", int(words[0])] = warp, None, float(thick[0])
    return found


def of_k(made, path):
    found, head, own = {}, "", []
    for line in [*path.read_text().splitlines(), "*END"]:
        if line.startswith("$"):
            continue
        if line.startswith("*"):
            if "_BETA" in head:
                k = 1 + ("OFFSET" in head) + 1
                k += made.patches[0].quadratic
                assert len(own) % k == 0
                for row, thick, *_ in zip(*(own[i::k] for i in range(k)), strict=True):
                    a, b = {"%": (10, 16), "+": (20, 20)}.get(head[-1], (8, 16))
                    number = int(row.split(",")[0] if "," in row else row[:a])
                    words = [thick[b * i : b * (i + 1)] for i in range(5)]
                    t = [*map(float, thick.split(",") if "," in thick else words)]
                    if t[4] == 33.0:
                        continue
                    assert len(set(t[:4])) == 1
                    x = made.patches[0].corners(number)
                    found["", number] = turned(x, x[1] - x[0], t[4]), None, t[0]
            head, own = line.strip(), []
        else:
            own.append(line)
    return found


def of_rad(made, path):
    text = path.read_text() + (path.parent / "part_0000_fibres.inc").read_text()
    blocks = [
        (m[1].split("/"), m[2].splitlines())
        for m in re.finditer(r"^/(.*)\n((?:[^/\n].*\n|\n)*)", text, re.M)
    ]
    by = {}
    for name, lines in blocks:
        kept = [x for x in lines if not x.startswith("#")]
        by.setdefault("/".join(name), []).extend(kept)
    stacks = [lines for name, lines in by.items() if name.startswith("STACK")]
    assert len({stack[4] for stack in stacks}) == 1
    axis = np.array([float(stacks[0][4][20 * k : 20 * k + 20]) for k in range(3)])
    plies = [by[f"PLY/{int(x[:10])}"] for stack in stacks for x in stack[5::2]]
    found, families = {}, {"WARP": {}, "WEFT": {}}
    total, order = Counter(), {}
    for title, card, more in plies:
        if title == "NOT_COVERED":
            continue
        t, drape = float(card[10:30]), by[f"DRAPE/{int(more[:10])}"]
        assert drape[0] == title
        members = "".join(by.get(f"GRSHEL/SHEL/{int(card[50:60])}", [])[1:])
        members += "".join(by.get(f"GRSH3N/SH3N/{int(card[60:70])}", [])[1:])
        assert {int(x[10:20]) for x in drape[1:]} == set(map(int, members.split()))
        for row in drape[1:]:
            number = int(row[10:20])
            total[number] += t * float(row[20:40])
            order.setdefault(number, []).append(title)
            families[title][number] = float(row[40:60])
    for number, thick in total.items():
        assert order[number] == [x for x, _ in LAYERS]
        x = made.patches[0].corners(number)
        both = (turned(x, axis, families[k][number]) for k in ("WARP", "WEFT"))
        found["", number] = *both, thick
    return found


READERS = {"inp": of_inp, "bdf": of_bdf, "k": of_k, "rad": of_rad}


# Lines that may be added to a copy, and marks of lines that are commented out
ADDED = {"inp": r"\*INCLUDE, INPUT=part_fibres", "rad": "#include part_0000_fibres"}
ADDED |= {"bdf": r"C(QUAD|TRIA)\d\*|\* ", "k": r"[\d., -]+$|\*ELEMENT_SHELL"}
MARKS = {"inp": "**", "rad": "#", "bdf": "$", "k": "**"}


def check_kept(made, form, out):
    """All lines are kept in their order, and nothing else is added."""
    added = re.compile(ADDED[form])
    originals = [path for path in made.path.parent.rglob("*") if path.is_file()]
    for path in originals:
        copy = (out / path.relative_to(made.path.parent)).read_text().splitlines()
        for line in path.read_text().splitlines():
            marked, replaced = MARKS[form] + line, form == "k" and added.match(line)
            ends = [copy.index(x) for x in (marked, line) if x in copy[:9]]
            ends = [n for n in ends if all(map(added.match, copy[:n]))]
            assert ends or replaced, line
            copy = copy[ends[0] + 1 :] if ends else copy
        assert all(map(added.match, copy)), copy


def judge(made, form, out):
    """Read a deck and write its copy; errors are one clear line."""
    read = read_part_deck(made.path)
    known = {(p.name, e): p for p in made.patches for e in p.elements}
    found = zip(read.instances, read.labels.tolist(), strict=True)
    assert made.refused or sorted(found) == sorted(known)
    cells = [c for cell in read.mesh.cells for c in cell.T]
    for scope, number, cell in zip(read.instances, read.labels, cells, strict=True):
        if (scope, number) not in known:
            continue
        corners = known[scope, number].corners(number)
        np.testing.assert_allclose(read.mesh.points[:, cell].T, corners, atol=1e-9)
    fibres = fibres_on(read.mesh)
    if not fibres.covered.any():
        return
    written = write_part_deck(out, read, fibres, REST)
    assert written[0].name == made.path.name
    check_kept(made, form, out)
    vtu = meshio.read(written[-1]).cell_data
    np.testing.assert_array_equal(np.vstack(vtu["warp_direction"]), fibres.warp.T)
    found = READERS[form](made, written[0])
    expected = {key: families(p.corners(key[1])) for key, p in known.items()}
    assert set(found) == {key for key, ply in expected.items() if ply is not None}
    for key, (warp, weft, thick) in found.items():
        one, other, shear = expected[key]
        np.testing.assert_allclose(warp, one, atol=2e-8, err_msg=str(key))
        if weft is not None:
            np.testing.assert_allclose(weft, other, atol=2e-8, err_msg=str(key))
        assert thick == pytest.approx(REST / np.cos(shear), rel=1e-9)
    again = read_part_deck(written[0])
    assert again.types == read.types or form == "k"
    np.testing.assert_array_equal(again.labels, read.labels)
    np.testing.assert_allclose(again.mesh.points, read.mesh.points, atol=1e-12)
    for name, members in read.sets.items():
        np.testing.assert_array_equal(again.sets[name], members)


@pytest.mark.parametrize("form", FORMATS)
def test_a_deck_is_read_and_written(tmp_path, form):
    made = deck(tmp_path, form, SEED - 1, damage=False)
    judge(made, form, tmp_path.parent / f"{tmp_path.name}-out")


@pytest.mark.slow
def test_a_sample_of_decks_is_read_and_written_or_refused_in_one_line(tmp_path):
    counts = Counter()
    for k in range(100):
        form, folder = FORMATS[k % 4], tmp_path / str(k)
        folder.mkdir()
        made = deck(folder, form, SEED + k)
        if made.refused:
            with pytest.raises(MeshError, match=made.refused) as caught:
                judge(made, form, tmp_path / "out")
            assert "\n" not in str(caught.value)
        else:
            judge(made, form, tmp_path / "out")
        counts["refused" if made.refused else "right"] += 1
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
    print(dict(counts))
    assert counts["right"] >= 85


def test_pynastran_reads_numbers_angles_and_thickness(tmp_path):
    bdf = pytest.importorskip("pyNastran.bdf.bdf")
    made = deck(tmp_path, "bdf", SEED - 2, damage=False)
    read = read_part_deck(made.path)
    path = write_part_deck(tmp_path / "out", read, fibres_on(read.mesh), REST)[0]
    model = bdf.BDF(debug=None)
    model.read_bdf(path, xref=False)
    for number, kind in zip(read.labels.tolist(), read.types, strict=True):
        element, corners = model.elements[number], made.patches[0].corners(number)
        assert element.type == kind
        ply = families(corners)
        assert (element.T1 is None) == (ply is None)
        if ply is not None and kind != "CQUAD8":
            warp = turned(corners, corners[1] - corners[0], element.theta_mcid)
            np.testing.assert_allclose(warp, ply[0], atol=1e-9)
            thick = REST / np.cos(ply[2])
            np.testing.assert_allclose(element.T1, thick, rtol=1e-12)


def test_the_layers_of_a_ply_bend_and_stretch_as_a_homogeneous_sheet():
    """Moments through the thickness are the same for both families."""
    ends = 2 * np.cumsum([0, *(share for _, share in LAYERS)]) - 1
    assert ends[-1] == 1
    sign = np.array([1.0 if family == "WARP" else -1.0 for family, _ in LAYERS])
    moments = [sign @ np.diff(ends**k) for k in (1, 2, 3)]
    np.testing.assert_allclose(moments, 0.0, atol=1e-15)


# Decks of Abaqus

XY = [(0, 0), (10, 0), (10, 10), (0, 10), (20, 0), (20, 10)]
NODES = ["*Node", *(f"{i}, {x}., {y}., 0." for i, (x, y) in enumerate(XY, 1))]
QUADS = ["*Element, type=S4R, elset=Häut", "11, 1, 2, 3, 4", "7, 2, 5, 6, 3"]
SECTION = ["*Shell Section, elset=Häut, material=CFRP, offset=SPOS", "0.9"]


def written_deck(folder, *lines, name="a.inp"):
    path = folder / name
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return path


def straight(mesh, covered=None, degrees=0.0):
    """Fibres along the x axis turned about the normal, and at 90° to it."""
    n, normal = mesh.n_elements, mesh.normals()
    a = np.radians(degrees)
    x = np.tile([[np.cos(a)], [np.sin(a)], [0.0]], n)
    mask = np.where(np.ones(n, bool) if covered is None else covered, 0.0, np.nan)
    warp, weft = x + mask, np.cross(normal, x, axis=0) + mask
    return drape.FibresInSpace(mesh, normal, warp, weft, mask, np.array([1.0, 0, 0]))


def test_elements_without_fibres_keep_their_section(tmp_path, caplog):
    path = written_deck(tmp_path, *NODES, *QUADS, *SECTION, "*Step", "*Static")
    read = read_part_deck(path)
    assert read.labels.tolist() == [11, 7]
    assert read.sets["Häut"].tolist() == [0, 1]
    fibres = straight(read.mesh, [False, True])
    files = write_part_deck(tmp_path / "out", read, fibres, 0.4)
    assert [file.name for file in files] == ["a.inp", "a_fibres.inp", "a_fibres.vtu"]
    copy = files[0].read_text().splitlines()
    assert copy == [
        *(*NODES, *QUADS, *("**" + line for line in SECTION)),
        *("*INCLUDE, INPUT=a_fibres.inp", "*Step", "*Static"),
    ]
    lines = files[1].read_text().splitlines()
    again = write_part_deck(tmp_path / "again", read, fibres, 0.4)
    assert again[1].read_text() == files[1].read_text()
    caplog.clear()
    write_part_deck(tmp_path / "out", read, fibres, 0.4)
    assert lines[lines.index("*ELSET, ELSET=NOT_COVERED") + 1] == "11"
    at = lines.index("*ELSET, ELSET=NOT_COVERED_Häut")
    assert lines[at : at + 4] == [
        *("*ELSET, ELSET=NOT_COVERED_Häut", "11"),
        *("*SHELL SECTION, ELSET=NOT_COVERED_Häut, MATERIAL=CFRP, OFFSET=SPOS", "0.9"),
    ]
    section = next(line for line in lines if "COMPOSITE" in line)
    assert section.endswith("ELSET=FIBRES, ORIENTATION=FIBRE, OFFSET=SPOS")
    assert caplog.messages == [
        f"{path}: *SHELL SECTION of Häut is commented out for 1 element(s) with "
        "fibres; layers have its material CFRP",
        f"{path}: the ply does not cover element(s) 11",
    ]


def test_a_material_of_layers_keeps_letters_that_are_not_utf_8(tmp_path, caplog):
    section = ["*Shell Section, elset=Häut, composite", "0.9, 3, CFRP"]
    path = written_deck(tmp_path, *NODES, *QUADS, *section)
    path.write_bytes(path.read_bytes().replace(b"CFRP", "Träger".encode("latin-1")))
    read = read_part_deck(path)
    fibres = straight(read.mesh, [False, True])
    files = write_part_deck(tmp_path / "out", read, fibres, 0.4, calculix=True)
    for at in (1, 2):
        lines = files[at].read_bytes().split(b"\n")
        named = [x for x in lines if b"Tr\xe4ger" in x and x[:2] != b"**"]
        assert len(named) == 5  # four layers, and the elements without fibres
    assert all(message.encode() for message in caplog.messages)


def test_thickness_of_each_element_may_be_given(tmp_path):
    path = written_deck(tmp_path, *NODES, *QUADS)
    read = read_part_deck(path)
    given = np.array([0.8, np.nan])
    fibres = straight(read.mesh, [True, False])
    files = write_part_deck(tmp_path / "out", read, fibres, given, material="M")
    lines = files[1].read_text().splitlines()
    at = next(
        i for i, x in enumerate(lines) if x.startswith("*DISTRIBUTION, NAME=FIBRE_L")
    )
    assert float(lines[at + 2].split(", ")[1]) == pytest.approx(0.8 * LAYERS[0][1])


def test_several_instances_with_the_same_fibres_share_a_part(tmp_path):
    turn = ["0., 0., 0.", "0., 0., 0., 0., 0., 1., 90."]
    lines = [
        "*Part, name=P",
        *NODES,
        *QUADS,
        *SECTION,
        "*End Part",
        "*Assembly, name=A",
    ]
    lines += ["*Instance, name=a, part=P", "*End Instance"]
    lines += ["*Instance, name=b, part=P", *turn, "*End Instance", "*End Assembly"]
    read = read_part_deck(written_deck(tmp_path, *lines))
    assert read.instances == ("A", "A", "B", "B")
    np.testing.assert_allclose(read.mesh.centres()[:2, 2], [-5, 5], atol=1e-12)
    same = straight(read.mesh)
    same.warp[:, 2:], same.weft[:, 2:] = same.weft[:, 2:].copy(), -same.warp[:, 2:]
    write_part_deck(tmp_path / "out", read, same, 0.4)
    with pytest.raises(MeshError, match="'P' has 2 instances with different fibres"):
        write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4)


def test_continuum_shells_are_read_by_their_middle_and_degenerate_ones_as_triangles(
    tmp_path,
):
    top = [f"{i + 10}, {x}., {y}., 2." for i, (x, y) in enumerate(XY, 1)]
    cells = ["*Element, type=SC8R", "1, 1, 2, 3, 4, 11, 12, 13, 14"]
    cells += ["*Element, type=S4", "2, 2, 5, 6, 6"]
    read = read_part_deck(written_deck(tmp_path, *NODES, *top, *cells))
    assert [cell.shape for cell in read.mesh.cells] == [(4, 1), (3, 1)]
    np.testing.assert_allclose(read.mesh.centres()[2], [1.0, 0.0])
    files = write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4, "M")
    rows = [x.split(", ") for x in files[1].read_text().splitlines()]
    first, second = (row for row in rows if row[-1] == "WARP_1")
    assert first == ["FIBRE_LAYER", "3", "M", "0.", "WARP_1"]
    assert float(second[0]) == pytest.approx(LAYERS[0][1])  # relative


@pytest.mark.parametrize(
    ("form", "before", "include", "mark"),
    [
        ("inp", [], ["*Include, input={}"], ""),
        ("inp", [], ['*NODE, nset=all, INPUT="{}"'], ""),
        ("inp", ["*NODE, nset=all,"], ["INPUT={}"], ""),
        ("inp", ["\ufeff*Heading"], ["*Include, input={}"], "\ufeff"),
        ("k", ["\ufeff*KEYWORD"], ["*INCLUDE", "{}"], "\ufeff*NODE\n"),
    ],
)
@pytest.mark.parametrize("name", ["nodes.inc", "nœuds_ü.inc"])
def test_files_outside_of_the_folder_are_copied_next_to_the_deck(
    tmp_path, form, before, include, mark, name
):
    """With the data lines of a keyword too, byte order marks, and names in UTF-8."""
    home, out = tmp_path / "home", tmp_path / "out"
    home.mkdir()
    with_data_lines = "INPUT" in include[0]
    nodes = NODES[1:] if with_data_lines or form == "k" else NODES
    written_deck(tmp_path, *[mark + nodes[0], *nodes[1:]], name=name)
    shells = QUADS if form == "inp" else ["*ELEMENT_SHELL", "11,1,1,2,3,4", "*END"]
    lines = [x.format(f"../{name}") for x in include]
    path = written_deck(home, *before, *lines, *shells, name=f"a.{form}")
    read = read_part_deck(path)
    given = "M" if form == "inp" else None
    files = write_part_deck(out, read, straight(read.mesh), 0.4, given)
    head = "\n".join([*before, *(x.format(name) for x in include), ""])
    assert files[0].read_text(encoding="utf-8").startswith(head)
    assert (out / name).read_bytes() == (tmp_path / name).read_bytes()
    again = read_part_deck(files[0])
    np.testing.assert_array_equal(again.mesh.points, read.mesh.points)


@pytest.mark.parametrize("folder", [".", "home"])
def test_no_file_of_the_deck_is_overwritten(tmp_path, folder):
    """In one line, before anything is written."""
    (tmp_path / "home").mkdir()
    written_deck(tmp_path, *SECTION, name="sec.inp")
    lines = [*NODES, *QUADS, "*Include, input=../sec.inp"]
    read = read_part_deck(written_deck(tmp_path / "home", *lines))
    assert [x.name for x in read.files] == ["a.inp", "sec.inp"]
    before = {x: x.read_bytes() for x in tmp_path.rglob("*.*")}
    with pytest.raises(ValueError, match="inp: this file of the deck is not overwr"):
        write_part_deck(tmp_path / folder, read, straight(read.mesh), 0.4)
    assert {x: x.read_bytes() for x in tmp_path.rglob("*.*")} == before


def test_options_of_a_section_are_commented_out_with_it(tmp_path, caplog):
    """They and its orientation stay with the elements without fibres."""
    head = "*Shell Section, elset=Häut, material=CFRP, orientation=O"
    more = ["*Transverse Shear Stiffness", "1., 1., 0.", "*Hourglass Stiffness", "2."]
    lines = ["*Orientation, name=O", "1., 0., 0., 0., 1., 0.", head, "0.9", *more]
    path = written_deck(tmp_path, *NODES, *QUADS, *lines, "*Material, name=CFRP")
    read = read_part_deck(path)
    fibres = straight(read.mesh, [True, False])
    files = write_part_deck(tmp_path / "out", read, fibres, 0.4)
    copy = files[0].read_text().splitlines()
    assert copy[-8:-2] == ["**" + x for x in lines[2:]]
    assert files[1].read_text().splitlines()[-6:] == [
        "*SHELL SECTION, ELSET=NOT_COVERED_Häut, MATERIAL=CFRP, ORIENTATION=O",
        *("0.9", more[0].upper(), more[1], more[2].upper(), more[3]),
    ]
    assert caplog.messages[0].endswith(
        "; no longer applied: ORIENTATION, *TRANSVERSE SHEAR STIFFNESS, "
        "*HOURGLASS STIFFNESS"
    )


def parts_of_abaqus(folder, *names):
    """Deck with an instance of each part."""
    lines = []
    for name in names:
        lines += [f'*Part, name="{name}"', *NODES, *QUADS, *SECTION, "*End Part"]
    lines.append("*Assembly, name=All")
    for k, name in enumerate(names):
        lines += [f'*Instance, name=I{k}, part="{name}"', f"0., 0., {9 * k}."]
        lines.append("*End Instance")
    return read_part_deck(written_deck(folder, *lines, "*End Assembly"))


def test_parts_with_similar_names_have_files_of_their_own(tmp_path):
    read = parts_of_abaqus(tmp_path, "A B", "A_B", "A_B_2")
    files = write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4)
    names = ["a_fibres_A_B.inp", "a_fibres_A_B_2.inp", "a_fibres_A_B_2_2.inp"]
    assert [x.name for x in files[2:-1]] == names
    includes = [x for x in files[0].read_text().splitlines() if "INCLUDE" in x]
    assert includes[1:] == [f"*INCLUDE, INPUT={name}" for name in names]


def test_uncovered_elements_are_listed_by_part_and_in_a_set_of_each(tmp_path, caplog):
    read = parts_of_abaqus(tmp_path, "P", "Q")
    fibres = straight(read.mesh, [False, True, False, False])
    write_part_deck(tmp_path / "out", read, fibres, 0.4)
    assert caplog.messages[-1].endswith("cover element(s) 11 of I0; 11, 7 of I1")
    lines = (tmp_path / "out" / "a_fibres_Q.inp").read_text().splitlines()
    assert lines == ["*ELSET, ELSET=NOT_COVERED", "7, 11"]


# Other decks

TRIANGLE = ["GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0.", "GRID,3,,0.,1.,0."]


def test_a_remark_states_by_how_much_the_weft_is_skewed(tmp_path, caplog):
    """From a tenth of a degree on."""
    deck = written_deck(tmp_path, *TRIANGLE, "CTRIA3,9,1,1,2,3", name="a.bdf")
    read = read_part_deck(deck)
    fibres = straight(read.mesh)
    for degrees in (0.0, 0.1):
        fibres.warp[:2, 0] = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        write_part_deck(tmp_path / "out", read, fibres, 0.4)
    assert [line[-23:] for line in caplog.messages] == ["90° to it by up to 0.1°"]


def test_layers_of_nastran_ignore_the_thickness(tmp_path, caplog):
    layers = ["PCOMP,4", ",7,0.2,0.", "CTRIA3,9,4,1,2,3"]
    read = read_part_deck(written_deck(tmp_path, *TRIANGLE, *layers, name="a.bdf"))
    write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4)
    assert [x.split(": ", 1)[1] for x in caplog.messages] == [
        "PCOMP 4: its layers keep their thickness, T1 to T4 of elements are ignored"
    ]


def radioss_column(*numbers):
    return "".join(f"{n:>10}" for n in numbers)


def radioss_parts(folder, n):
    """Squares in a row, each a part with a property."""
    lines = ["#RADIOSS STARTER", "/MAT/LAW25/5", "m", "/NODE"]
    for i in range(2 * n + 2):
        lines.append(f"{i + 1:>10}{i // 2 * 10.0:>20}{i % 2 * 10.0:>20}{0.0:>20}")
    for k in range(1, n + 1):
        nodes = 2 * k - 1, 2 * k + 1, 2 * k + 2, 2 * k
        lines += [f"/SHELL/{k}", radioss_column(100 + k, *nodes)]
        lines += [f"/PART/{k}", "skin", radioss_column(k + 10, 5)]
        lines += [f"/PROP/SHELL/{k + 10}", "skin", radioss_column(20 + k), ""]
        lines.append(f"{5:>10}{'':10}{0.9:>20}")
    return read_part_deck(written_deck(folder, *lines, "/END", name="a.rad"))


def test_each_property_of_openradioss_has_a_stack(tmp_path, caplog):
    """Elements of other properties are a group without fibres."""
    read = radioss_parts(tmp_path, 3)
    fibres = straight(read.mesh, [True, True, False])
    files = write_part_deck(tmp_path / "out", read, fibres, 0.4)
    lines = files[1].read_text().splitlines()
    stacks = [i for i, x in enumerate(lines) if x.startswith("/STACK")]
    assert [lines[i + 2].strip() for i in stacks] == ["21", "22"]
    assert lines[-2:] == ["NOT_COVERED", radioss_column(103)]
    assert caplog.messages[-1].endswith("does not cover element(s) 103 of part 3")


def test_a_material_that_is_not_defined_is_reported(tmp_path, caplog):
    """In Abaqus and OpenRadioss; case does not count."""
    path = written_deck(tmp_path, *NODES, *QUADS, "*Material, name=Cloth")
    decks = read_part_deck(path), radioss_parts(tmp_path, 1)
    for read, own in zip(decks, ("CLOTH", "5"), strict=True):
        for material in (own, "7"):
            fibres = straight(read.mesh)
            write_part_deck(tmp_path / "out", read, fibres, 0.4, material)
    assert [x for x in caplog.messages if "/PROP/" not in x] == [
        f"{read.path}: the material 7 is not defined in the deck or its include files: "
        "define it"
        for read in decks
    ]


def test_numbers_of_nastran_have_exponents_without_letters(tmp_path):
    grids = ["GRID,1,,1.5-3,-2.+1,0.", "GRID,2,,1.D+1,-.2E2,", "GRID,3,,10.,5.,"]
    read = read_part_deck(
        written_deck(tmp_path, *grids, "CTRIA3,5,1,1,2,3", name="a.nas")
    )
    expected = [[1.5e-3, 10, 10], [-20, -20, 5], [0, 0, 0]]
    np.testing.assert_array_equal(read.mesh.points, expected)
    assert read.sets == {"property 1": np.array([0])}


def test_nodes_of_nastran_may_be_in_other_coordinate_systems(tmp_path):
    """Rectangular in a system with z along x and x along y; others about its z."""
    lines = ["CORD2R,1,0,10.,0.,0.,11.,0.,0.", ",10.,1.,0."]
    lines += ["CORD2C,2,1,0.,0.,0.,0.,0.,1.", ",1.,0.,0."]
    lines += ["CORD2S,3,1,0.,0.,0.,0.,0.,1.", ",1.,0.,0.", "GRDSET,,1"]
    lines += ["GRID,1,,2.,3.,5.", "GRID,2,2,4.,90.,1.", "GRID,3,3,4.,90.,180."]
    lines += ["CTRIA3,9,1,1,2,3"]
    read = read_part_deck(written_deck(tmp_path, *lines, name="a.dat"))
    expected = [[15, 2, 3], [11, 0, 4], [10, -4, 0]]
    np.testing.assert_allclose(read.mesh.points.T, expected, atol=1e-12)


@pytest.mark.parametrize("inn", [1, 2])
def test_angles_of_lsdyna_with_invariant_node_numbering(tmp_path, inn):
    """The axis is halfway between the middle lines, turned by −45°."""
    xy = [(0, 0), (10, 0), (20, 10), (0, 10)]
    nodes = [f"{i},{x},{y},0." for i, (x, y) in enumerate(xy, 1)]
    lines = ["*KEYWORD", "*CONTROL_ACCURACY", f"1,{inn}", "*NODE", *nodes]
    lines += ["*ELEMENT_SHELL", "8,1,1,2,3,4", "*END"]
    read = read_part_deck(written_deck(tmp_path, *lines, name="a.k"))
    files = write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4)
    card = files[0].read_text().splitlines()[-2]
    one, two = np.array([15.0, 0]), np.array([5.0, 10.0])
    middle = unit(one) + unit(two)
    angle = np.degrees(np.arctan2(middle[1], middle[0])) - 45 if inn == 2 else 0.0
    assert float(card[64:80]) == pytest.approx(-angle, abs=1e-9)


# Refused decks and arguments

FLAT = [*TRIANGLE[:2], "GRID,3,,2.,0.,0."]
REFUSED = [
    ("a.txt", ["1"], r"decks of parts can be read only from \.inp"),
    ("a.inp", ["*Include, input=b"], r"'b', which a\.inp includes, does not"),
    ("a.inp", ["*Include, input=a.inp"], r"the file .*a\.inp includes itself"),
    ("a.inp", NODES, "the deck contains no shells"),
    ("a.inp", [*NODES, "*Ngen", "1, 2"], r"\*NGEN: this keyword is not sup"),
    ("a.inp", [*NODES[:-1], *QUADS], "node 6 of element 7 is not"),
    ("a.inp", [*NODES, *QUADS, *QUADS], "element number 11 is used twice"),
    ("a.inp", ["*Instance, name=q, part=Q"], r"\*INSTANCE: the part 'Q' is not"),
    ("a.bdf", [*FLAT, "CTRIA3,9,1,1,2,3"], "element 9 has no area"),
    ("a.bdf", ["GRID,3,4,0.,0.,0."], "GRID 3: it is in the coordinate system 4"),
    ("a.k", ["*KEYWORD", "*INCLUDE_PATH", "b"], r"\*INCLUDE_PATH is not"),
    ("a.bdf", [*FLAT, "=,9,*1,=="], "= 9: repeated fields"),
    ("a.bdf", [*FLAT, "GRID,4,,*1.,=,="], r"GRID 4: repeated fields \(=, \*1\) are no"),
    ("a.k", ["*KEYWORD I10=Y"], r"\*KEYWORD: the option I10=Y is not supported"),
    ("a.k", ["*KEYWORD LONG = Y"], "the option LONG=Y is not supported"),
    ("a.k", ["1"], "the file does not begin with"),
    ("a.rad", ["/TRANSFORM/TRA/1"], "/TRANSFORM/TRA/1: nodes are moved"),
]


@pytest.mark.parametrize(("name", "lines", "message"), REFUSED)
def test_a_deck_that_cannot_be_read_is_refused_in_one_line(
    tmp_path, name, lines, message
):
    path = written_deck(tmp_path, *lines, name=name)
    with pytest.raises(MeshError, match=message) as caught:
        read_part_deck(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@st.composite
def hostile_decks(draw, form):
    seed = draw(seeds)
    with tempfile.TemporaryDirectory() as folder:
        content = deck(folder, form, seed, damage=False).path.read_bytes()
    return seed, form, *draw(damaged(content))


@unlogged()
def attempt(hostile):
    """A damaged deck is refused, or its copy has the same elements and positions."""
    seed, form, content, damage = hostile
    made = deck(".", form, seed, damage=False)
    made.path.write_bytes(content)
    try:
        read = read_part_deck(made.path)
        fibres = fibres_on(read.mesh)
        if not fibres.covered.any():
            return RIGHT
        again = read_part_deck(write_part_deck("out", read, fibres, REST)[0])
    except MeshError as error:
        return rejected_if_damaged(error, damage)
    expect_equal("labels", again.labels.tolist(), read.labels.tolist())
    expect_close("positions", again.mesh.points, read.mesh.points, 0.0)
    return RIGHT


@pytest.mark.parametrize("form", FORMATS)
def test_a_damaged_deck_is_refused_or_copied(form):
    Family(f"part {form}", {"": hostile_decks(form)}, attempt, 1000).check(8)


def test_arguments_that_do_not_fit_are_refused(tmp_path):
    read = read_part_deck(written_deck(tmp_path, *NODES, *QUADS))
    fibres, out = straight(read.mesh), tmp_path / "out"
    one = drape.ToolMesh(read.mesh.points, (read.mesh.cells[0][:, :1],))
    none = straight(read.mesh, [False, False])
    for message, folder, given, thickness in (
        ("in the 2 elements of the deck, not in 1", out, straight(one), 0.4),
        ("must be positive, a number or of shape", out, fibres, 0.0),
        ("must be positive, a number or of shape", out, fibres, np.ones(3)),
        ("does not cover any element", out, none, 0.4),
        ("element 7 has no section: specify the material", out, fibres, 0.4),
    ):
        with pytest.raises(ValueError, match=message):
            write_part_deck(folder, read, given, thickness)
    cards = written_deck(tmp_path, *TRIANGLE, "CTRIA3,9,1,1,2,3", name="a.bdf")
    read = read_part_deck(cards)
    for message, given in (
        ("the properties define the material: omit it", {"material": "M"}),
        ("CalculiX requires an .inp file", {"calculix": True}),
    ):
        with pytest.raises(MeshError, match=message):
            write_part_deck(out, read, straight(read.mesh), 0.4, **given)


def test_a_deck_with_fibres_is_not_written_twice(tmp_path):
    path = written_deck(tmp_path, *NODES, *QUADS, *SECTION)
    read = read_part_deck(path)
    first = write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4)
    again = read_part_deck(first[0])
    with pytest.raises(MeshError, match=r"includes a_fibres\.inp already"):
        write_part_deck(tmp_path / "more", again, straight(again.mesh), 0.4)


def test_membranes_have_no_layers(tmp_path):
    cells = ["*Element, type=M3D4R", "11, 1, 2, 3, 4"]
    read = read_part_deck(written_deck(tmp_path, *NODES, *cells))
    with pytest.raises(MeshError, match="element 11 is a membrane M3D4R"):
        write_part_deck(tmp_path / "out", read, straight(read.mesh), 0.4, "M")
