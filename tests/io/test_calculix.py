"""Decks for CalculiX: a plate with a woven ply vibrates as laminate theory says."""

import os
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial, legendre
from scipy.linalg import eigh

from skfem_textile import drape
from skfem_textile.io import read_part_deck, write_part_deck

SIDE, REST, DENSITY = 100.0, 0.5, 1.5e-9  # mm, mm, t/mm³
E1, E2, NU, G = 130e3, 10e3, 0.3, 5e3  # N/mm²


def plate(path, n, reverse=True):
    """A plate of n × n elements on supports; two are triangles, others reversed."""
    s = np.linspace(0, SIDE, n + 1).tolist()
    number = 1001 + 3 * np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    at = np.ndindex(n + 1, n + 1)
    nodes = [f"{number[i, j]}, {s[i]!r}, {s[j]!r}, 0." for i, j in at]
    quads, triangles, label = [], [], 5001
    for i, j in np.ndindex(n, n):
        x = [number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]]
        cells = (
            [x[:3], [x[0], *x[2:]]]
            if i == j == 2
            else [x[:: -1 if reverse and (i + j) % 2 else 1]]
        )
        for cell in cells:
            row = ", ".join(map(str, [label, *cell]))
            (quads if len(cell) == 4 else triangles).append(row)
            label += 2
    edge = np.unique([number[0], number[-1], number[:, 0], number[:, -1]])
    lines = ["*HEADING", "plate", "*NODE", *nodes]
    lines += ["*ELEMENT, TYPE=S4R, ELSET=SKIN", *quads]
    lines += ["*ELEMENT, TYPE=S3, ELSET=SKIN", *triangles]
    lines += ["*NSET, NSET=EDGE", *(f"{k}," for k in edge)]
    lines += ["*SHELL SECTION, ELSET=SKIN, MATERIAL=CFRP", "0.9"]
    lines += ["*MATERIAL, NAME=CFRP", "*DENSITY", f"{DENSITY}", "*ELASTIC, TYPE=LAMINA"]
    lines += [f"{E1}, {E2}, {NU}, {G}, {G}, 3500.", "*BOUNDARY", "EDGE, 1, 3"]
    lines += ["*STEP", "*FREQUENCY", "1", "*END STEP", ""]
    path.write_text("\n".join(lines))
    return read_part_deck(path)


def woven(mesh, warp, weft):
    """Fibres at angles to the x axis in radians."""
    n = mesh.n_elements
    axes = (np.tile([[np.cos(a)], [np.sin(a)], [0.0]], n) for a in (warp, weft))
    shear = np.full(n, warp + np.pi / 2 - weft)
    axis = np.array([1.0, 0.0, 0.0])
    return drape.FibresInSpace(mesh, mesh.normals(), *axes, shear, axis)


def stiffness(angle):
    """Plane stress stiffness of a lamina turned by an angle, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    scale = 1 / (1 - NU**2 * E2 / E1)
    own = [
        [E1 * scale, NU * E2 * scale, 0],
        [NU * E2 * scale, E2 * scale, 0],
        [0, 0, G],
    ]
    strain = [[c * c, s * s, c * s], [s * s, c * c, -c * s]]
    strain = np.array([*strain, [-2 * c * s, 2 * c * s, c * c - s * s]])
    return strain.T @ own @ strain


def frequency(warp, weft):
    """First frequency in Hz of the simply supported plate, by the Ritz method.

    Thin plate; polynomials that vanish on its sides.
    """
    thick, n = REST / np.cos(warp + np.pi / 2 - weft), 10
    D = (stiffness(warp) + stiffness(weft)) / 2 * thick**3 / 12
    x, w = legendre.leggauss(30)
    shapes = [Polynomial([1, 0, -1]) * Polynomial.basis(k) for k in range(n)]
    f = np.array([[p.deriv(k)(x) if k else p(x) for k in range(3)] for p in shapes])
    half = SIDE / 2

    def product(a, b):
        along, across = (
            np.einsum("iq,jq,q->ij", f[:, a[k]], f[:, b[k]], w)
            * half ** (1 - a[k] - b[k])
            for k in (0, 1)
        )
        return np.kron(along, across)

    curvatures = [(2, 0), (0, 2), (1, 1)]
    factor = np.outer([1, 1, 2], [1, 1, 2]) * D
    K = sum(
        factor[i, j] * product(curvatures[i], curvatures[j])
        for i, j in np.ndindex(3, 3)
    )
    M = DENSITY * thick * product((0, 0), (0, 0))
    return float(np.sqrt(eigh(K, M, eigvals_only=True)[0]) / (2 * np.pi))


def solved(folder):
    """First frequency in Hz computed by CalculiX."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = ["ccx", "-i", "plate_ccx"]
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=60)
    rows = [x.split() for x in (folder / "plate_ccx.dat").read_text().splitlines()]
    return next(float(row[3]) for row in rows if row[:1] == ["1"])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="requires CalculiX")
