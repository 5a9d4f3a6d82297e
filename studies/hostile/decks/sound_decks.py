"""Writes sound decks of Abaqus and OpenRadioss."""

from collections.abc import Iterator

import numpy as np
from numpy.random import Generator

# Elements along x and y of the mesh of a deck.
_SIZE = 3, 2


def abaqus(rng: Generator) -> bytes:
    """A deck with a mesh, directions of each element, and a fabric."""
    parts = [_mesh(rng), *_in_any_order([_directions(rng), _fabric(rng)], rng)]
    return "\n".join(line for part in parts for line in part).encode() + b"\n"


def radioss(rng: Generator) -> bytes:
    """A deck with LAW58 or LAW158 and its functions."""
    law58 = bool(rng.integers(0, 2))
    name = str(rng.choice(["LAW58", "FABR_A"] if law58 else ["LAW158", "FABR_NL"]))
    lines = ["#RADIOSS STARTER", f"/MAT/{name}/{rng.integers(1, 99)}", "cloth"]
    lines += [_card((0, 2, 1e-9)), *(_law58(rng) if law58 else _law158(rng))]
    for number, last in ((1, 0.1), (2, 0.2), (3, 60.0)):
        lines += [f"/FUNCT/{number}", "curve", "# argument, value"]
        x = np.linspace(0, last, int(rng.integers(2, 6)))
        y = np.cumsum(np.append(0.0, rng.uniform(0.1, 2.0, len(x) - 1)))
        rows = zip(x.tolist(), y.tolist(), strict=True)
        lines += [_card((0, 2, a), (2, 2, b)) for a, b in rows]
    return "\n".join([*lines, "/END", ""]).encode()


def _in_any_order(parts: list, rng: Generator) -> list:
    return [parts[i] for i in rng.permutation(len(parts))]


def _mesh(rng: Generator) -> Iterator[str]:
    nx, ny = _SIZE
    yield "*HEADING"
    yield "a deck"
    yield "*NODE"
    for j in range(ny + 1):
        for i in range(nx + 1):
            dx, dy = rng.uniform(-0.2, 0.2, 2).round(3).tolist()
            yield f"{1 + i + j * (nx + 1)}, {i + dx}, {j + dy}, 0."
    yield "*ELEMENT, TYPE=M3D4R, ELSET=PLY"
    for j in range(ny):
        for i in range(nx):
            a = 1 + i + j * (nx + 1)
            yield f"{11 + i + j * nx}, {a}, {a + 1}, {a + nx + 2}, {a + nx + 1}"


def _directions(rng: Generator) -> Iterator[str]:
    """Points a and b, or angles, for all elements but some that have the default."""
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
        yield (
            f"{element}, {turn}"
            if angles
            else f"{element}, {x}, {y}, 0., {-y}, {x}, 0."
        )
    yield "*MEMBRANE SECTION, ELSET=PLY, MATERIAL=CLOTH, ORIENTATION=ORI"
    yield "0.25,"


def _fabric(rng: Generator) -> Iterator[str]:
    yield "*MATERIAL, NAME=CLOTH"
    if rng.integers(0, 2):
        yield "*DENSITY"
        yield "1e-09,"
    yield "*FABRIC"
    for component, largest in (("1", 0.05), ("2", 0.03), ("SHEAR", 1.0)):
        yield f"*UNIAXIAL, COMPONENT={component}"
        one_sided = component != "SHEAR" and bool(rng.integers(0, 2))
        direction = ", DIRECTION=TENSION" if one_sided else ""
        beyond = str(rng.choice(["LINEAR", "CONSTANT"]))
        yield f"*LOADING DATA{direction}, EXTRAPOLATION={beyond}"
        strain = np.linspace(0, largest, int(rng.integers(2, 6))).tolist()
        stress = np.cumsum(np.append(0.0, rng.uniform(0.1, 9.0, len(strain) - 1)))
        for s, e in zip(stress.tolist(), strain, strict=True):
            yield f"{s}, {e}"


def _law58(rng: Generator) -> Iterator[str]:
    E = rng.uniform(100, 1000, 2).round(1).tolist()
    yield _card((0, 2, E[0]), (2, 2, 10.0), (4, 2, E[1]), (8, 2, 0.01))
    yield _card((0, 2, 0.5), (2, 2, 5.0), (4, 2, 40.0))
    yield _card((0, 2, 0.05))
    yield _card((0, 1, 1), (1, 1, 1), (2, 2, 0.05), (4, 2, 0.04))
    if rng.integers(0, 2):
        yield _card((0, 1, 1), (2, 2, 2.0))
        yield _card((0, 1, 2))
        yield _card((0, 1, 3))


def _law158(rng: Generator) -> Iterator[str]:
    springs = rng.uniform(0.1, 5.0, 3).round(2).tolist()
    yield _card(
        (0, 2, 0.05), (2, 2, 0.04), *((4 + 2 * i, 2, k) for i, k in enumerate(springs))
    )
    yield _card((0, 2, 0.0))
    yield _card((0, 1, 1))
    yield _card((0, 1, 2), (2, 2, 1.5))
    yield _card((0, 1, 3))


def _card(*fields: tuple[int, int, object]) -> str:
    """A line of fields: first column of ten characters, how many columns, value."""
    line = " " * 100
    for first, columns, value in fields:
        word = str(value).rjust(10 * columns)
        line = line[: 10 * first] + word + line[10 * (first + columns) :]
    return line.rstrip()
