"""Commands on documentation pages, and the results quoted there.

Commands run in folders that contain only the files offered on the page.  Further cases
compare the estimated load loss by fibre stretch with converged loads.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, Quadratic
from skfem_textile.scenes import bias_extension

from ..angles.cases import LAWS, G, graded_mesh
from ..common.running import ONE_THREAD

ROOT = Path(__file__).parents[2]

#: Results by name.
Results = Mapping[str, float]

#: Results of a finished command, ``(folder, printed lines) -> results``.
Reader = Callable[[Path, str], Results]

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"

_OFFERED = re.compile(r"\]\(([\w./-]+\.(?!md|ipynb)\w+)\)")

#: Folder of results that replaces DIR.
OUT = "results"

# Cells along a rhombus side, and load steps, of plies with fibre stretch.  With 16
# cells the load loss differs by at most a tenth, at E/G = 2e6.
_CELLS, _STEPS = 24, 4


@dataclass(frozen=True)
class Documented:
    """A command or script on a page.

    Attributes
    ----------
    page
        The page, relative to the root of the repository.  Files that it offers for
        download are copied to the working folder.
    command
        The command, or lines of Python, as printed on the page.
    read
        Returns the results quoted on pages.
    given
        Replacements of capitalised words in the command.
    python
        True for lines of Python instead of a shell command.
    """

    page: str
    command: str
    read: Reader
    given: Mapping[str, str] = field(default_factory=dict)
    python: bool = False

    @property
    def line(self) -> str:
        """The command with replacements."""
        line = self.command
        for word, value in {"DIR": OUT, **self.given}.items():
            line = re.sub(rf"\b{word}\b", value, line)
        return line

    def results(self) -> Results:
        """Run the command on one thread and return its results.

        Raises
        ------
        RuntimeError
            If the exit code of the command is not 0.
        """
        with TemporaryDirectory() as name:
            folder, page = Path(name), ROOT / self.page
            (folder / "examples").symlink_to(ROOT / "examples")
            for offered in _OFFERED.findall(page.read_text(encoding="utf-8")):
                shutil.copy(page.parent / offered, folder)
            words = ["bash", "-c", self.line]
            if self.python:
                words = [sys.executable, "-c", IMPORTS + self.line]
            search = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
            child = subprocess.run(
                words,
                cwd=folder,
                env=os.environ | ONE_THREAD | {"PATH": search},
                capture_output=True,
                text=True,
            )
            if child.returncode:
                raise RuntimeError(f"{self.line}: {child.stderr.strip()[-2000:]}")
            return self.read(folder, child.stdout.strip())


def of_summary(*keys: str, out: str = OUT) -> Reader:
    """Read numbers from ``summary.json`` in the folder of results."""

    def read(folder: Path, printed: str) -> Results:
        text = (folder / out / "summary.json").read_text(encoding="utf-8")
        summary = json.loads(text)
        return {key: summary[key] for key in keys if key in summary}

    return read


def printed_numbers(*names: str) -> Reader:
    """Read all numbers of the last printed line."""

    def read(folder: Path, printed: str) -> Results:
        words = map(float, re.findall(_NUMBER, printed.splitlines()[-1]))
        return dict(zip(names, words, strict=True))

    return read


def table_of_strip(folder: Path, printed: str) -> dict[str, float]:
    """Read the table of ``examples/strip.py``, by line and column."""
    results: dict[str, float] = {}
    for label, numbers in re.findall(
        rf"^(\S.*?)((?: +{_NUMBER}){{3}})$", printed, re.M
    ):
        named = zip(STRIPS, map(float, numbers.split()), strict=True)
        results |= {f"{label}, {name}": x for name, x in named if "time" not in label}
    return results


#: Columns of that table.
STRIPS = "2×2 points", "one point", "macro-elements"


def table_of_hole(folder: Path, printed: str) -> dict[str, float]:
    """Read the output of ``examples/hole/half_size.py``."""
    line = re.compile(rf"(\d+) triangles, +(\d+) unknowns: ({_NUMBER}) N in (\d+) s")
    names = "triangles", "unknowns", "force", "processor time"
    results: dict[str, float] = {}
    for i, words in enumerate(line.findall(printed), start=1):
        named = zip(names, map(float, words), strict=True)
        results |= {f"{name}, {i}": x for name, x in named}
    return results


#: Formulations and fibre stiffnesses in N/mm of the table of fibre-aligned meshes.
ALONG = tuple(product(("quadratic", "full", "macro"), ("1e5", "5e9")))

_ALONG = (
    "skfem-textile run bias_extension --mesh aligned --mesh-as-is --size 8x16 "
    "--steps 4 --formulation NAME --fibre-stiffness E --out DIR"
)

#: Options of the tabulated scenes on tools.
ON_TOOLS = (
    "hemisphere",
    "hemisphere --fibres 45",
    "hemisphere --tension 0 --set bending.warp_N_mm=5 bending.weft_N_mm=5",
    "cylinder --fibres 20",
    "saddle",
    "double_dome --fibres 45",
    "double_dome --fibre-stiffness 1e5",
)

_DRAPED = of_summary(
    "max_shear_angle_deg",
    "shear_angle_error_max_deg",
    "shear_angle_error_rms_deg",
    "shear_angle_error_deg",
    "bridging_share_of_area",
    "wrinkle_risk_share_of_area",
    "linear_solves",
)

_INEXTENSIBLE = """\
scene = bias_extension(shear_angle=np.radians(40))  # 50 mm × 100 mm, ±45°
print(scene.load(Sin2(0.5), 1.0), scene.load(Linear(0.5), 1.0))  # N
"""

_PULLS = """\
test = BiasExtension(width=50, height=100)  # mm
print(*test.displacement(np.radians([50, 90])))  # mm
"""

#: Imports for lines of Python, as at the beginning of their pages.
IMPORTS = """\
import numpy as np
from skfem_textile import Linear, Sin2
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.shear_test import BiasExtension
"""

#: The commands by case name.
DOCUMENTED: Mapping[str, Documented] = {
    "strip": Documented("README.md", "python examples/strip.py", table_of_strip),
    **{
        f"mesh along the fibres, {name}, E = {E}": Documented(
            "docs/how-to/my-mesh.md",
            _ALONG,
            of_summary("displacement_error_max", "load_over_exact"),
            {"NAME": name, "E": E},
        )
        for name, E in ALONG
    },
    **{
        f"on a tool: {options}": Documented(
            "docs/benchmarks/drape.md",
            f"skfem-textile run {options} --out DIR",
            _DRAPED,
        )
        for options in ON_TOOLS
    },
    "pull of a bias extension": Documented(
        "docs/how-to/refused-step.md",
        _PULLS,
        printed_numbers("50°", "90°"),
        python=True,
    ),
    "load of a bias extension": Documented(
        "docs/benchmarks/verification.md",
        _INEXTENSIBLE,
        printed_numbers("sin²", "linear"),
        python=True,
    ),
    "ply with a hole, half the element size": Documented(
        "docs/how-to/case-files.md",
        "OMP_NUM_THREADS=1 python examples/hole/half_size.py",
        table_of_hole,
    ),
}


@dataclass(frozen=True)
class Stretched:
    """A bias extension: angles in degrees, a shear law, and E/G of warp and weft."""

    inclination: float
    shear_angle: float
    ratios: tuple[float, float]
    law: str = "linear"

    @property
    def name(self) -> str:
        """Name of the case."""
        ratios = " and ".join(f"{x:.0e}".replace("e+0", "e") for x in self.distinct)
        angles = f"{self.inclination:g}°, γ = {self.shear_angle:g}°"
        return f"fibre stretch at {angles}, {self.law}, E/G = {ratios}"

    @property
    def distinct(self) -> list[float]:
        """The distinct ratios E/G."""
        return sorted(set(self.ratios))

    def results(self) -> Results:
        """Estimated and measured fraction of the load lost to fibre stretch."""
        theta, gamma = np.radians([self.inclination, self.shear_angle])
        mesh = graded_mesh(theta, _CELLS)
        scene = bias_extension(mesh, warp=theta, weft=np.pi - theta, shear_angle=gamma)
        warp, weft = self.ratios
        fabric = Fabric((G * warp, G * weft), LAWS[self.law], scene.warp, scene.weft)
        along = Ply(scene.mesh, fabric, Quadratic())
        summary = scene.summary(LoadStepper(along, scene.conditions, _STEPS).run())
        return {
            "estimate": float(summary["load_lost_to_fibre_stretch"]),
            "measured": 1 - float(summary["load_over_exact"]),
        }


def _both(ratio: float) -> tuple[float, float]:
    return ratio, ratio


#: The cases by name.
STRETCHED = {
    ply.name: ply
    for ply in (
        Stretched(30, 40, _both(2e4)),
        Stretched(30, 40, _both(2e5)),
        Stretched(35, 70, _both(2e5)),
        Stretched(45, 20, _both(2e5)),
        Stretched(45, 40, _both(2e4)),
        Stretched(45, 40, _both(2e5)),
        Stretched(45, 40, _both(2e6)),
        Stretched(45, 40, (2e4, 2e5)),
        Stretched(45, 40, _both(2e3), "sin²"),
        Stretched(45, 40, _both(2e5), "sin²"),
        Stretched(52.5, 40, _both(2e4)),
        Stretched(52.5, 40, _both(2e6)),
        Stretched(60, 20, _both(2e4)),
        Stretched(60, 40, _both(2e4)),
        Stretched(60, 40, _both(2e5)),
    )
}