def test_turned_fibres_change_the_frequency_of_a_plate_as_theory_says(tmp_path):
    """Within 1 %, also with sheared fibres."""
    deck = plate(tmp_path / "plate.inp", 8)
    found, expected = [], []
    for degrees in ((0, 90), (30, 120), (30, 100)):
        angles = np.radians(degrees)
        fibres, out = woven(deck.mesh, *angles), tmp_path / "out"
        write_part_deck(out, deck, fibres, REST, calculix=True)
        found.append(solved(out))
        expected.append(frequency(*angles))
    np.testing.assert_allclose(found, expected, rtol=0.01)
    np.testing.assert_allclose(
        found[1] / found[0], expected[1] / expected[0], rtol=0.01
    )
    assert expected[1] / expected[0] > 1.2


def test_shells_are_raised_to_quadratic_ones_in_classes(tmp_path):
    deck = plate(tmp_path / "plate.inp", 3)
    n = deck.mesh.n_elements
    fibres = woven(deck.mesh, 0.0, np.pi / 2)
    turn = np.radians(0.02) * np.arange(n)  # 0.18° in all
    fibres.warp[:2] = np.cos(turn), np.sin(turn)
    write_part_deck(tmp_path / "out", deck, fibres, REST, calculix=True)
    text = (tmp_path / "out" / "plate_ccx.inp").read_text()
    rows = [x.split(", ") for x in text.splitlines() if not x.startswith(("**", "*"))]
    sizes = {
        row[0]: len(row) - 1 for row in rows if "5000" < row[0] < "51" and len(row) > 5
    }
    kinds = dict(zip(map(str, deck.labels), deck.types, strict=True))
    assert sizes == {k: 6 if kind == "S3" else 8 for k, kind in kinds.items()}
    at = text.index("*NSET, NSET=EDGE\n", text.index("*NSET, NSET=EDGE\n") + 1)
    between = (
        text[at:].split("\n*")[0].split("\n", 1)[1].replace("\n", ", ").split(", ")
    )
    assert len(between) == 12  # one between each two of the 12 nodes at corners
    # Of ten elements with both normals; directions in three classes at most.
    assert 4 <= text.count("*SHELL SECTION, COMPOSITE") <= 6
    constants = text.split("*ELASTIC, TYPE=ENGINEERING CONSTANTS\n")[1].split("\n")[:2]
    expected = [E1, E2, E2, NU, 0, 0, G, G]
    assert [float(x) for x in constants[0].split(", ")] == expected
    assert "\n*ELASTIC, TYPE=LAMINA" not in text


def isotropic(path, n):
    """The plate of an isotropic material that is as thick as the ply."""
    plate(path, n, reverse=False)
    text = path.read_text().replace("\n0.9\n", f"\n{REST}\n")
    text = text.replace("*ELASTIC, TYPE=LAMINA", "*ELASTIC")
    path.write_text(re.sub(rf"\n{E1}.*", "\n70e3, 0.3", text))
    return read_part_deck(path)


def covering(mesh, mask):
    """Fibres along x and y in some elements."""
    fibres, none = woven(mesh, 0.0, np.pi / 2), np.where(mask, 0.0, np.nan)
    axes = {"warp": fibres.warp + none, "weft": fibres.weft + none}
    return replace(fibres, **axes, shear_angle=fibres.shear_angle + none)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="requires CalculiX")
