"""Whole drapes on triangulated tools in two alternating checkouts of this project."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from meshio import Mesh
from numpy import ndarray
from scipy.spatial import ConvexHull

from skfem_textile.drape import double_dome

from ..common.tables import Row, scientific, table
from .profile import write_hemisphere
from .solving import Settings, compared, in_checkout, two_commits

# Elements along each side of the plies, and turns with each.
_SIZES, _TURNS = (12, 48), (3, 1)

# Options of the ply on each tool.
_PLIES: dict[str, dict[str, Any]] = {
    "hemisphere": {"width": 100.0, "height": 100.0},
    "sphere": {"fibres": 0.3},
    "double dome": {"width": 200.0, "height": 140.0, "fibres": 0.5, "point": [0, 0, 0]},
    "fillet": {"width": 160.0, "height": 120.0, "fibres": 0.2, "point": [0, 0, 25]},
}

# Begins with the file of the tool and ends with the summary.
_DRAPE = """
import json, sys, time
import numpy as np
from skfem_textile import Fabric
from skfem_textile.io import read_surface
from skfem_textile.scenes import Case, drape

file, size, ply = sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3])
began = time.process_time()
scene = drape(read_surface(file), size=(size, size), **ply)
fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
case = Case(scene=scene, fabric=fabric, steps=4)
result = case.run()
case.summary(result)
seconds = time.process_time() - began
angle = np.degrees(result.ply.shear_angle(result.u)).ravel().tolist()
print(json.dumps({"seconds": seconds, "angle": angle}))
"""


def drapes(settings: Settings) -> Row:
    """Minimum processor time from the file of a tool to the summary, without pictures.

    Also the root mean square difference of the shear angles.
    """
    checkouts, rows = compared(settings), []
    with TemporaryDirectory() as folder:
        for tool, ply in _PLIES.items():
            file = Path(folder, "tool.stl")
            write_tool(tool, file)
            for size, number in zip(_SIZES, _TURNS, strict=True):
                arguments = str(file), str(size), json.dumps(ply)
                turns = [
                    [in_checkout(x, _DRAPE, *arguments) for x in checkouts.values()]
                    for _ in range(number)
                ]
                before, after = (
                    min(run["seconds"] for run in runs)
                    for runs in zip(*turns, strict=True)
                )
                angles = np.array([run["angle"] for run in turns[0]])
                off = float(np.sqrt(np.mean(np.diff(angles, axis=0) ** 2)))
                row: Row = {"tool": tool, "size": size, "difference_deg": off}
                rows.append({**row, "before": before, "after": after})
    return {"commits": [*checkouts], "drapes": rows}


def drapes_table(results: Row) -> str:
    """A line for each tool and size."""
    return table(
        results["drapes"],
        {
            "tool": "{tool}",
            "elements along each side": "{size}",
            **two_commits(results),
            "rms difference of the shear angle, °": lambda row: scientific(
                row["difference_deg"], 1
            ),
        },
    )


def write_tool(name: str, file: Path) -> None:
    """Write a tool as STL."""
    if name == "hemisphere":
        return write_hemisphere(file)
    points, triangles = _sphere() if name == "sphere" else _sheet(name)
    return Mesh(points, [("triangle", triangles)]).write(file)


def _sphere() -> tuple[ndarray, ndarray]:
    """Points and triangles of a sphere with nearly equal triangles."""
    n = 2502
    polar = np.arccos(1 - (2 * np.arange(n) + 1) / n)
    around = np.pi * (1 + 5**0.5) * (np.arange(n) + 0.5)
    unit = [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)]
    points = np.stack([*unit, np.cos(polar)], axis=-1)
    triangles = ConvexHull(points).simplices
    a, b, c = points[triangles].swapaxes(0, 1)
    inwards = (np.cross(b - a, c - a) * a).sum(axis=1) < 0
    triangles[inwards] = triangles[inwards, ::-1]
    return 100 * points, triangles


def _sheet(name: str) -> tuple[ndarray, ndarray]:
    """Points and triangles of the double dome, or of a block with fillets."""
    most, n = (240, 61) if name == "double dome" else (100, 51)
    x, y = (at.ravel() for at in np.meshgrid(*[np.linspace(-most, most, n)] * 2))
    if name == "double dome":
        z = double_dome().height(x, y).h
    else:
        z = 25 - np.hypot(*(5 * np.logaddexp(0, (np.abs([x, y]) - 40) / 5)))
    k = np.add.outer(n * np.arange(n - 1), np.arange(n - 1)).ravel()
    triangles = np.hstack([[k, k + 1, k + n + 1], [k, k + n + 1, k + n]]).T
    return np.stack([x, y, z], axis=-1), triangles
