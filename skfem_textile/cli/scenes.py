"""The commands ``list`` and ``init``: scenes, and a case file as a starting point."""

from argparse import Namespace

from ..cases.read import declared
from ..cases.scenes import SCENES
from ..cases.tables import summary_of
from ..cases.write import case_text
from ..fabric.catalogue import catalogue
from ..mesh.user_input import printable
from .output import say


def list_scenes(_: Namespace) -> int:
    """Print a line for each scene, and the fabrics; returns the exit code."""
    width = max(map(len, SCENES)) + 2
    for name, scene in SCENES.items():
        say(f"{name:{width}}{summary_of(scene)}")
    say(f"fabrics for --fabric: {', '.join(catalogue())}")
    return 0


def write_case(options: Namespace) -> int:
    """Write the case file of a scene with all defaults and comments.

    Returns the exit code.

    Raises
    ------
    OSError
        If the file exists or cannot be written.
    """
    name = printable(options.file.name)
    head = f"# A case file. Run it with: skfem-textile run {name} --out results"
    text = case_text(declared({"scene": {"name": options.scene}}), head)
    with open(options.file, "x", encoding="utf-8") as opened:
        opened.write(text)
    say(f"case file of the scene {options.scene} written to {printable(options.file)}")
    return 0
