import os
import signal
import subprocess
import sys
from pathlib import Path

from processes import is_alive, wait_until

ROOT = Path(__file__).parents[2]

STUDY = """
import os, sys, time
from pathlib import Path
from skfem_textile import Full, cli
from skfem_textile.studies import stability
from skfem_textile.studies.extremes import Extreme

stability.extremes = lambda: [Extreme("family", n, None, Full()) for n in "abcd"]
stability.PICTURES = ()

def examined(problem):
    with open(problem.label, "a") as file:
        file.write(f"{os.getpid()} ")
    while problem.label == "b" and not Path("go on").exists():
        time.sleep(0.01)
    figures = {"family": problem.family, "problem": problem.name, "steps": 1}
    figures |= {"kind": problem.kind, "seed": None, "outcome": stability.RIGHT}
    figures |= {"solvable": True, "agrees": True, "path_resolved": True}
    return [figures | {"linear_solves": ord(problem.label), "energy": 0.1}]

stability.examined = examined

if __name__ == "__main__":
    sys.exit(cli.main(["study", "stability", "--no-render", *sys.argv[1:]]))
"""


def test_a_study_that_was_killed_goes_on_and_its_report_is_the_same(tmp_path):
    (tmp_path / "study.py").write_text(STUDY)
    command = [sys.executable, "study.py", "--workers", "2", "--out"]
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    kept = tmp_path / "killed" / "stability-unfinished.jsonl"
    started = tmp_path / "b"
    with subprocess.Popen([*command, "killed"], **options) as study:
        wait_until(lambda: started.is_file() and started.read_text().endswith(" "))
        wait_until(lambda: kept.is_file() and len(kept.read_text().splitlines()) == 3)
        study.send_signal(signal.SIGKILL)
    (left,) = {int(pid) for pid in started.read_text().split()}
    wait_until(lambda: not is_alive(left))
    (tmp_path / "go on").touch()
    subprocess.run([*command, "killed", "--resume"], **options, check=True)
    runs = [len((tmp_path / name).read_text().split()) for name in "abcd"]
    assert runs == [1, 2, 1, 1]
    assert not kept.exists()
    subprocess.run([*command, "whole"], **options, check=True)
    files = [p.name for p in (tmp_path / "whole").iterdir()]
    assert len(files) == 3
    for name in files:
        ours, theirs = (tmp_path / d / name for d in ("killed", "whole"))
        assert ours.read_bytes() == theirs.read_bytes()
