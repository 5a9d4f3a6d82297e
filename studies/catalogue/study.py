"""Fabrics of the catalogue: laws, bands and measured points; rewrites their files.

``--write`` replaces the files of the package.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skfem_textile.calibration import BiasExtension, FabricFit, Simulation, Specimen
from skfem_textile.calibration.bands import CONFIDENCE
from skfem_textile.fabric.catalogue import file_of
from skfem_textile.fabric.scatter import band_of_law
from skfem_textile.io import read_fabric

from ..common.figures import File, legend, panels_of, plain_numbers, style_of
from ..common.tables import grouped, having, markdown_table, percent
from ..measured.shear import STIFFNESSES
from ..study import Part, Row, Study
from .fabrics import ENTRIES, Cao, Entry

# Angles of the curves and of the table in degrees.
_CURVE, _SHOWN = np.arange(1.0, 41.0), (10.0, 20.0, 40.0)

# Bias extension in mm, and shear angle in radians, of the effect of the fibre
# stiffness.
_TEST, _LARGEST = BiasExtension(100.0, 200.0), float(np.radians(40.0))

# Beginning of the cases with other fibre stiffnesses.
_FIBRES = "fibres of "


@dataclass(frozen=True)
class Fitted:
    """A fit of a fabric, and its file.

    Attributes
    ----------
    entry
        The fabric.
    write
        True if its file is replaced.
    """

    entry: Entry
    write: bool

    def __str__(self) -> str:
        return self.entry.name

    def rows(self) -> list[Row]:
        """The law with its band, and the points of all tests."""
        fit, file = self.entry.fit(), file_of(self.entry.name)
        text = self.entry.text(fit)
        if self.write:
            file.write_text(text, encoding="utf-8")
        same = file.read_text(encoding="utf-8") == text
        return [
            {**row, "file": "as stored" if same else "differs"}
            for row in _rows(self.entry, fit)
        ]


def _rows(entry: Entry, fit: FabricFit) -> list[Row]:
    """Law of a file with its band and the points of the specimens, or stiffnesses."""
    found = read_fabric(entry.name)
    assert found.origin is not None
    specimens = found.origin.specimens.get("shear")
    if specimens is None:
        families = found.fabric.families
        laws: dict[str, Any] = {one.name: one.tension for one in families}
        laws["shear"] = found.fabric.shear_law
        ends = found.origin.ranges
        return [
            {**_row("stiffness", name), "stiffness": law.stiffness, "end": ends[name]}
            for name, law in laws.items()
        ]
    x = np.radians(_CURVE)
    band = band_of_law(specimens, x, CONFIDENCE)
    assert band is not None
    columns = _CURVE, found.fabric.shear_law.value(x), *band
    names = "angle_deg", "moment", "low", "high"
    curve = [
        _row("law", f"{len(specimens)} specimens")
        | dict(zip(names, map(float, point), strict=True))
        for point in zip(*columns, strict=True)
    ]
    return [*curve, *_points(fit)]


def _row(of: str, name: str) -> Row:
    return {"of": of, "name": name}


def _points(fit: FabricFit) -> list[Row]:
    """Moments of the specimens by pointwise reduction with inextensible fibres."""
    rows: list[Row] = []
    for one in fit.tests:
        assert isinstance(one, Specimen)
        gamma, moment = one.pointwise(fit.choice.up_to)
        rows += [
            _row("point", one.name)
            | {"angle_deg": float(np.degrees(g)), "moment": float(m)}
            for g, m in zip(gamma, moment, strict=True)
        ]
    return rows


@dataclass(frozen=True)
class Fibres:
    """Effect of the assumed fibre stiffness on the load of a bias extension."""

    entry: Entry

    def __str__(self) -> str:
        return f"{_FIBRES}{self.entry.name}"

    def rows(self) -> list[Row]:
        """Loads with the assumed stiffness, and with other ones."""
        fabric = read_fabric(self.entry.name).fabric
        tensions: list[Any] = [family.tension for family in fabric.families]
        warp, weft = (tension.stiffness for tension in tensions)
        factors = 1.0, *STIFFNESSES
        force = {
            factor: Simulation((factor * warp, factor * weft), steps=8)
            .curve(fabric.shear_law, _TEST, _LARGEST)
            .forces[-1]
            for factor in factors
        }
        return [
            {
                "warp_stiffness": factor * warp,
                "weft_stiffness": factor * weft,
                "force_N": float(force[factor]),
                "change": float(force[factor] / force[1.0] - 1),
            }
            for factor in factors
        ]


def laws(rows: list[Row]) -> str:
    """Shear moment of each fabric, with its band."""
    lines = []
    for name, own in grouped(having(rows, of="law"), "case").items():
        at = {row["angle_deg"]: row for row in own}
        cells = [
            "{moment:.3g} ({low:.2g} to {high:.2g})".format_map(at[angle])
            for angle in _SHOWN
        ]
        lines.append([f"`{name}`", own[0]["name"], *cells])
    angles = [f"at {angle:g}°" for angle in _SHOWN]
    return markdown_table(["fabric", "shear law of", *angles], lines) if lines else ""


def linear(rows: list[Row]) -> str:
    """Linear laws of the nylon, and the range of its data."""
    lines = [
        [
            f"`{row['case']}`",
            *(row["name"], f"{row['stiffness']:.3g}"),
            f"{np.degrees(row['end']):.2g}°"
            if row["name"] == "shear"
            else f"{100 * row['end']:.2g} %",
        ]
        for row in having(rows, of="stiffness")
    ]
    head = ["fabric", "law", "stiffness (N/mm)", "measured up to"]
    return markdown_table(head, lines) if lines else ""


def fibres(rows: list[Row]) -> str:
    """Change of the load with half and twice the fibre stiffness."""
    lines = [
        [f"`{name.removeprefix(_FIBRES)}`", *(percent(r["change"]) for r in own[1:])]
        for name, own in grouped(rows, "case").items()
    ]
    heads = [f"{factor:g} times the stiffness" for factor in STIFFNESSES]
    return markdown_table(["fabric", *heads], lines)


def draw(rows: list[Row], file: File) -> None:
    """Laws with bands over the points of the specimens."""
    from matplotlib.patches import Patch

    groups = grouped([row for row in rows if row.get("of")], "case")
    names = [name for name, own in groups.items() if having(own, of="point")]
    size, label = (6.3, 3.3), "shear moment (N mm/mm²)"
    axis = "shear angle (°)"
    shown: dict[str, dict[str, Any]] = {
        "law": {"color": "black"},
        "points of one specimen": {"color": "0.5", "marker": ".", "ls": ""},
    }
    titles = [name.removeprefix("cao2008-").replace("-", " ") for name in names]
    with panels_of(size, file, 8, titles, (label,), axis, sharey=True) as made:
        figure, grid = made
        for axes, name in zip(grid[0], names, strict=True):
            own = groups[name]
            points = grouped(having(own, of="point"), "name").values()
            for i, part in enumerate(points):
                style = {**style_of(i), "marker": ".", "ls": "", "ms": 3}
                axes.semilogy(*_columns(part, "angle_deg", "moment"), **style)
            law = having(own, of="law")
            x, y, low, high = _columns(law, "angle_deg", "moment", "low", "high")
            axes.fill_between(x, low, high, color="black", alpha=0.12, lw=0)
            axes.semilogy(x, y, color="black", lw=1.2)
            plain_numbers(axes)
            axes.grid(alpha=0.3)
            axes.set_ylim(5e-4, 2.0)
        band = Patch(color="black", alpha=0.12, label="95 % band of a further specimen")
        legend(figure, shown, 3, [band])


def _columns(rows: Sequence[Row], *names: str) -> list[np.ndarray]:
    return [np.array([row[name] for row in rows], dtype=float) for name in names]


class Catalogue(Study[Fitted | Fibres]):
    """The fabrics of the catalogue."""

    parts = (
        Part(
            "laws.csv",
            {"laws.md": laws, "linear.md": linear},
            {"laws.png": draw},
            tuple(entry.name for entry in ENTRIES),
        ),
        Part("fibres.csv", {"fibres.md": fibres}, cases=(f"{_FIBRES}*",)),
    )
    sample = ENTRIES[1].name

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        text = "replace the files of the package"
        parser.add_argument("--write", action="store_true", help=text)

    def cases(self, options: argparse.Namespace) -> Sequence[Fitted | Fibres]:
        fitted = [Fitted(one, getattr(options, "write", False)) for one in ENTRIES]
        return [*fitted, *(Fibres(one) for one in ENTRIES if isinstance(one, Cao))]

    def line(self, rows: list[Row]) -> str:
        last = rows[-1]
        return f"{last['case']}: {last.get('file') or percent(last['change'])}"

    def complaint(self, rows: list[Row]) -> str:
        others = {row["case"] for row in rows if row.get("file") == "differs"}
        if not others:
            return ""
        return f"files differ from their fits, pass --write: {', '.join(others)}"


STUDY = Catalogue()
