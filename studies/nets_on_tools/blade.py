"""A mould of 4 m draped by a commercial code, and by nets of the library.

The drapes were exported from Composites Modeler for Abaqus/CAE by C. Krogh, Aalborg
University, and published in the repository
chrkrogh/Export-Draped-Pattern-from-Abaqus-Composites-Modeler (2022, MIT licence).
"""

import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from skfem_textile import drape

from ..common.figures import File, figure_of
from ..common.tables import grouped, markdown_table
from ..study import Row

#: Folder of the data, which are not part of the repository.
REFERENCE = Path(__file__).parents[3] / "shared" / "reference"

BLADE = "blade"

#: Drapes, and which of their first threads follow an edge of the mould.
STEERED = {
    "GeoCourse": (False, False),
    "SteerCourseSingle": (True, False),
    "SteerCourseDouble": (True, True),
}

#: Length of the rods in mm.
CELL = 12.5

# Cells of a field of the picture along and across the mould.
_FIELD = 8, 2


class Reference(NamedTuple):
    """A published drape.

    Attributes
    ----------
    tool
        The mould.
    positions, angles
        Positions in mm, (3, n_warp, n_weft), and shear angles in degrees at its
        crossings, NaN where it has none.
    """

    tool: drape.TriangleMesh
    positions: ndarray
    angles: ndarray


def read(file: Path) -> Reference:
    """Read a published drape, whose lengths are in metres."""
    with gzip.open(file, "rt") as stream:
        mesh, ply = stream.read().split("*PLY")
    lines = (line.split() for line in mesh.splitlines())
    corners = np.array([x[1:] for x in lines if x[:1] == ["vertex"]], dtype=float).T
    triangles = np.arange(corners.shape[1]).reshape(-1, 3).T
    lines = (line.split() for line in ply.splitlines() if "*" not in line)
    rows = np.array([x[:9] for x in lines if x], dtype=float)
    u, v = rows[:, :2].astype(int).T
    shape = u.max() + 1, v.max() + 1
    positions, angles = np.full((3, *shape), np.nan), np.full(shape, np.nan)
    positions[:, u, v] = 1e3 * rows[:, 2:5].T
    angles[u, v] = np.degrees(rows[:, 8])
    return Reference(drape.TriangleMesh(1e3 * corners, triangles), positions, angles)


