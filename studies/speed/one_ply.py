"""Costs and loaded modules of one ply in a new process.

``python -m studies.speed.one_ply KIND NAME ELEMENTS`` prints the results as JSON.  The
kind is ``feature`` (`FEATURES`), ``absent`` or ``zero`` (`UNUSED`), or ``scene``
(`SCENES`).  Functions import their dependencies locally, to load nothing else.
"""

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

_BEFORE = frozenset(sys.modules)

#: Features, added one after the other.  Macro-elements replace one-point elements, and
#: measured laws replace linear ones.
FEATURES = (
    *("tension at one point", "stabilisation", "shear", "macro-elements"),
    *("measured laws", "ply in space", "bending of fibres"),
    *("picture off screen", "files for ParaView", "error interval"),
)
_PICTURE, _FILES, _INTERVAL = FEATURES[7:]

#: Optional features of a ply, and their declaration as zero.
UNUSED = {
    "stabilisation": "C_s = 0",
    "shear": "a law with G = 0",
    "bending": "D = 0 in every element",
    "terms": "an empty list",
}

#: Whole runs.
SCENES = ("scikit-fem alone", "strip", "bias extension", "sphere")

# Fibre and shear stiffness in N/mm, bending stiffness in N·mm, and C_s in N/mm.
_E, _G, _D, _C_S = 1e4, 0.5, 5.0, 4.0

# Stretch and shear of the ply; its sides and the radius of the arc in mm.
_STRETCH, _SHEAR, _SIDE, _RADIUS = 0.01, 0.05, 100.0, 55.0

# Number of timed iterations, of which the fastest counts.
_ITERATIONS = 15


def main(kind: str, name: str, elements: str) -> None:
    """Print the costs and the modules of one ply."""
    results: dict[str, Any] = {}
    if kind == "scene":
        _RUNS[name]()
    elif kind == "feature":
        used = FEATURES[: 1 + FEATURES.index(name)]
        ply = _with_features(used, int(elements))
        results = _costs(*ply) | {"later": _post(used, *ply)}
    else:
        results = _costs(*_without(name, kind == "zero", int(elements)))
    loaded = [module for module in sys.modules if module not in _BEFORE]
    print(json.dumps(results | {"peak": peak(), "modules": loaded}))


