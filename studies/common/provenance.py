"""Where results come from: the command, the commit, the versions and the machine."""

import argparse
import json
import subprocess
from pathlib import Path
from typing import Any

from . import machine_and_versions
from .tables import json_text

#: The file beside the results, with the runs of each study that wrote them.
FILE = "provenance.json"

_ROOT = Path(__file__).parents[2]

# Options that do not change results.
_NO_RESULT = "study", "out", "resume", "no_render", "workers"


def recorded(options: argparse.Namespace) -> str:
    """The text of the file after a run, given the options of its command line.

    A run of some cases is added to the earlier runs.  A whole run replaces those with
    the same options.
    """
    chosen = {
        name: value
        for name, value in vars(options).items()
        if value and name not in _NO_RESULT and not isinstance(value, Path)
    }
    run = {"options": chosen, **_commit(), **machine_and_versions.described()}
    records = read(options.out)
    runs = records.get(options.study, [])
    if not options.case:
        runs = [one for one in runs if _without_cases(one["options"]) != chosen]
    return json_text(records | {options.study: [*runs, run]})


def _without_cases(options: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in options.items() if key != "case"}


def read(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """The runs of each study that wrote into a folder; empty without the file."""
    try:
        text = (folder / FILE).read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}
    records: dict[str, list[dict[str, Any]]] = json.loads(text)
    return records


def _commit() -> dict[str, Any]:
    """The commit of the code, and whether the code differs from it."""
    try:
        commit = _git("rev-parse", "HEAD")
        changes = _git("status", "--porcelain", "--", "skfem_textile", "studies")
    except (OSError, subprocess.CalledProcessError):
        return {"commit": None, "changed": None}
    return {"commit": commit, "changed": bool(changes)}


def _git(*words: str) -> str:
    command = ["git", "-C", str(_ROOT), *words]
    child = subprocess.run(command, capture_output=True, text=True, check=True)
    return child.stdout.strip()
