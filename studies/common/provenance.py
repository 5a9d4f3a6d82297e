"""Provenance of results: command, commit, versions and machine."""

import argparse
import json
import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from skfem_textile import __version__

from .rivals.codes import interpreter
from .tables import json_text

#: The file with the runs of each study that wrote the results.
FILE = "provenance.json"

_ROOT = Path(__file__).parents[2]

# Options without influence on the results.
_NO_RESULT = "study", "out", "resume", "no_render", "workers"

_PACKAGES = (
    *("scikit-fem", "numpy", "scipy", "cvxopt"),
    *("rslab", "pypardiso", "mkl", "felupe", "scikit-fem-native"),
)


def recorded(options: argparse.Namespace) -> str:
    """The text of the file after a run with these command-line options.

    A run of selected cases is added to the earlier runs.  A full run replaces the runs
    with the same options.
    """
    chosen = {
        name: value
        for name, value in vars(options).items()
        if value and name not in _NO_RESULT and not isinstance(value, Path)
    }
    run = {"options": chosen, **commit(), **machine()}
    records = read(options.out)
    runs = records.get(options.study, [])
    if not options.case:
        runs = [
            one
            for one in runs
            if {k: x for k, x in one["options"].items() if k != "case"} != chosen
        ]
    return json_text(records | {options.study: [*runs, run]})


def read(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """The runs of each study recorded in a folder; empty without the file."""
    try:
        text = (folder / FILE).read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}
    records: dict[str, list[dict[str, Any]]] = json.loads(text)
    return records


def machine() -> dict[str, Any]:
    """Processor, cores, threads and versions; None for a missing package."""
    dolfinx = interpreter()
    versions: dict[str, str | None] = {"skfem-textile": __version__}
    versions |= {name: _version(name) for name in _PACKAGES}
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": os.environ.get("OMP_NUM_THREADS", "as many as cores"),
        "system": f"{platform.system()} on {platform.machine()}",
        "python": platform.python_version(),
        "packages": versions | {"dolfinx": dolfinx and dolfinx[1]},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [x.partition(":")[2].strip() for x in lines if x.startswith("model name")]
    return names[0] if names else platform.processor()


def commit(folder: Path = _ROOT) -> dict[str, Any]:
    """The commit of a checkout, and whether its code has uncommitted changes."""
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        changes = _git(
            folder, "status", "--porcelain", "--", "skfem_textile", "studies"
        )
    except (OSError, subprocess.CalledProcessError):
        return {"commit": None, "changed": None}
    return {"commit": commit, "changed": bool(changes)}


def _git(folder: Path, *words: str) -> str:
    command = ["git", "-C", str(folder), *words]
    child = subprocess.run(command, capture_output=True, text=True, check=True)
    return child.stdout.strip()
