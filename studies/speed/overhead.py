"""The cost of the load stepper beside assembly and factorisation, and of corners."""

from statistics import median

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import strip

from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings, seconds

TABLES = ("overhead.md",)

_SIZES = (20, 30), (60, 100), (200, 300)


def measured(settings: Settings) -> Row:
    """Seconds of a linear solve, and the share of each part, on each mesh."""
    sizes = [size for size in _SIZES if size[0] * size[1] <= settings.most]
    return {"sizes": [_on_mesh(size) for size in sizes]}


def _on_mesh(size: tuple[int, int]) -> Row:
    scene = strip(size=size)
    ply = Ply(scene.mesh, Fabric(1e4, 0.5), OnePoint(100.0))
    result = LoadStepper(ply, scene.conditions, steps=4).run()
    whole = result.wall_time_s
    rest = whole - result.assembly_time_s - result.solve_time_s
    moved = [(1 + 1e-9 * i) * result.u for i in range(9)]  # every displacement is new
    corners = median(seconds(ply.corners.area_ratio, u)[1] for u in moved)
    return {
        "elements": ply.mesh.nelements,
        "linear_solves": result.linear_solves,
        "seconds_of_a_solve": whole / result.linear_solves,
        "assembly": result.assembly_time_s / whole,
        "factorisation_and_solution": result.solve_time_s / whole,
        "rest": rest / whole,
        "every_corner_once": corners * result.linear_solves / whole,
    }


def tables(results: Row) -> dict[str, str]:
    """A line for each mesh."""
    shares = "assembly", "factorisation_and_solution", "rest", "every_corner_once"
    lines = [
        [
            row["elements"],
            row["linear_solves"],
            f"{row['seconds_of_a_solve']:.3f}",
            *(f"{row[name]:.2%}" for name in shares),
        ]
        for row in results["sizes"]
    ]
    head = ["elements", "linear solves", "s each"]
    head += [name.replace("_", " ") for name in shares]
    return {"overhead.md": markdown_table(head, lines)}
