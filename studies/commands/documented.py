"""Commands that stand on pages, and the results of each that pages say."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path

#: Results by their names.
Results = Mapping[str, float]

#: Results of a finished command, ``(folder, printed lines) -> results``.
Reader = Callable[[Path, str], Results]

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"

#: The folder that results go to where a page says DIR.
OUT = "results"


@dataclass(frozen=True)
class Documented:
    """A command or script of a page.

    Attributes
    ----------
    page
        The page, relative to the root of the repository.  Files that it offers for
        download stand beside the command.
    command
        The command, or lines of Python, as the page prints it.
    read
        Returns the results that pages say.
    given
        What stands for words in capitals of the command.
    python
        Whether the command is lines of Python and not of a shell.
    """

    page: str
    command: str
    read: Reader
    given: Mapping[str, str] = field(default_factory=dict)
    python: bool = False

    @property
    def line(self) -> str:
        """The command as it runs."""
        line = self.command
        for word, value in {"DIR": OUT, **self.given}.items():
            line = re.sub(rf"\b{word}\b", value, line)
        return line


def of_summary(*keys: str, out: str = OUT) -> Reader:
    """Numbers of ``summary.json`` in the folder of results."""
    return partial(_of_summary, keys=keys, out=out)


def _of_summary(
    folder: Path, printed: str, keys: tuple[str, ...], out: str
) -> dict[str, float]:
    text = (folder / out / "summary.json").read_text(encoding="utf-8")
    found = json.loads(text)
    return {key: found[key] for key in keys if key in found}


def numbers_after(*words: str) -> Reader:
    """Numbers printed after each of some words, by the word and their order."""
    return partial(_numbers_after, words=words)


def _numbers_after(
    folder: Path, printed: str, words: tuple[str, ...]
) -> dict[str, float]:
    results: dict[str, float] = {}
    for word in words:
        found = re.findall(rf"{re.escape(word)}\s+({_NUMBER})", printed)
        if not found:
            raise ValueError(f"{word!r} is not followed by a number in:\n{printed}")
        results |= {f"{word}, {i}": float(x) for i, x in enumerate(found, start=1)}
    return results


def printed_numbers(*names: str) -> Reader:
    """All numbers of the last line printed, in order."""
    return partial(_printed_numbers, names=names)


def _printed_numbers(
    folder: Path, printed: str, names: tuple[str, ...]
) -> dict[str, float]:
    found = map(float, re.findall(_NUMBER, printed.splitlines()[-1]))
    return dict(zip(names, found, strict=True))


def table_of_strip(folder: Path, printed: str) -> dict[str, float]:
    """The table of ``examples/strip.py``, by line and column."""
    results: dict[str, float] = {}
    for line in printed.splitlines():
        key, *numbers = line.split()
        if len(numbers) == len(STRIPS) and all(map(_is_number, numbers)):
            named = zip(STRIPS, map(float, numbers), strict=True)
            results |= {f"{key}, {name}": x for name, x in named if "time" not in key}
    return results


#: Columns of that table.
STRIPS = "2×2 points", "one point", "macro-elements"


def table_of_hole(folder: Path, printed: str) -> dict[str, float]:
    """The lines of ``examples/hole/half_size.py``."""
    line = re.compile(rf"(\d+) triangles, +(\d+) unknowns: ({_NUMBER}) N in (\d+) s")
    names = "triangles", "unknowns", "force", "processor time"
    results: dict[str, float] = {}
    for i, found in enumerate(line.findall(printed), start=1):
        named = zip(names, map(float, found), strict=True)
        results |= {f"{name}, {i}": x for name, x in named}
    return results


def _is_number(text: str) -> bool:
    return re.fullmatch(_NUMBER, text) is not None


#: Formulations and fibre stiffnesses in N/mm of the table of meshes along the fibres.
ALONG = tuple(product(("quadratic", "full", "macro"), ("1e5", "5e9")))

_ALONG = (
    "skfem-textile run bias_extension --mesh aligned --size 8x16 --steps 4 "
    "--formulation NAME --fibre-stiffness E --out DIR"
)

#: Options of the scenes on tools whose results a page tabulates.
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
    "estimated_shear_angle_error_deg",
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

#: Imports of lines of Python, which stand at the beginning of their pages.
IMPORTS = """\
import numpy as np
from skfem_textile import Linear, Sin2
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.shear_test import BiasExtension
"""

#: The commands by the names of their cases.
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
            "docs/drape.md", f"skfem-textile run {options} --out DIR", _DRAPED
        )
        for options in ON_TOOLS
    },
    "hanging strip": Documented(
        "docs/how-to/in-space.md",
        "skfem-textile run cantilever --out hanging --set bending.warp_N_mm=6 --weight 6e-6",
        of_summary("tip_z_mm", "exact_tip_z_mm", out="hanging"),
    ),
    "tutorial": Documented(
        "docs/tutorial/index.md",
        "python whole.py",
        numbers_after("estimated_load_error", "force:"),
    ),
    "stabilisation without shear": Documented(
        "docs/theory.md",
        "skfem-textile run bias_extension --formulation one-point --size 16x32 "
        "--fibre-stiffness 1e4 --shear-stiffness 0 --out DIR",
        of_summary(
            "energy_share_of_stabilisation",
            "work_share_of_stabilisation",
            "reaction_share_of_stabilisation",
        ),
    ),
    "pull of a bias extension": Documented(
        "docs/how-to/refused-step.md",
        _PULLS,
        printed_numbers("50°", "90°"),
        python=True,
    ),
    "load of a bias extension": Documented(
        "docs/verification.md",
        _INEXTENSIBLE,
        printed_numbers("sin²", "linear"),
        python=True,
    ),
    "ply with a hole": Documented(
        "docs/case-files.md",
        "skfem-textile run examples/hole/hole.toml --out hole-results",
        of_summary("reaction_y", "estimated_load_error", out="hole-results"),
    ),
    "ply with a hole, half the element size": Documented(
        "docs/case-files.md",
        "OMP_NUM_THREADS=1 python examples/hole/half_size.py",
        table_of_hole,
    ),
}
