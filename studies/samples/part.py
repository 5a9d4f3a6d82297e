"""A part with the samples of a fabric of the catalogue, as the command line runs it."""

from dataclasses import dataclass

import numpy as np

from skfem_textile.cases import case_from_tables
from skfem_textile.cli.curve import DISPLACEMENT, FORCE, HALF_WIDTH, curve_of
from skfem_textile.cli.samples import with_bands
from skfem_textile.io import read_fabric
from skfem_textile.scenes import run_samples
from skfem_textile.solve.quantities import band_rows

from ..common.figures import File
from ..common.tables import having, markdown_table
from ..study import Row

#: Fabric and number of samples.
FABRIC, NUMBER = "cao2008-plain-weave", 20

# Columns of the curve.
_COLUMNS = "displacement_mm", "force_N", "half_width_N", "low_N", "high_N"


@dataclass(frozen=True)
class PartRun:
    """A bias extension with the default sizes."""

    def __str__(self) -> str:
        return "part"

    def rows(self) -> list[Row]:
        """Figures with their bands, and the curve with both bands."""
        tables = {
            "scene": {"name": "bias_extension"},
            "fabric": {"file": FABRIC},
            "stepping": {"steps": 8},
        }
        case = case_from_tables(tables)
        result = case.run()
        samples = run_samples(case, read_fabric(FABRIC).samples(NUMBER))
        summary = with_bands(case.summary(result), samples)
        names = "run", "mesh", "low", "high"
        figures: list[Row] = [
            {"of": "figure", "quantity": name}
            | {key: float(x) for key, x in zip(names, cells, strict=True) if x}
            for name, *cells in band_rows(summary)
        ]
        curve = curve_of(case.scene, result)
        factors = np.array([state.load_factor for state in result.states])
        columns = (
            *(curve[DISPLACEMENT], curve[FORCE], curve[HALF_WIDTH]),
            *samples.force_band(factors),
        )
        points: list[Row] = [
            {"of": "point", **dict(zip(_COLUMNS, map(float, point), strict=True))}
            for point in zip(*columns, strict=True)
        ]
        return [*figures, *points]


def figures(rows: list[Row]) -> str:
    """Figures of the part: run, half-width of the mesh, and band of the fabric."""
    head = ["quantity", "run", "half-width of the mesh", "lowest", "highest"]
    keys = "run", "mesh", "low", "high"
    lines = [
        [row["quantity"], *(_cell(row.get(key)) for key in keys)]
        for row in having(rows, of="figure")
    ]
    return markdown_table(head, lines)


def _cell(x: float | None) -> str:
    return "" if x is None else f"{x:.4g}"


def draw(rows: list[Row], file: File) -> None:
    """The interval of the mesh and the band of the fabric side by side."""
    from skfem_textile.plot import curves

    points = having(rows, of="point")
    x, y, half, low, high = (
        np.array([row[name] for row in points], dtype=float) for name in _COLUMNS
    )
    panels: dict[str, dict[str, tuple[np.ndarray, ...]]]
    panels = {"Mesh": {"run": (x, y, half)}, "Fabric": {"run": (x, y, low, high)}}
    curves(panels, "Displacement (mm)", "Force (N)", file, same_scales=True)
