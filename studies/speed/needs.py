"""Only what a scene needs: what each feature costs when it is used, and when it is not.

Features are added to a ply one by one.  Each ply is built and solved in a new process
(`one_ply`), and the modules that it loads are imported in another one.  Plies that
declare a feature as zero are compared with plies that leave it out.  Plies take turns;
times are processor times.
"""

import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import skfem_textile

from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings, spread
from .one_ply import FEATURES, SCENES, UNUSED

TABLES = "needs.md", "unused.md"
PICTURES = "needs.png", "needs.svg"

# Elements of a ply, a square of an even number.
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

# Thresholds in bytes that glibc would adapt, so that peaks of the memory differed by a
# tenth from process to process.  Chosen: with these assembly takes as long as without.
_MALLOC = {"MALLOC_MMAP_THRESHOLD_": "4000000", "MALLOC_TRIM_THRESHOLD_": "100000000"}

# The name of the first line, a process that only imports scikit-fem.
_ALONE = SCENES[0]

# Imports modules by their names in the order given, leaving out those that only others
# can make, and prints the seconds of processor time.
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


def measured(settings: Settings) -> Row:
    """Costs of all features, and of features that are zero."""
    elements = min(_ELEMENTS, settings.most)
    costs: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for _ in range(_ROUNDS):
        for name in (_ALONE, *FEATURES):
            results = run("scene" if name == _ALONE else "feature", name, elements)
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
    """Differences of a feature that is zero from one that is absent, as shares."""
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
    """The results of a process of `one_ply`."""
    words = "-m", "studies.speed.one_ply", kind, name, str(elements)
    results: Row = json.loads(_output(words))
    return results


def _import(modules: Sequence[str]) -> float:
    """Processor time in s to import modules."""
    return float(_output(("-c", _IMPORT), json.dumps(modules)))


def _costs(results: Row) -> dict[str, float]:
    """The other costs of a process, as far as it has them."""
    if "assembly" not in results:
        return {"memory": results["peak"]}
    return {
        "memory": results["peak"],
        "assembly": 1e3 * results["assembly"],
        "solution": 1e3 * results["solution"],
        "once": results["set_up"] + results.get("later", 0.0),
    }


def own_modules(results: Row) -> list[str]:
    """Modules of this library that a process has loaded."""
    package = skfem_textile.__name__
    return [m for m in results["modules"] if m.partition(".")[0] == package]


def _output(words: Sequence[str], text: str = "") -> str:
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


def tables(results: Row) -> dict[str, str]:
    """Costs in all with each feature, and shares of features that are zero."""
    lines = [
        [name if name == _ALONE else f"+ {name}", *_in_all(costs)]
        for name, costs in results["features"].items()
    ]
    units = {"assembly": "assembly of an iteration", "solution": "its solution"}
    head = [f"{units.get(cost, cost)}, {unit}" for cost, unit in COSTS.items()]
    unused = [
        [
            f"{name}: {UNUSED[name]}",
            len(row["further_terms"]),
            len(row["further_modules"]),
            *(_share(share) for share in row["shares"].values()),
        ]
        for name, row in results["unused"].items()
    ]
    compared = "further terms", "further modules", *list(COSTS)[1:]
    return {
        "needs.md": markdown_table(["feature", *head], lines),
        "unused.md": markdown_table(["declared as zero", *compared], unused),
    }


def figures(results: Row) -> dict[str, str]:
    """What features add, and what they cost as zero."""
    compared = next(iter(results["unused"].values()))["rounds"]
    words = {
        "needs_elements": str(results["elements"]),
        "needs_rounds": str(results["rounds"]),
        "unused_rounds": str(compared),
    }
    for name, costs in added(results).items():
        for cost, (change, scatter) in costs.items():
            text = two_digits(change, scatter)
            words[f"{_key(name)}_adds_{cost}"] = f"{text} {COSTS[cost]}"
    for name, row in results["unused"].items():
        for cost, share in row["shares"].items():
            words[f"{name}_unused_{cost}"] = _share(share)
        words[f"{name}_unused_terms"] = str(len(row["further_terms"]))
        words[f"{name}_unused_modules"] = str(len(row["further_modules"]))
    imports = results["features"][FEATURES[0]]["import"]["median"]
    alone = results["features"][_ALONE]["import"]["median"]
    words["import"] = f"{imports:.2f} s"
    words["import_scikit_fem"] = f"{alone:.2f} s"
    return words


def added(results: Row) -> dict[str, dict[str, tuple[float, float]]]:
    """What each feature adds to each cost, and the scatter of it.

    The scatter is a third of the sum of both ranges: two standard errors of a
    difference between medians of five values that are normally distributed.
    """
    every = results["features"]
    adds: dict[str, dict[str, tuple[float, float]]] = {}
    for before, name in zip((None, *every), every, strict=False):
        adds[name] = {}
        for cost, now in every[name].items():
            was = every[before].get(cost) if before else None
            was = was or dict.fromkeys(("median", "least", "most"), 0.0)
            scatter = (now["most"] - now["least"] + was["most"] - was["least"]) / 3
            adds[name][cost] = now["median"] - was["median"], scatter
    return adds


def draw(results: Row, file: Path) -> None:
    """Draw what each feature adds to each cost."""
    from .figure import waterfall

    adds = added(results)
    panels = {
        f"{cost.capitalize()}, {unit}": [
            costs.get(cost, (0.0, 0.0)) for costs in adds.values()
        ]
        for cost, unit in COSTS.items()
    }
    waterfall(panels, list(adds), file)


def two_digits(change: float, scatter: float = 0.0) -> str:
    """Text of a change with its sign; none within its scatter.

    Examples
    --------
    >>> two_digits(0.123), two_digits(-321.4), two_digits(0.1, scatter=0.2)
    ('+0.12', '−321', '≈ 0')
    """
    if abs(change) < scatter:
        return "≈ 0"
    digits = f"{change:+.2g}" if abs(change) < 100 else f"{change:+.0f}"
    return digits.replace("-", "−")


def _key(name: str) -> str:
    """A name as it stands in the names of results."""
    return name.replace(" ", "_").replace("-", "_").lower()


def _in_all(costs: dict[str, Any]) -> list[str]:
    digits = {"import": 2, "memory": 0, "assembly": 1, "solution": 0, "once": 2}
    return [
        f"{costs[cost]['median']:.{digits[cost]}f}" if cost in costs else ""
        for cost in COSTS
    ]


def _share(share: dict[str, float]) -> str:
    """A share in per cent with its range: median, and quartiles."""
    middle, low, high = (_signed(100 * share[x]) for x in ("median", "low", "high"))
    return f"{middle} % ({low} to {high} %)"


def _signed(share: float) -> str:
    """One digit after the point, and the sign unless it is zero."""
    rounded = round(share, 1)
    return f"{rounded:+.1f}".replace("-", "−") if rounded else "0.0"