def laid(reference: Reference, steered: tuple[bool, bool]) -> drape.Net:
    """Net of the library from the same start."""
    x = reference.positions
    start, first = x[:, 0, 0], x[:, 1, 0] - x[:, 0, 0]
    (outline,) = reference.tool.facets.boundary()
    curves: list[ndarray | None] = [None, None]
    middles = x[:, x.shape[1] // 2, 0], x[:, 0, x.shape[2] // 2]
    for family, follows in enumerate(steered):
        if follows:
            curve = drape.edge_through(outline, middles[family])
            along = curve[:, -1] - curve[:, 0]
            against = along @ (middles[family] - start) < 0
            curves[family] = curve[:, ::-1] if against else curve
    return drape.net(
        reference.tool,
        CELL,
        *((0, n) for n in reference.angles.shape),
        point=start,
        first=first,
        warp_along=curves[0],
        weft_along=curves[1],
    )


@dataclass(frozen=True)
class Blade:
    """A drape of the mould."""

    name: str
    folder: Path = REFERENCE

    def __str__(self) -> str:
        return f"{BLADE}, {self.name}"

    def rows(self) -> list[Row]:
        """Differences of all crossings and cells, then of fields of the net."""
        from time import process_time

        file = self.folder / "blade_mold" / f"{self.name}.vfp.gz"
        if not file.is_file():
            raise FileNotFoundError(
                f"{file} is missing: download the drapes, and give their folder as "
                "--reference"
            )
        reference = read(file)
        begin = process_time()
        net = laid(reference, STEERED[self.name])
        seconds = process_time() - begin
        i, j = net.start
        n, m = reference.angles.shape
        x = net.positions[:, i : i + n, j : j + m]
        away = np.linalg.norm(x - reference.positions, axis=0)
        of_net = np.degrees(net.shear_angle()[i : i + n - 1, j : j + m - 1])
        of_net *= _sign(of_net, _mean(reference.angles))
        off = np.abs(of_net - _mean(reference.angles))
        # Angles of the cells of the reference, from its own positions.
        along = CELL * np.arange(n), CELL * np.arange(m)
        laid_there = np.zeros((n, m), dtype=np.int8)
        own = drape.Net(reference.positions, laid_there, along, np.eye(2), np.zeros(2))
        of_own = np.degrees(own.shear_angle())
        of_own *= _sign(of_own, of_net)
        total = {
            "seconds": round(seconds, 2),
            "largest_angle": float(np.nanmax(np.abs(of_net))),
            **_spread("away", away),
            **_spread("off", off),
            **_spread("off_inside", off[1:, 1:]),
            **_spread("off_cells", np.abs(of_net - of_own)),
            "missing": int((np.isnan(x[0]) & np.isfinite(reference.angles)).sum()),
        }
        return [total, *_fields(away, off)]


def _mean(angles: ndarray) -> ndarray:
    """Mean of the four crossings of each cell."""
    return 0.25 * (
        angles[1:, 1:] + angles[:-1, 1:] + angles[1:, :-1] + angles[:-1, :-1]
    )


def _sign(one: ndarray, other: ndarray) -> float:
    """1 or −1: conventions of the sign of angles differ."""
    return float(np.sign(np.nansum(one * other)))


def _spread(name: str, values: ndarray) -> dict[str, float]:
    known = values[np.isfinite(values)]
    return {
        f"{name}_median": float(np.median(known)),
        f"{name}_99": float(np.quantile(known, 0.99)),
        f"{name}_largest": float(known.max()),
    }


def _fields(away: ndarray, off: ndarray) -> list[Row]:
    """Largest differences in fields of the net."""
    rows: list[Row] = []
    for u in range(0, off.shape[0], _FIELD[0]):
        for v in range(0, off.shape[1], _FIELD[1]):
            part = np.s_[u : u + _FIELD[0], v : v + _FIELD[1]]
            if np.isfinite(off[part]).any() and np.isfinite(away[part]).any():
                rows.append(
                    {
                        **{"u": u, "v": v},
                        "away_largest": round(float(np.nanmax(away[part])), 3),
                        "off_largest": round(float(np.nanmax(off[part])), 3),
                    }
                )
    return rows


def totals(rows: Sequence[Row]) -> dict[str, Row]:
    """Rows of whole drapes by name."""
    return {
        row["case"].removeprefix(f"{BLADE}, "): row
        for row in rows
        if row.get("missing") is not None
    }


def blade_table(rows: list[Row]) -> str:
    """A line for each drape."""
    lines = [
        [
            f"`{name}`",
            f"{row['seconds']:.1f}",
            _three(row, "away"),
            _three(row, "off"),
            _three(row, "off_inside"),
            f"{row['largest_angle']:.1f}",
        ]
        for name, row in totals(rows).items()
    ]
    head = [
        *("drape", "seconds", "position, mm", "angle, °"),
        *("angle without first threads, °", "largest angle, °"),
    ]
    return markdown_table(head, lines)


def _three(row: Row, name: str) -> str:
    return ", ".join(f"{row[f'{name}_{k}']:.2f}" for k in ("median", "99", "largest"))


def draw_blade(rows: Sequence[Row], file: File = None) -> Any:
    """Draw the largest differences of fields of the nets along the mould."""
    with figure_of((8.8, 5.2), file, 10) as figure:
        drapes = grouped([row for row in rows if row.get("u") is not None], "case")
        grid = figure.subplots(len(drapes), 2, squeeze=False, sharex=True, sharey=True)
        for axes, (case, fields) in zip(grid, drapes.items(), strict=True):
            axes[0].set_ylabel(f"{case.removeprefix(f'{BLADE}, ')}\nv, cells")
            for panel, key, most in zip(
                axes, ("away_largest", "off_largest"), (1.0, 1.25), strict=True
            ):
                image = _image(fields, key)
                size = [image.shape[0] * _FIELD[0], image.shape[1] * _FIELD[1]]
                drawn = panel.imshow(
                    image.T,
                    origin="lower",
                    extent=(0, size[0], 0, size[1]),
                    aspect="auto",
                    vmin=0,
                    vmax=most,
                )
        for panel, title in zip(
            grid[0], ("position, mm", "shear angle, °"), strict=True
        ):
            panel.set_title(f"difference of the {title}")
        for k, panel in enumerate(grid[-1]):
            panel.set_xlabel("u, cells")
            figure.colorbar(
                grid[0, k].images[0], ax=grid[:, k], location="bottom", aspect=40
            )
        return drawn.figure


def _image(fields: Sequence[Row], key: str) -> ndarray:
    u, v = (
        np.array([row[name] for row in fields]) // size
        for name, size in zip("uv", _FIELD, strict=True)
    )
    image = np.full((u.max() + 1, v.max() + 1), np.nan)
    image[u, v] = [row[key] for row in fields]
    return image
