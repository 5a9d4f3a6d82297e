"""Prints how many files and functions of the package a load step, or an option, takes.

    python -m tests.helpers.ways strip|hemisphere|option [-v]

``strip``, ``hemisphere``: functions that are entered in the second of two steps of a
strip of macro-elements, and of a hemisphere formed between a punch and a die.

``option``: functions of which an argument has the locking angle of a shear law, as the
word that was typed, in a table of the case, or in radians, from the command line until
the ply is built on a mesh that stays as it is.

Each function of the package counts once; lambdas, comprehensions and files in which
nothing else is entered do not count.  ``-v`` lists the functions, of an option in the
order in which they are entered.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path
from unittest import mock

import skfem_textile
from skfem_textile import Fabric, Macro
from skfem_textile.cli import main as cli
from skfem_textile.scenes import Case, hemisphere_forming, strip
from skfem_textile.solve.stepper import Run

PACKAGE = Path(skfem_textile.__file__).parent

#: The angle in degrees as typed, and its first digits in radians.
ANGLE, RADIANS = "59.731", "1.0425"


def entered(act, counts=lambda frame: True, last=""):
    """Files and names of functions that a call enters, up to the last one if named."""
    found, ended = {}, False

    def enter(frame, event, _):
        nonlocal ended
        code = frame.f_code
        file = Path(code.co_filename)
        if ended or event != "call" or code.co_name.startswith("<"):
            return
        if file.is_relative_to(PACKAGE) and counts(frame):
            name = f"{code.co_qualname}:{code.co_firstlineno}"
            found[str(file.relative_to(PACKAGE)), name] = None
        ended = code.co_qualname == last

    sys.setprofile(enter)
    try:
        act()
    finally:
        sys.setprofile(None)
    return list(found)


def of_second_step(scene):
    """Functions of the second of two load steps."""
    found, step = [], Run._step

    def entering(run, t_end):
        found.append(sorted(entered(lambda: step(run, t_end))))

    case = Case(scene=scene, fabric=Fabric(1e4, 0.5), formulation=Macro(), steps=2)
    with mock.patch.object(Run, "_step", entering):
        case.run()
    return found[1]


def of_an_option():
    """Functions that an option of a law goes through."""
    law = ["--shear-law", "locking", "--set", f"shear.locking_angle_deg={ANGLE}"]
    command = ["run", "bias_extension", "--size", "2x4", "--steps", "1", *law]
    command.append("--mesh-as-is")
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as quiet:
        quiet.enter_context(contextlib.redirect_stdout(io.StringIO()))
        quiet.enter_context(contextlib.redirect_stderr(io.StringIO()))
        words = [*command, "--no-render", "--out", folder]
        return entered(lambda: cli.main(words), _has_angle, "Ply.__init__")


def _has_angle(frame):
    """True if an argument of a function has the angle."""
    code = frame.f_code
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount + 2]
    for name in names:
        with contextlib.suppress(Exception):  # of a partly initialised object
            text = repr(frame.f_locals.get(name))
            if ANGLE in text or RADIANS in text:
                return True
    return False


if __name__ == "__main__":
    ways = {
        "strip": lambda: of_second_step(strip()),
        "hemisphere": lambda: of_second_step(hemisphere_forming(size=(8, 8))),
        "option": of_an_option,
    }
    functions = ways[sys.argv[1]]()
    if "-v" in sys.argv[2:]:
        for file, name in functions:
            print(file, name)
    print(f"{len({file for file, _ in functions})} files, {len(functions)} functions")