def test_frequencies_of_an_isotropic_plate_do_not_depend_on_the_covered_part(tmp_path):
    deck, found = isotropic(tmp_path / "plate.inp", 8), []
    x, y, _ = deck.mesh.centres()
    for mask in (x > 0, x < 40, np.hypot(x - 50, y - 50) < 30, (x + y) % 25 < 12):
        fibres = covering(deck.mesh, mask)
        write_part_deck(tmp_path / "out", deck, fibres, REST, calculix=True)
        found.append(solved(tmp_path / "out"))
    np.testing.assert_allclose(found, found[0], rtol=5e-3)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="requires CalculiX")
def test_a_thick_section_elsewhere_does_not_change_the_frequency(tmp_path):
    """Though plies are filled to its thickness."""
    path, found = tmp_path / "plate.inp", []
    isotropic(path, 8)
    text, corners = path.read_text(), ["200, 0", "210, 0", "210, 10", "200, 10"]
    far = ["*NODE, NSET=FAR", *(f"{9001 + i}, {x}, 0" for i, x in enumerate(corners))]
    far += ["*ELEMENT, TYPE=S4, ELSET=FAR", "9001, 9001, 9002, 9003, 9004"]
    far += ["*BOUNDARY", "FAR, 1, 3", "*SHELL SECTION, ELSET=FAR, MATERIAL=CFRP"]
    for thick in (REST, 20.0):
        own = "\n".join([*far, f"{thick}", "*NSET, NSET=EDGE"])
        path.write_text(text.replace("*NSET, NSET=EDGE", own))
        deck = read_part_deck(path)
        fibres = covering(deck.mesh, deck.labels != 9001)
        write_part_deck(tmp_path / "out", deck, fibres, REST, calculix=True)
        found.append(solved(tmp_path / "out"))
    assert found[1] == pytest.approx(found[0], rel=1e-3)


def test_all_sections_are_filled_to_one_thickness(tmp_path):
    """Of as many layers; with names that the deck does not have."""
    deck = isotropic(tmp_path / "plate.inp", 3)
    text = deck.path.read_text()
    names = ["FILLING", "CLASS_0_0", "NOT_COVERED_SKIN"]
    own = [
        f"*MATERIAL, NAME={names[0]}",
        *(f"*ELSET, ELSET={x}\n5001" for x in names[1:]),
    ]
    deck.path.write_text(text.replace("*STEP", "\n".join([*own, "*STEP"])))
    deck = read_part_deck(deck.path)
    mask = deck.mesh.centres()[0] < 40
    thick = np.full(mask.size, 0.3)
    fibres = covering(deck.mesh, mask)
    write_part_deck(tmp_path / "out", deck, fibres, thick, calculix=True)
    text = (tmp_path / "out" / "plate_ccx.inp").read_text()
    sections = text.split("*SHELL SECTION, COMPOSITE, ELSET=")[1:]
    assert len(sections) == 2
    for section in sections:
        name, *rows = section.split("\n*")[0].strip().splitlines()
        assert name not in names
        layers = [row.split(", ") for row in rows]
        assert [row[2] for row in layers] == ["FILLING_2", *4 * ["CFRP"], "FILLING_2"]
        assert sum(float(row[0]) for row in layers) == pytest.approx(1.01 * REST)
    assert len(set(re.findall(r"\n\*ELSET, ELSET=(.*)", text))) == 4


def test_a_section_that_is_not_filled_is_reported(tmp_path, caplog):
    deck = isotropic(tmp_path / "plate.inp", 3)
    text = deck.path.read_text()
    deck.path.write_text(text.replace("ELSET=SKIN, MAT", "ELSET=SKIN, OFFSET=0.5, MAT"))
    deck = read_part_deck(deck.path)
    fibres = covering(deck.mesh, deck.mesh.centres()[0] < 40)
    write_part_deck(tmp_path / "out", deck, fibres, REST, calculix=True)
    assert "*SHELL SECTION of SKIN keeps its thickness for CalculiX" in caplog.text
    assert "of SKIN: its layers have no OFFSET in CalculiX" in caplog.text
    text = (tmp_path / "out" / "plate_ccx.inp").read_text()
    assert "*SHELL SECTION, ELSET=NOT_COVERED_SKIN, OFFSET=0.5, MATERIAL=CFRP" in text


