"""A plain reader of the numbers of a deck, apart from the library's."""

import re

import numpy as np
from numpy import ndarray

#: Loading data by component: strains and stresses, one row for each point.
Tables = dict[str, list[tuple[float, float]]]


def _blocks(content: bytes) -> list[tuple[str, list[list[str]]]]:
    """Keyword lines in capitals, and the words of the lines after each."""
    text = content.decode(errors="replace")
    lines = [line.strip() for line in re.split(r"\r\n|\n|\r", text)]
    found: list[tuple[str, list[list[str]]]] = []
    head = ""
    for line in lines:
        if not line or line.startswith("**"):
            continue
        if head.endswith(","):
            head += line
            found[-1] = (head.upper(), [])
        elif line.startswith("*"):
            head = line
            found.append((line.upper(), []))
        else:
            found[-1][1].append([word.strip() for word in line.split(",")])
        if not line.startswith("*") and not line.endswith(","):
            head = ""
    return found


def loading_data(content: bytes) -> Tables:
    """Strains and stresses of the only fabric of a deck."""
    tables: Tables = {}
    component = ""
    for head, rows in _blocks(content):
        name = " ".join(head[1:].split(",")[0].split())
        if name == "UNIAXIAL":
            component = re.sub(r"\s", "", head).partition("COMPONENT=")[2].split(",")[0]
        elif name == "LOADING DATA":
            points = [(float(row[1]), float(row[0])) for row in rows]
            tables.setdefault(component, []).extend(points)
    return tables


def first_axes(content: bytes, elements: list[int]) -> ndarray | None:
    """First local axes in the plane, of the only distribution; shape (2, n).

    None where the orientation turns about another axis, or by an angle of its own.
    """
    every = {
        " ".join(h[1:].split(",")[0].split()): rows for h, rows in _blocks(content)
    }
    points, second = every["ORIENTATION"][0], every["ORIENTATION"][1:2]
    angles = [w.upper() for row in every["DISTRIBUTION TABLE"] for w in row if w] == [
        "ANGLE"
    ]
    usual = points == ["1.", "0.", "0.", "0.", "1.", "0."]
    if angles and not usual:
        return None
    if not angles and second not in ([["3", "0."]], []):
        return None
    if angles and (not second or second[0][0] != "3"):
        return None
    default, own = None, {}
    for row in every["DISTRIBUTION"]:
        values = [float(word) for word in row[1:] if word]
        if row[0] == "":
            default = default or values
        elif row[0].isdigit():
            own[int(row[0])] = values
        else:
            return None
    chosen = [own.get(element, default) for element in elements]
    if angles:
        turn = np.radians([value[0] for value in chosen])
        return np.stack([np.cos(turn), np.sin(turn)])
    x = np.array(chosen)[:, :3]
    return (x / np.linalg.norm(x, axis=1, keepdims=True)).T[:2]


def element_numbers(content: bytes) -> list[int]:
    """Numbers of all elements in their order."""
    rows = [
        row
        for head, rows in _blocks(content)
        if head.split(",")[0] == "*ELEMENT"
        for row in rows
    ]
    return [int(row[0]) for row in rows]
