"""Commands of pages, run in folders that are empty but for what the pages offer."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from .documented import IMPORTS, Documented, Results

ROOT = Path(__file__).parents[2]

_THREADS = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
_OFFERED = re.compile(r"{download}`(?:[^`]*<)?([^`<>]+)>?`")


def results_of(documented: Documented) -> Results:
    """Run a command on one thread and return its results.

    Raises
    ------
    RuntimeError
        If the command ends with another exit code than 0.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        page = ROOT / documented.page
        (folder / "examples").symlink_to(ROOT / "examples")
        for offered in _OFFERED.findall(page.read_text(encoding="utf-8")):
            shutil.copy(page.parent / offered, folder)
        words = ["bash", "-c", documented.line]
        if documented.python:
            words = [sys.executable, "-c", IMPORTS + documented.line]
        search = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        environment = os.environ | dict.fromkeys(_THREADS, "1") | {"PATH": search}
        child = subprocess.run(
            words, cwd=folder, env=environment, capture_output=True, text=True
        )
        if child.returncode:
            raise RuntimeError(f"{documented.line}: {child.stderr.strip()[-2000:]}")
        return documented.read(folder, child.stdout.strip())