def in_assembly(path, angle):
    """The plate as a part, whose instance is turned about the x axis and moved."""
    lines = path.read_text().splitlines()
    first, last = lines.index("*NODE"), lines.index("*MATERIAL, NAME=CFRP")
    edge = lines.index("*NSET, NSET=EDGE")
    section = lines.index("*SHELL SECTION, ELSET=SKIN, MATERIAL=CFRP")
    head, mesh, nodes = lines[:first], lines[first:edge], lines[edge + 1 : section]
    own = [*head, "*PART, NAME=P", *mesh, *lines[section:last], "*END PART"]
    own += ["*ASSEMBLY, NAME=A", "*INSTANCE, NAME=P-1, PART=P", "5., 0., 3."]
    own += [f"0., 0., 0., 1., 0., 0., {angle}", "*END INSTANCE"]
    own += ["*NSET, NSET=EDGE, INSTANCE=P-1", *nodes, "*END ASSEMBLY", *lines[last:]]
    path.write_text("\n".join([*own, ""]))
    return read_part_deck(path)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="requires CalculiX")
def test_a_moved_instance_vibrates_as_the_plate_itself(tmp_path):
    plate(tmp_path / "plate.inp", 8)
    deck = in_assembly(tmp_path / "plate.inp", 90)  # in the plane of x and z
    flat = woven(deck.mesh, *np.radians([30, 120]))
    x, y, z = flat.warp
    turned = {"warp": np.array([x, z, y])}
    x, y, z = flat.weft
    turned["weft"] = np.array([x, z, y])
    fibres = replace(flat, **turned)
    assert np.abs(deck.mesh.normals()[1]).min() > 1 - 1e-9
    write_part_deck(tmp_path / "out", deck, fibres, REST, calculix=True)
    text = (tmp_path / "out" / "plate_ccx.inp").read_text()
    assert text.count("\n*NSET, NSET=EDGE\n") == 2  # as before, and new nodes
    expected = frequency(*np.radians([30, 120]))
    assert solved(tmp_path / "out") == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("first", [1, 1001])
def test_parts_without_instance_are_left_out(tmp_path, first):
    """Also those with the labels of the part that has one."""
    path = tmp_path / "plate.inp"
    plate(path, 3)
    in_assembly(path, 0)
    nodes = [f"{first + 3 * k}, {k}., {k * k}., 7." for k in range(3)]
    corners = ", ".join(str(first + 3 * k) for k in range(3))
    unused = ["*PART, NAME=TOOL", "*NODE", *nodes, "*ELEMENT, TYPE=S3, ELSET=T"]
    unused += [f"5001, {corners}", "*SHELL SECTION, ELSET=T, MATERIAL=CFRP", "9.0"]
    alone = path.read_text()
    with_another = "\n".join([*unused, "*END PART", "*PART, NAME=P"])
    read = []
    for text in (alone, alone.replace("*PART, NAME=P", with_another, 1)):
        path.write_text(text)
        deck = read_part_deck(path)
        fibres = woven(deck.mesh, 0.0, np.pi / 2)
        write_part_deck(tmp_path / "out", deck, fibres, REST, calculix=True)
        lines = (tmp_path / "out" / "plate_ccx.inp").read_text().splitlines()
        read.append([line for line in lines if not line.startswith("**")])
    assert read[0] == read[1]


def test_decks_with_several_instances_are_not_written_for_calculix(tmp_path, caplog):
    """One line reports it; the copy is written."""
    path = tmp_path / "a.inp"
    lines = ["*Part, name=P", "*Node", "1, 0, 0, 0", "2, 1, 0, 0", "3, 0, 1, 0"]
    lines += ["*Element, type=S3", "1, 1, 2, 3", "*End Part", "*Assembly, name=A"]
    lines += ["*Instance, name=I, part=P", "*End Instance"]
    lines += ["*Instance, name=J, part=P", "9., 0., 0.", "*End Instance"]
    path.write_text("\n".join([*lines, "*End Assembly", ""]))
    deck = read_part_deck(path)
    fibres = woven(deck.mesh, 0.0, np.pi / 2)
    (tmp_path / "out").mkdir()
    files = write_part_deck(tmp_path / "out", deck, fibres, 0.5, "M", calculix=True)
    assert (tmp_path / "out" / "a.inp") in files
    assert not list(tmp_path.glob("out/*_ccx.inp"))
    assert "not written for CalculiX: CalculiX reads decks with one" in caplog.text
