"""Tables of the study."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields

import numpy as np

from ...common.tables import markdown_table
from ...study import Row
from . import chebyshev
from .cases import FLAT, GROWTH, NET, PUBLISHED, ROLLED, SPHERE, TIME, Case
from .rolled import BIAS, CYLINDER, FAN, SQUARES

#: Head of a column, and what stands in it of a row.
Column = tuple[str, Callable[[Row], object]]

_DEFAULTS = {
    field.name: field.default
    for field in fields(Case)
    if field.name not in ("kind", "parts", "formulation")
}

_CYLINDERS = CYLINDER, BIAS
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_FORMULATION: Column = ("formulation", lambda r: r["formulation"])
_PARTS: Column = ("parts a side", lambda r: r["parts"])
_SOLVES: Column = ("solves", lambda r: r["solves"])
_LARGEST: Column = ("largest error of Γ in °", lambda r: f"{r['largest']:.4f}")
_RMS: Column = ("root mean square in °", lambda r: f"{r['rms']:.4f}")
_SECONDS: Column = ("seconds of processor", lambda r: f"{r['seconds']:.2f}")
_PRESSURE: Column = ("largest error of pressure", lambda r: _share(r["pressure_error"]))


def _share(x: float | None) -> str:
    return "–" if x is None else f"{x:.2%}"


def table(
    rows: Iterable[Row], settings: Sequence[Column], results: Sequence[Column]
) -> str:
    """A table with a line for each row; one that was refused has no results."""
    refused = ["refused", *(len(results) - 1) * ["–"]]
    lines = [
        [f(row) for _, f in settings]
        + (refused if row["refused"] else [f(row) for _, f in results])
        for row in rows
    ]
    return markdown_table([head for head, _ in (*settings, *results)], lines)


def _of(rows: Sequence[Row], kind: str, *different: str) -> list[Row]:
    """Rows of a kind that differ from the ordinary in these settings."""
    return [r for r in rows if r["kind"] == kind and _own(r) == [*different]]


def _own(row: Row) -> list[str]:
    """The settings of a row that are not the ordinary ones."""
    return [name for name, ordinary in _DEFAULTS.items() if row[name] != ordinary]


def refinement(rows: Sequence[Row]) -> str:
    """Error, solves and time of the Chebyshev net on regular meshes."""
    unknowns = "unknowns", lambda r: r["unknowns"]
    settings = _FORMULATION, _PARTS
    results = unknowns, _LARGEST, _RMS, _SOLVES, _SECONDS, _PRESSURE
    own = [r for r in _of(rows, SPHERE) if r["formulation"] != FLAT]
    return table(own, settings, results)


def orders(rows: Sequence[Row]) -> str:
    """Errors of 32 to 128 parts, with softer and stiffer fibres."""
    stretch = "E in N/mm", lambda r: f"{r['stretch']:g}"
    settings = _FORMULATION, stretch, _PARTS
    in_corner = "in the corner in °", lambda r: f"{r['in_corner']:.4f}"
    but_corner = "largest elsewhere in °", lambda r: f"{r['but_corner']:.4f}"
    own = [r for r in _of(rows, SPHERE) if r["parts"] >= 32]
    own += [r for r in _of(rows, SPHERE, "stretch") if r["stretch"] > 1e5]
    return table(own, settings, (_LARGEST, in_corner, but_corner, _RMS))


def distorted(rows: Sequence[Row]) -> str:
    """The same where nodes have moved by 20 %."""
    moved = "nodes moved by 20 %", lambda r: _moved(r)
    tension = (
        "fibre tension in N/mm",
        lambda r: f"{r['least_tension']:.1f} to {r['largest_tension']:.1f}",
    )
    own = _of(rows, SPHERE, "distortion") + _of(rows, SPHERE, "distortion", "halvings")
    results = _LARGEST, _RMS, tension, _PRESSURE
    return table(own, (_FORMULATION, moved, _PARTS), results)


def _moved(row: Row) -> str:
    halvings = row["halvings"]
    if not halvings:
        return "in each mesh anew"
    return f"with {row['parts'] // 2**halvings} parts, then halved"


def other_drapes(rows: Sequence[Row]) -> str:
    """The same with other stiffness, starts and surfaces."""
    words: dict[str, Callable] = {
        "stretch": lambda x: f"E = {x:g} N/mm",
        "surface": lambda x: "sphere of 5000 triangles",
        "start": lambda x: f"start from a {x}",
    }
    own = [
        row
        for name in words
        for row in _of(rows, SPHERE, name)
        if row["stretch"] <= _DEFAULTS["stretch"]
    ]
    different = (
        "what is different",
        lambda r: ", ".join(say(r[k]) for k, say in words.items() if k in _own(r)),
    )
    strain = "fibre strain", lambda r: f"{r['fibre_strain']:.1e}"
    settings = _FORMULATION, _PARTS, different
    return table(own, settings, (_LARGEST, _SOLVES, strain))


def free_edges(rows: Sequence[Row]) -> str:
    """Edges free of load: how far from the net, and with how much less energy."""
    least = _DEFAULTS["tension"]
    own = [r for r in rows if r["kind"] == SPHERE and r["tension"] < least]
    energy = f"energy in N·mm, {chebyshev.energy():.1f} of the net"
    results = (
        _LARGEST,
        _RMS,
        ("median in °", lambda r: f"{r['median']:.2f}"),
        ("Γ in the corner in °", lambda r: f"{r['corner_angle']:.1f}"),
        (energy, lambda r: f"{r['energy']:.1f}"),
        ("elements at risk of wrinkles", lambda r: f"{r['at_risk']:.0%}"),
        ("stable", lambda r: "yes" if r["stable"] else "no"),
        _SOLVES,
    )
    start = "start", lambda r: r["start"]
    pull = "q in N/mm", lambda r: f"{r['tension']:g}"
    bending = "D in N·mm", lambda r: f"{r['bending']:g}"
    return table(own, (_FORMULATION, _PARTS, pull, bending, start), results)


def nets(rows: Sequence[Row]) -> str:
    """Error of kinematic nets."""
    largest = _LARGEST[0], lambda r: f"{r['largest']:.5f}"
    rms = _RMS[0], lambda r: f"{r['rms']:.5f}"
    cells = "cells a side", _PARTS[1]
    return table(_of(rows, NET), (cells,), (largest, rms, _SECONDS))


def published_nets(rows: Sequence[Row]) -> str:
    """Differences of nets against those by a published method."""
    settings = (
        ("draping", lambda r: r["surface"]),
        ("cells", lambda r: r["cells"]),
    )
    results = (
        ("largest shear angle in °", lambda r: f"{r['largest_shear']:.1f}"),
        ("largest difference in °", lambda r: f"{r['largest']:.3f}"),
        ("mean difference in °", lambda r: f"{r['mean']:.4f}"),
    )
    return table(_of(rows, PUBLISHED, "surface"), settings, results)


def rolled(rows: Sequence[Row]) -> str:
    """Shear on developable surfaces, which ought to be none, on finer meshes."""
    own = [row for row in rows if row["kind"] == ROLLED]
    parts = sorted({row["parts"] for row in own})
    groups: dict[tuple[str, str, str], dict[int, str]] = {}
    for row in own:
        group = row["surface"], f"{row['tension']:g}", row["formulation"]
        shear = "refused" if row["refused"] else f"{row['largest']:.1e}"
        groups.setdefault(group, {})[row["parts"]] = shear
    head = "surface", "q in N/mm", "formulation"
    lines = [
        [*group, *(shear.get(n, "–") for n in parts)] for group, shear in groups.items()
    ]
    shears = [f"shear angle in °, {n} parts" for n in parts]
    return markdown_table([*head, *shears], lines)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Errors, orders and pressures for prose, of the parts that there are."""
    regular = _by_mesh(_of(rows, SPHERE))
    moved = _by_mesh(_of(rows, SPHERE, "distortion"))
    halved = _by_mesh(_of(rows, SPHERE, "distortion", "halvings"))
    stiff = _by_mesh(r for r in _of(rows, SPHERE, "stretch") if r["stretch"] > 1e5)
    free = _by_mesh(r for r in _of(rows, SPHERE, "tension") if not r["tension"])
    rolled = [r for r in rows if r["kind"] == ROLLED and not r["refused"]]
    along = [r["largest"] for r in rolled if r["surface"] != SQUARES]
    net = _of(rows, PUBLISHED, "surface")
    timed = [r for r in rows if r["kind"] == TIME and not r["refused"]]
    growth = [r["solves"] for r in timed if r["start"] == GROWTH]
    finest = regular["macro", 128]
    tensions = finest["least_tension"], finest["largest_tension"]
    corner = chebyshev.shear_angle(np.full((2, 1), chebyshev.SIDE)).item()
    of_edges = free["macro", 32]
    return {
        "largest_32": f"{regular['macro', 32]['largest']:.3f}°",
        "solves_32": str(regular["macro", 32]["solves"]),
        "corner": f"{np.degrees(corner):.1f}°",
        "orders": _orders(regular, "macro", "largest"),
        "orders_flat": _orders(regular, FLAT, "largest"),
        "orders_rms_stiff": _orders(stiff, "macro", "rms"),
        "tensions": f"{tensions[0]:.1f} to {tensions[1]:.1f} N/mm",
        "pressure": _largest(r for (_, n), r in regular.items() if n >= 16),
        "pressure_moved": _largest([moved["macro", 128]]),
        "pressure_halved": _largest([halved["macro", 128]]),
        "pressure_cylinder": _largest(r for r in rolled if r["surface"] in _CYLINDERS),
        "pressure_cone": _largest(r for r in rolled if r["surface"] == FAN),
        "rolled": f"{_power_of_ten(max(along))}°",
        "nets": f"{max(r['largest'] for r in net):.2f}°",
        "growth_solves": f"{min(growth)} to {max(growth)}",
        "free_energy": f"{100 * (1 - of_edges['energy'] / chebyshev.energy()):.0f} %",
        "free_compression": f"{-of_edges['least_tension']:.2f} N/mm",
    }


