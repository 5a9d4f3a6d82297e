"""Damaged decks of Abaqus and OpenRadioss are rejected, or read as written."""

import contextlib
import io
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from skfem_textile import MeshError
from skfem_textile.cli import main as cli
from skfem_textile.io import read_directions, read_fabric, write_fabric
from skfem_textile.mesh.progress import unlogged
from tests.helpers.decks import card, keyword_blocks
from tests.helpers.hostile import (
    RIGHT,
    Family,
    UnclearError,
    expect_close,
    expect_equal,
    is_clear,
    rejected_if_damaged,
    seeds,
)
from tests.helpers.hostile.damage import damaged

# Given thickness in mm.
THICKNESS = 0.25

# Tolerance between two readers of the same numbers, and for sums of large numbers.
ROUND_OFF = 1e-9

SHOWN = {"directions.vtu", "directions.csv", "directions.inp"}

# Sound decks


def abaqus(rng):
    """A mesh of 3 by 2 elements, directions of each, and a fabric."""
    parts = [*directions(rng)], [*fabric(rng)]
    lines = [*mesh(rng), *(line for i in rng.permutation(2) for line in parts[i])]
    return "\n".join(lines).encode() + b"\n"


def mesh(rng):
    yield from ("*HEADING", "a deck", "*NODE")
    for n in range(12):
        x, y = (np.array([n % 4, n // 4]) + rng.uniform(-0.2, 0.2, 2)).round(3)
        yield f"{1 + n}, {x}, {y}, 0."
    yield "*ELEMENT, TYPE=M3D4R, ELSET=PLY"
    for e in range(6):
        a = 1 + e % 3 + 4 * (e // 3)
        yield f"{11 + e}, {a}, {a + 1}, {a + 5}, {a + 4}"


def directions(rng):
    """Points a and b, or angles, of all elements except some that have the default."""
    angles = bool(rng.integers(0, 2))
    yield "*DISTRIBUTION TABLE, NAME=TABLE"
    yield "ANGLE" if angles else "COORD3D, COORD3D"
    yield "*ORIENTATION, NAME=ORI, SYSTEM=RECTANGULAR"
    yield "1., 0., 0., 0., 1., 0." if angles else "VALUES"
    yield "3, VALUES" if angles else "3, 0."
    yield "*DISTRIBUTION, NAME=VALUES, LOCATION=ELEMENT, TABLE=TABLE"
    yield ", 12.5" if angles else ", 1., 0., 0., 0., 1., 0."
    for element in range(11, 11 + int(rng.integers(0, 7))):
        turn = round(rng.uniform(-180, 180), 6)
        x, y = float(np.cos(turn)), float(np.sin(turn))
        row = f"{turn}" if angles else f"{x}, {y}, 0., {-y}, {x}, 0."
        yield f"{element}, {row}"
    yield "*MEMBRANE SECTION, ELSET=PLY, MATERIAL=CLOTH, ORIENTATION=ORI"
    yield "0.25,"


def fabric(rng):
    yield "*MATERIAL, NAME=CLOTH"
    yield from ("*DENSITY", "1e-09,") if rng.integers(0, 2) else ()
    yield "*FABRIC"
    for component, largest in (("1", 0.05), ("2", 0.03), ("SHEAR", 1.0)):
        yield f"*UNIAXIAL, COMPONENT={component}"
        one_sided = component != "SHEAR" and bool(rng.integers(0, 2))
        direction = ", DIRECTION=TENSION" if one_sided else ""
        beyond = str(rng.choice(["LINEAR", "CONSTANT"]))
        yield f"*LOADING DATA{direction}, EXTRAPOLATION={beyond}"
        for strain, stress in rising(rng, largest, 9.0):
            yield f"{stress}, {strain}"


def rising(rng, last, step):
    """Two to five points of a curve that rises from 0."""
    x = np.linspace(0, last, int(rng.integers(2, 6)))
    y = np.cumsum(np.append(0.0, rng.uniform(0.1, step, len(x) - 1)))
    return zip(x.tolist(), y.tolist(), strict=True)


def radioss(rng):
    """LAW58 or LAW158 and its functions."""
    law58 = bool(rng.integers(0, 2))
    name = str(rng.choice(["LAW58", "FABR_A"] if law58 else ["LAW158", "FABR_NL"]))
    lines = ["#RADIOSS STARTER", f"/MAT/{name}/{rng.integers(1, 99)}", "cloth"]
    lines += [card((0, 1e-9))]
    if law58:
        E = rng.uniform(100, 1000, 2).round(1).tolist()
        lines += [card((0, E[0]), (2, 10.0), (4, E[1]), (8, 0.01))]
        lines += [card((0, 0.5), (2, 5.0), (4, 40.0)), card((0, 0.05))]
        lines += [card((0, 1), (1, 1), (2, 0.05), (4, 0.04))]
        if rng.integers(0, 2):
            lines += [card((0, 1), (2, 2.0)), card((0, 2)), card((0, 3))]
    else:
        springs = rng.uniform(0.1, 5.0, 3).round(2).tolist()
        fields = ((4 + 2 * i, k) for i, k in enumerate(springs))
        lines += [card((0, 0.05), (2, 0.04), *fields), card((0, 0.0)), card((0, 1))]
        lines += [card((0, 2), (2, 1.5)), card((0, 3))]
    for number, last in ((1, 0.1), (2, 0.2), (3, 60.0)):
        lines += [f"/FUNCT/{number}", "curve", "# argument, value"]
        lines += [card((0, x), (2, y)) for x, y in rising(rng, last, 2.0)]
    return "\n".join([*lines, "/END", ""]).encode()


@st.composite
def decks(draw, write):
    seed = draw(seeds)
    return seed, *draw(damaged(write(np.random.default_rng(seed))))


# Expected content of a deck


@unlogged()
def attempt_abaqus(deck):
    seed, content, damage = deck
    path = Path("deck.inp")
    path.write_bytes(content)
    if seed % 6 == 0:
        return show(path, damage)
    try:
        directions, cloth = read_directions(path), read(path)
    except MeshError as error:
        return rejected_if_damaged(error, damage)
    check_loading_data(cloth, content)
    weft = directions.weft / np.hypot(*directions.weft)
    axes = first_axes(content)
    if axes is not None:
        expect_close("weft", weft, axes, 2e-5)
    check_written(cloth)
    return RIGHT


@unlogged()
def attempt_radioss(deck):
    """Laws vanish at rest, and their values are slopes of the energy."""
    seed, content, damage = deck
    path = Path("deck.rad")
    path.write_bytes(content)
    try:
        cloth = read(path)
    except MeshError as error:
        return rejected_if_damaged(error, damage)
    rest, step = np.zeros((2, 1)), 1e-6
    expect_close("tension at rest", cloth.tensions.value(rest), 0.0, 1e-9)
    expect_close("moment at rest", cloth.shear_law.value(np.zeros(1)), 0.0, 1e-9)
    strain = np.random.default_rng(seed).uniform(0.0, 0.03, (2, 3))
    tension = np.array(cloth.tensions.value(strain))
    for i in range(2):
        moved = step * np.eye(2)[:, [i]]
        ahead, behind = (cloth.tensions.energy(strain + s * moved) for s in (1, -1))
        slope = (ahead - behind) / (2 * step)
        tolerance = 1e-3 * np.abs(tension[i]) + 1e-4 * np.abs(tension).max()
        expect_close("slope", (slope - tension[i]) / (tolerance + 1e-300), 0.0, 1.0)
    check_written(cloth)
    return RIGHT


def read(path):
    content = read_fabric(path, THICKNESS)
    if not all(map(is_clear, content.ignored)):
        raise UnclearError(content.ignored)
    return content.fabric


def check_loading_data(cloth, content):
    """Check that every point of the loading data is on its law."""
    points, component = {}, ""
    for keyword, parameters, rows in keyword_blocks(content):
        if keyword == "UNIAXIAL":
            component = parameters.get("COMPONENT", "").upper()
        elif keyword == "LOADING DATA":
            values = [(float(row[1]), float(row[0])) for row in rows]
            points.setdefault(component, []).extend(values)
    laws = dict(zip(("2", "1", "SHEAR"), cloth.laws, strict=True))
    for component, rows in points.items():
        strain, stress = np.array(rows).T
        inner = getattr(laws[component], "law", laws[component])  # in tension only
        x, expected = np.log1p(strain), THICKNESS * (1 + strain) * stress
        if component == "SHEAR":
            x, expected = strain, THICKNESS * stress
            if (strain < 0).any() and (strain > 0).any():
                x, expected = -x, -expected
        scale = ROUND_OFF * np.abs(expected) + 1e-300
        expect_close(component, (inner.value(x) - expected) / scale, 0.0, 1.0)


def first_axes(content):
    """First local axes in the plane, of the only distribution; shape (2, n).

    None where the orientation rotates about another axis, or by an additional angle.
    """
    rows = {keyword: rows for keyword, _, rows in keyword_blocks(content)}
    point, second = rows["ORIENTATION"][0], rows["ORIENTATION"][1:2]
    table = [word.upper() for row in rows["DISTRIBUTION TABLE"] for word in row if word]
    if table == ["ANGLE"]:
        usual = point == ["1.", "0.", "0.", "0.", "1.", "0."]
        if not usual or second != [["3", "VALUES"]]:
            return None
    elif second not in ([["3", "0."]], []):
        return None
    axes = {}
    for element, *words in rows["DISTRIBUTION"]:
        if not element.isdigit() and element:
            return None
        axes[element and int(element)] = [float(word) for word in words if word]
    chosen = [axes.get(int(element), axes.get("")) for element, *_ in rows["ELEMENT"]]
    if table == ["ANGLE"]:
        turn = np.radians([value[0] for value in chosen])
        return np.stack([np.cos(turn), np.sin(turn)])
    x = np.array(chosen)[:, :3]
    return (x / np.linalg.norm(x, axis=1, keepdims=True)).T[:2]


def check_written(cloth):
    """Check that the fabric is read back from its file."""
    write_fabric("fabric.json", cloth)
    again = read_fabric("fabric.json").fabric
    laws = [repr((one.tensions, one.shear_law)) for one in (again, cloth)]
    expect_equal("laws that were written", *laws)


def show(path, damage):
    """Show a deck on the command line: all files, or none and one line."""
    out, printed, heard = Path("out"), io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(heard):
        code = cli.main(["show", str(path), "--no-render", "--out", "out"])
    message = heard.getvalue().removesuffix("\n")
    if code == 2 and not out.exists() and not printed.getvalue():
        return rejected_if_damaged(message, damage)
    if code or {file.name for file in out.iterdir()} != SHOWN:
        raise UnclearError(f"code {code}: {message}")
    return RIGHT


FAMILIES = (
    Family("deck inp", {"": decks(abaqus)}, attempt_abaqus, 3000),
    Family("deck rad", {"": decks(radioss)}, attempt_radioss, 2000),
)


def test_a_damaged_deck_of_abaqus_is_rejected_or_read_as_written():
    FAMILIES[0].check(20)


def test_a_damaged_deck_of_openradioss_is_rejected_or_has_consistent_laws():
    FAMILIES[1].check(20)
