"""What the benchmarks share: one thread, medians, and results as JSON."""

import os

# Before any library of linear algebra is loaded.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import json
from pathlib import Path
from statistics import median
from time import perf_counter

from skfem_textile.scenes import strip
from skfem_textile.studies import machine

#: Where results go, for the docs to show.
RESULTS = Path(__file__).parents[1] / "docs" / "speed"


def options(doc, name, **more):
    """Command line of a benchmark: where its results go, and what else it takes."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument(
        "--out",
        type=Path,
        default=RESULTS / f"{name}.json",
        help="where the results go as JSON; tables go beside",
    )
    for option, default in more.items():
        parser.add_argument(f"--{option}", type=type(default), default=default)
    return parser.parse_args()


def write(found, path, head, rows):
    """Write what was found, and on what machine, as JSON and as a table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    there = machine.described()
    path.write_text(json.dumps({"machine": there, **found}, indent=2) + "\n")
    write_table(path.with_suffix(".md"), head, rows)
    path.with_name("machine.md").write_text(machine.sentence(there) + "\n")
    print(f"results in {path}")


def seconds(function, *arguments):
    """What a function returns, and the time that it took."""
    start = perf_counter()
    result = function(*arguments)
    return result, perf_counter() - start


def write_table(path, head, rows):
    """Write a table in Markdown."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    path.write_text("".join(f"| {' | '.join(map(str, line))} |\n" for line in lines))


def strip_of(elements, **more):
    """The strip on about so many elements."""
    across = (elements / 1.5) ** 0.5
    return strip(size=(round(across), round(1.5 * across)), **more)


def spread(times):
    """Median, least and most."""
    return {"median": median(times), "least": min(times), "most": max(times)}