def peak() -> float:
    """Peak memory of this process in MiB, on Linux."""
    lines = Path("/proc/self/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("VmHWM:"))
    return int(line.split()[1]) / 1024


def _with_features(used: tuple[str, ...], elements: int) -> tuple[Any, ...]:
    """Arguments of the ply with these features, and its dimension."""
    from skfem_textile import Fabric, Macro, OnePoint

    tension, shear = _measured() if "measured laws" in used else (_E, _G)
    if "shear" not in used:
        shear = 0.0
    bending = (_D, _D) if "bending of fibres" in used else (0.0, 0.0)
    formulation: Any = OnePoint(_C_S if "stabilisation" in used else 0.0)
    mesh = _mesh(elements)
    if "macro-elements" in used:
        formulation, mesh = Macro(), _mesh(elements // 4)  # splits elements in four
    dimension = 3 if "ply in space" in used else 2
    return (mesh, Fabric(tension, shear, bending=bending), formulation), dimension


def _measured() -> Any:
    """Laws of crimped fibres and of a measured shear curve."""
    import numpy as np

    from skfem_textile import CrimpToe, Tabulated, TensionOnly

    angle = np.radians([0, 10, 20, 30, 40, 50, 60])
    moment = [0, 0.008, 0.018, 0.034, 0.075, 0.21, 0.7]
    fibres = TensionOnly(CrimpToe(7e3, toe=0.003, initial_stiffness=10))
    return fibres, Tabulated(angle, moment, odd=True)


def _without(name: str, zero: bool, elements: int) -> tuple[Any, ...]:
    """Arguments of a ply with a feature declared as zero, or absent."""
    import numpy as np

    from skfem_textile import Fabric, Linear, OnePoint

    class Bare(OnePoint):
        """One-point elements without stabilising terms."""

        def stabilising_terms(self, basis: Any, fabric: Any) -> list[Any]:
            return []

    mesh, formulation = _mesh(elements), OnePoint(_C_S)
    fabric, more = Fabric(_E, _G), list[Any]()
    if name == "stabilisation":
        fabric, formulation = Fabric(_E), OnePoint(0.0) if zero else Bare(0.0)
    elif name == "shear":
        fabric = Fabric(_E, Linear(0.0)) if zero else Fabric(_E)
    elif name == "bending" and zero:
        none = np.zeros(mesh.nelements)
        fabric = Fabric(_E, _G, bending=(none, none))
    elif name == "terms" and zero:
        more = [[]]
    return (mesh, fabric, formulation, *more), 2


def _mesh(elements: int) -> Any:
    from skfem_textile.scenes.rectangle import rectangle

    n = round(elements**0.5)
    mesh = rectangle(_SIDE, _SIDE, (n, n), "irregular", 0.2)
    return mesh.with_boundaries({"edge": mesh.boundary_facets()})


def _conditions(dimension: int) -> dict[str, Any]:
    from skfem_textile import Condition

    return {"edge": Condition("edge", partial(_stretched, dimension=dimension))}


def _stretched(X: Any, t: float, dimension: int) -> Any:
    """Displacement of a ply stretched along its fibres and sheared."""
    import numpy as np

    u = t * np.array([[_STRETCH, _SHEAR], [_SHEAR, _STRETCH]]) @ X
    return np.pad(u, ((0, dimension - 2), (0, 0)))


def _costs(arguments: tuple[Any, ...], dimension: int) -> dict[str, Any]:
    """CPU time in s of the set-up, and of the parts of one Newton iteration."""
    from skfem_textile import Ply
    from skfem_textile.solve.conditions import Constraints
    from skfem_textile.solve.linear import ChosenSolver
    from skfem_textile.solve.problem import Problem, reduced

    start = process_time()
    ply = Ply(*arguments, dimension=dimension)
    constraints = Constraints(ply.basis, _conditions(dimension))
    system = Problem(ply, constraints, partial(ChosenSolver, "superlu")).system
    set_up = process_time() - start
    u = _stretched(ply.nodes, 1.0, dimension).T.ravel()
    times = []
    for _ in range(_ITERATIONS):
        u = (1 + 1e-9) * u  # avoids cached strains
        start = process_time()
        f, blocks = ply.residual(u), ply.stiffness(u)
        assembled = process_time()
        factors = system.solver.factorise(reduced(system, blocks).upper.data)
        assert factors.definite
        factors.solve(-f[constraints.free])
        times.append((assembled - start, process_time() - assembled))
    assembly, solution = (min(x) for x in zip(*times, strict=True))
    return {
        "set_up": set_up,
        "assembly": assembly,
        "solution": solution,
        "terms": [term.name for term in ply.terms],
    }


def _post(used: tuple[str, ...], arguments: tuple[Any, ...], dimension: int) -> float:
    """CPU time in s of post-processing, without imports."""
    from skfem_textile import LoadStepper, Ply

    ply = Ply(*arguments, dimension=dimension)
    result = LoadStepper(ply, _conditions(dimension), 1, solver="superlu").run()
    took = 0.0
    with TemporaryDirectory() as name:
        folder = Path(name)
        if _PICTURE in used:
            from skfem_textile import plot

            took += _second(plot.shear_angle, result, filename=folder / "angle.png")
        if _FILES in used:
            from skfem_textile.io import write_fields

            took += _second(write_fields, result, folder)
        if _INTERVAL in used:
            start = process_time()
            assert result.error.load is not None
            took += process_time() - start
    return took


def _second(function: Callable[..., Any], *arguments: Any, **more: Any) -> float:
    """CPU time in s of the second call, without imports."""
    function(*arguments, **more)
    start = process_time()
    function(*arguments, **more)
    return process_time() - start


def _scikit_fem() -> None:
    __import__("skfem")


def _strip() -> None:
    """In plane, with tension only: the right edge moves onto an arc."""
    import numpy as np
    from skfem import MeshQuad

    from skfem_textile import Condition, Fabric, LoadStepper, Ply

    def arc(X: Any, t: float) -> Any:
        return _RADIUS * (1 - np.cos(t * X[1] / _RADIUS))

    mesh = MeshQuad.init_tensor(np.linspace(0, 40, 11), np.linspace(0, 60, 16))
    lead = Condition("right", arc, direction=(1.0, 0.0))
    conditions = {"clamp": Condition("bottom"), "lead": lead}
    LoadStepper(Ply(mesh.with_defaults(), Fabric(_E)), conditions, 1).run()


def _bias_extension() -> None:
    """With a measured shear law, and a figure of the shear angle."""
    from skfem_textile import Fabric, LoadStepper, Ply, plot
    from skfem_textile.scenes import bias_extension

    scene, (_, shear) = bias_extension(), _measured()
    ply = Ply(scene.mesh, Fabric(_E, shear, scene.warp, scene.weft))
    result = LoadStepper(ply, scene.conditions, 4).run()
    with TemporaryDirectory() as folder:
        plot.shear_angle(result, filename=Path(folder, "angle.png"))


def _sphere() -> None:
    """In 3D on a surface, with bending stiffness of the fibres."""
    from skfem_textile import Fabric
    from skfem_textile.scenes import Case, hemisphere

    scene = hemisphere(size=(8, 8), tension=2.0)
    fabric = Fabric(_E, 0.1, scene.warp, scene.weft, bending=(_D, _D))
    Case(scene=scene, fabric=fabric, steps=1).run()


_RUNS = dict(zip(SCENES, (_scikit_fem, _strip, _bias_extension, _sphere), strict=True))

if __name__ == "__main__":
    main(*sys.argv[1:])