def _by_mesh(rows: Iterable[Row]) -> dict[tuple[str, int], Row]:
    """Rows by formulation and parts a side."""
    return {(row["formulation"], row["parts"]): row for row in rows}


def _orders(rows: dict[tuple[str, int], Row], formulation: str, error: str) -> str:
    """Orders of an error from 32 to 64 parts and from 64 to 128.

    Examples
    --------
    >>> rows = {("a", n): {"rms": n**-2} for n in (32, 64, 128)}
    >>> _orders(rows, "a", "rms")
    '2.0 and 2.0'
    """
    coarse, middle, fine = (rows[formulation, n][error] for n in (32, 64, 128))
    return f"{np.log2(coarse / middle):.1f} and {np.log2(middle / fine):.1f}"


def _largest(rows: Iterable[Row]) -> str:
    """The largest error of the contact pressure, in per cent with two digits."""
    errors = [row["pressure_error"] for row in rows]
    return f"{100 * max(e for e in errors if e is not None):.2g} %"


def _power_of_ten(x: float) -> str:
    """A positive number with one digit and a power of ten.

    Examples
    --------
    >>> _power_of_ten(3.9e-10)
    '4·10⁻¹⁰'
    """
    digit, _, power = f"{x:.0e}".partition("e")
    return f"{digit}·10{str(int(power)).translate(_RAISED)}"
