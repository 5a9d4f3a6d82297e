"""Cost of features: import, memory and time, if used and if declared as zero.

Features are added to a ply one by one.  Each ply is created and solved in a new process
(`one_ply`); the modules that it loads are imported in another process.  Plies that
declare a feature as zero are compared with plies without the feature.  Plies alternate;
times are CPU times.
"""

import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from statistics import median, quantiles

import skfem_textile

from ..common.tables import Row
from .one_ply import FEATURES, SCENES, UNUSED
from .solving import Settings, spread

# Elements of a ply, the square of an even number.
_ELEMENTS = 2500

# Rounds of the features and of the comparisons.
_ROUNDS, _COMPARED = 5, 15

#: Costs in the order of the tables, with their units.
COSTS = {
    "import": "s",
    "memory": "MiB",
    "assembly": "ms",
    "solution": "ms",
    "once": "s",
}

# Fixed glibc thresholds in bytes: adaptive ones vary peak memory by a tenth between
# processes.  These values do not change the assembly time.
_MALLOC = {"MALLOC_MMAP_THRESHOLD_": "4000000", "MALLOC_TRIM_THRESHOLD_": "100000000"}

#: Name of the first line, a process that only imports scikit-fem.
ALONE = SCENES[0]

#: Packages with long import times.
HEAVY = (
    *("skfem", "scipy", "meshio", "pyvista", "vtkmodules", "matplotlib", "PIL"),
    *("msgspec", "cvxopt", "pypardiso", "rslab"),
)

# Imports modules by name in the given order, skips those that cannot be imported
# directly, and prints the CPU time in s.
_IMPORT = """
import json, sys
from contextlib import suppress
from importlib import import_module
from time import process_time
names = json.load(sys.stdin)
start = process_time()
for name in names:
    with suppress(ImportError):
        import_module(name)
print(process_time() - start)
"""


def needs(settings: Settings) -> Row:
    """Costs of all features, and of features declared as zero."""
    elements = min(_ELEMENTS, settings.most)
    costs: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for _ in range(_ROUNDS):
        for name in (ALONE, *FEATURES):
            results = run("scene" if name == ALONE else "feature", name, elements)
            costs[name]["import"].append(_import(results["modules"]))
            for cost, value in _costs(results).items():
                costs[name][cost].append(value)
    return {
        "elements": elements,
        "rounds": _ROUNDS,
        "features": {
            name: {cost: spread(values) for cost, values in of_name.items()}
            for name, of_name in costs.items()
        },
        "unused": {name: _unused(name, elements) for name in UNUSED},
    }


def _unused(name: str, elements: int) -> Row:
    """Relative cost differences between a feature declared as zero and its absence."""
    shares: dict[str, list[float]] = defaultdict(list)
    for _ in range(_COMPARED):
        absent, zero = (run(kind, name, elements) for kind in ("absent", "zero"))
        costs = _costs(absent)
        for cost, value in _costs(zero).items():
            shares[cost].append(value / costs[cost] - 1)
    return {
        "rounds": _COMPARED,
        "further_terms": sorted(set(zero["terms"]) - set(absent["terms"])),
        "further_modules": sorted(set(own_modules(zero)) - set(own_modules(absent))),
        "shares": {cost: _middle(values) for cost, values in shares.items()},
    }


def _middle(values: Sequence[float]) -> dict[str, float]:
    """Median and quartiles."""
    low, _, high = quantiles(values, n=4)
    return {"median": median(values), "low": low, "high": high}


def run(kind: str, name: str, elements: int) -> Row:
    """Results of a process of `one_ply`."""
    words = "-m", "studies.speed.one_ply", kind, name, str(elements)
    results: Row = json.loads(output_of(words))
    return results


def _import(modules: Sequence[str]) -> float:
    """CPU time in s to import modules."""
    return float(output_of(("-c", _IMPORT), json.dumps(modules)))


def _costs(results: Row) -> dict[str, float]:
    """The other costs of a process, as available."""
    if "assembly" not in results:
        return {"memory": results["peak"]}
    return {
        "memory": results["peak"],
        "assembly": 1e3 * results["assembly"],
        "solution": 1e3 * results["solution"],
        "once": results["set_up"] + results.get("later", 0.0),
    }


def own_modules(results: Row) -> list[str]:
    """Modules of this library loaded by a process."""
    package = skfem_textile.__name__
    return [m for m in results["modules"] if m.partition(".")[0] == package]


def output_of(words: Sequence[str], text: str = "") -> str:
    """Output of a new Python process with these arguments and standard input."""
    command = [sys.executable, *words]
    child = subprocess.run(
        command,
        check=True,
        capture_output=True,
        text=True,
        input=text,
        env=os.environ | _MALLOC,
    )
    return child.stdout


def added(results: Row) -> dict[str, dict[str, tuple[float, float]]]:
    """Increment of each cost by each feature, and its scatter.

    The scatter is a third of the sum of both ranges: two standard errors of the
    difference between medians of five normally distributed values.
    """
    every = results["features"]
    adds: dict[str, dict[str, tuple[float, float]]] = {}
    for before, name in zip((None, *every), every, strict=False):
        adds[name] = {}
        for cost, new in every[name].items():
            old = every[before].get(cost) if before else None
            old = old or dict.fromkeys(("median", "least", "most"), 0.0)
            scatter = (new["most"] - new["least"] + old["most"] - old["least"]) / 3
            adds[name][cost] = new["median"] - old["median"], scatter
    return adds


def modules(settings: Settings) -> Row:
    """Modules of this library and heavy packages loaded by each scene."""
    package = Path(skfem_textile.__path__[0])
    return {
        "modules": len(list(package.rglob("*.py"))),
        "scenes": {name: loaded(name) for name in SCENES},
    }


def loaded(scene: str) -> Row:
    """Number of modules of this library loaded by a scene, and heavy packages."""
    results = run("scene", scene, 0)
    return {"own": len(own_modules(results)), "heavy": heavy_of(results["modules"])}


def heavy_of(modules: Sequence[str]) -> list[str]:
    """Packages in `HEAVY`; for SciPy, its public subpackages.

    Examples
    --------
    >>> heavy_of(["numpy", "scipy.sparse.linalg", "scipy._lib", "skfem.mesh"])
    ['scipy.sparse', 'skfem']
    """
    packages = set()
    for module in modules:
        first, *tail = module.split(".")
        if first == "scipy" and tail and tail[0][0] != "_" and tail[0] != "version":
            packages.add(f"scipy.{tail[0]}")
        elif first in HEAVY and first != "scipy":
            packages.add(first)
    return sorted(packages)
