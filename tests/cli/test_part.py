"""From raw files and an outline to the deck of a part: the script of the examples."""

import os
import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.cases import read_result
from skfem_textile.io import read_part_deck
from tests.helpers.command_line import summary_in

pytestmark = pytest.mark.slow

ezdxf = pytest.importorskip("ezdxf")

EXAMPLE = Path(__file__).parents[2] / "examples" / "part"
PARTS = runpy.run_path(str(EXAMPLE / "inputs.py"))


@pytest.fixture(scope="module", params=sorted(PARTS["PARTS"]))
def chain(request, tmp_path_factory):
    """Folder in which the script has run, with few elements."""
    folder = tmp_path_factory.mktemp(request.param)
    PARTS["write"](request.param, folder)
    few = ["--size", "16x12", "--steps", "4", "--no-render"]
    done = subprocess.run(["sh", str(EXAMPLE / "part.sh"), *few], cwd=folder)
    assert done.returncode == 0
    return folder


def test_the_tutorial_has_the_commands_of_the_script():
    page = (EXAMPLE.parents[1] / "docs" / "tutorial" / "part.md").read_text()
    commands = (EXAMPLE / "part.sh").read_text().replace(' "$@"', "").splitlines()[2:]
    assert len(commands) == 6
    assert [x for x in page.splitlines() if x.startswith("skfem-textile ")] == commands


def test_the_script_writes_report_deck_and_pattern(chain):
    assert (chain / "formed" / "report.html").stat().st_size > 10_000
    summary = summary_in(chain / "formed")
    assert summary["converged"]
    assert summary["part_covered_share_of_elements"] == 1
    drawing = ezdxf.readfile(chain / "formed" / "pattern.dxf")
    assert len(drawing.modelspace().query("LWPOLYLINE[layer=='CUT']")) >= 1


def test_the_deck_has_the_fibres_of_python(chain):
    """To 0.1°, in elements with the labels and types of the user's deck."""
    users, written = (
        read_part_deck(chain / folder / "part.inp") for folder in (".", "formed/deck")
    )
    assert written.labels.tolist() == users.labels.tolist()
    assert written.types == users.types
    sheet = read_result(chain / "formed").sheet()
    fibres = drape.fibres_on_tool(sheet, users.mesh, reach=8.0)
    warp = axes_of(chain / "formed" / "deck" / "part_fibres.inp", users.labels)
    turned = np.degrees(np.arccos(np.clip((warp * fibres.warp).sum(axis=0), -1, 1)))
    assert turned.max() < 0.1


def axes_of(file, labels):
    """First axis of the distribution in each element, shape (3, n)."""
    rows = [line.split(",") for line in file.read_text().splitlines()]
    found = {int(row[0]): row[1:4] for row in rows if len(row) == 7 and row[0]}
    return np.array([found[n] for n in labels.tolist()], dtype=float).T


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_runs_the_deck(chain):
    """Six rigid motions of the free part, and frequencies above."""
    deck, quiet = chain / "formed" / "deck", {"stdout": subprocess.DEVNULL}
    threads = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(["ccx", "part_ccx"], cwd=deck, env=threads, **quiet)
    assert done.returncode == 0
    rows = [line.split() for line in (deck / "part_ccx.dat").read_text().splitlines()]
    modes = [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()]
    assert len(modes) == 8
    assert max(modes[:6]) < 0.1 * modes[6]
