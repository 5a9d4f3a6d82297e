"""The best start against random ones, on tools without symmetry."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
from numpy import ndarray

from skfem_textile import drape
from tests.helpers import tool_shapes

from ..common.tables import markdown_table
from ..study import Row

START = "start"

# Cells along the longest side, random starts, and their seed.
_CELLS, _RANDOM, _SEED = 40, 200, 7


def _two_bumps(s: ndarray, t: ndarray) -> ndarray:
    x, y = 300 * (s - 0.5), 220 * (t - 0.5)
    z = 60 * np.exp(-(((x - 40) / 70) ** 2) - ((y + 20) / 50) ** 2)
    z = z + 35 * np.exp(-(((x + 80) / 60) ** 2) - ((y - 30) / 60) ** 2)
    return np.array([x, y, z + 0.0008 * x * y])


#: Tools by name.
TOOLS = {
    "askew bonnet": lambda: tool_shapes.bonnet(askew=True),
    "two bumps": lambda: tool_shapes.patch(_two_bumps, 300.0, 220.0, 8.0),
}


@dataclass(frozen=True)
class BestOfRandom:
    """A tool by name."""

    name: str

    def __str__(self) -> str:
        return f"{START}, {self.name}"

    def rows(self) -> list[Row]:
        """One row: largest shear angles of the best start and of random ones."""
        tool = drape.TriangleMesh(*TOOLS[self.name]())
        points = tool.facets.points
        cell = float(np.ptp(points, axis=1).max()) / _CELLS
        begin = process_time()
        best = drape.best_start(tool, cell)
        seconds = process_time() - begin
        rng = np.random.default_rng(_SEED)
        places = points[:, rng.integers(0, points.shape[1], _RANDOM)]
        turns = rng.uniform(0, 0.5 * np.pi, _RANDOM)
        directions = np.array([np.cos(turns), np.sin(turns), 0 * turns])
        starts = [
            drape.NetStart(*start) for start in zip(places.T, directions.T, strict=True)
        ]
        shear = [
            float(np.abs(drape.shear_over(net, points)).max())
            for k in range(0, _RANDOM, 25)
            for net in drape.nets(tool, cell, starts[k : k + 25])
        ]
        return [
            {
                "tool": self.name,
                "nets": len(best.measures),
                "best": float(np.degrees(best.measure)),
                "random": float(np.degrees(np.nanmin(shear))),
                "median": float(np.degrees(np.nanmedian(shear))),
                "seconds": round(seconds, 1),
            }
        ]


def start_table(rows: list[Row]) -> str:
    """A line for each tool."""
    head = [
        *("tool", "nets", "best start", f"best of {_RANDOM} random ones"),
        *("their median", "seconds"),
    ]
    return markdown_table(
        head,
        [
            [
                *(row["tool"], row["nets"], f"{row['best']:.2f}°"),
                *(f"{row['random']:.2f}°", f"{row['median']:.2f}°"),
                f"{row['seconds']:.0f}",
            ]
            for row in rows
        ],
    )


def starts_in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The longest time, for prose."""
    known = [row for row in rows if row["case"].startswith(START)]
    if not known:
        return {}
    seconds = max(row["seconds"] for row in known)
    return {"start_seconds": f"{seconds:.0f} s"}
