"""Time and memory of whole runs on large meshes of users."""

from time import perf_counter

from skfem_textile import Fabric, LoadStepper, Ply
from skfem_textile.scenes import bias_extension
from skfem_textile.solve import solver_threads

from ..common.running import in_new_process
from ..common.tables import Row, table
from .solving import Settings, peak

# Quadrilaterals across and along the specimen before they are split, load steps,
# threads of RSLAB, and whether the error interval is computed.
_RUNS = ((100, 150), 1, 1, True), ((100, 150), 1, 2, True), ((185, 277), 10, 2, False)

# Fibre and shear stiffness in N/mm.
_E, _G = 1e4, 0.5


def whole_runs(settings: Settings) -> Row:
    """Bias extension on large meshes, with the required linear solver.

    Time from the mesh in memory to the full load, with set-up, and to the error
    interval; peak memory of the process until then.
    """
    runs = [run for run in _RUNS if run[0][0] * run[0][1] <= settings.most]
    return {"runs": [row for run in runs for row in in_new_process(_whole_run, *run)]}


def _whole_run(
    size: tuple[int, int], steps: int, number: int, with_error: bool
) -> list[Row]:
    solver_threads.set(number)
    scene = bias_extension(size=size)
    start = perf_counter()
    ply = Ply(scene.mesh, Fabric(_E, _G, scene.warp, scene.weft))
    result = LoadStepper(ply, scene.conditions, steps, solver="rslab").run()

    def row(until: str) -> Row:
        return {
            "elements": scene.mesh.nelements,
            "unknowns": int(ply.basis.N),
            "steps": steps,
            "threads": number,
            "linear_solves": result.linear_solves,
            "until": until,
            "seconds": perf_counter() - start,
            "peak_GiB": peak(),
        }

    rows = [row("full load")]
    if with_error:
        assert result.error
        rows.append(row("error interval"))
    return rows


def whole_runs_table(results: Row) -> str:
    """A line for each run, and for its error interval."""
    return table(
        results["runs"],
        {
            "quadrilaterals": "{elements}",
            "unknowns": "{unknowns}",
            "load steps": "{steps}",
            "threads": "{threads}",
            "linear solves": "{linear_solves}",
            "until": "{until}",
            "s": "{seconds:.1f}",
            "peak, GiB": "{peak_GiB:.2f}",
        },
    )
