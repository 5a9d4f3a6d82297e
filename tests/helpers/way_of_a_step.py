"""Prints how many files and functions of the package one load step goes through.

The step is the only one of a strip of macro-elements.  Counted are files of the package
and named functions in them that are entered while `LoadStepper.run` runs, including
set-up, diagnosis and result of the run, but not earlier work.  Each function counts
once. Names by Python with "<", such as lambdas and comprehensions, and imported names
do not count, nor does a file in which nothing else is entered.

    python -m tests.helpers.way_of_a_step [-v]

``-v`` lists the functions by file.
"""

import sys
from collections import defaultdict
from pathlib import Path

import skfem_textile
from skfem_textile import Fabric, LoadStepper, Macro, Ply
from skfem_textile.scenes import strip

PACKAGE = Path(skfem_textile.__file__).parent


def entered_functions():
    """Names of the functions that are entered, by file of the package."""
    scene = strip()
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, Macro())
    stepper, codes = LoadStepper(ply, scene.conditions, 1), set()

    def enter(frame, event, _):
        if event == "call":
            codes.add(frame.f_code)

    sys.setprofile(enter)
    try:
        stepper.run()
    finally:
        sys.setprofile(None)
    names = defaultdict(list)
    for code in codes:
        file = Path(code.co_filename)
        if file.is_relative_to(PACKAGE) and not code.co_name.startswith("<"):
            name = f"{code.co_qualname}:{code.co_firstlineno}"
            names[str(file.relative_to(PACKAGE))].append(name)
    return names


if __name__ == "__main__":
    names = entered_functions()
    if "-v" in sys.argv[1:]:
        for file, functions in sorted(names.items()):
            print(f"{file}:", *sorted(functions))
    print(f"{len(names)} files, {sum(map(len, names.values()))} functions")
