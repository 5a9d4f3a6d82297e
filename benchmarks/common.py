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

from skfem_textile.studies import machine


def options(doc, name, **more):
    """Command line of a benchmark: where its results go, and what else it takes."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).with_name("results") / f"{name}.json"
    )
    for option, default in more.items():
        parser.add_argument(f"--{option}", type=type(default), default=default)
    return parser.parse_args()


def write(found, path):
    """Write what was found, and on what machine."""
    path.parent.mkdir(exist_ok=True)
    text = json.dumps({"machine": machine.described(), **found}, indent=2)
    path.write_text(text + "\n")
    print(f"results in {path}")


def seconds(function, *arguments):
    """What a function returns, and the time that it took."""
    start = perf_counter()
    result = function(*arguments)
    return result, perf_counter() - start


def spread(times):
    """Median, least and most."""
    return {"median": median(times), "least": min(times), "most": max(times)}
