"""Only what a scene needs: what leaving terms, pictures and packages out saves.

Times of the set-up and of an iteration of plies that need less and less, and of
imports, each import in a process of its own.  Prints medians and ratios.
"""

import subprocess
import sys
from statistics import median

from common import options, seconds, strip_of, write, write_table  # isort: skip  (sets the threads)

from skfem_textile import Fabric, Full, OnePoint, Ply

#: Plies by what they need.
PLIES = {
    "tension, shear, stabilisation": (Fabric(1e4, 0.5), OnePoint(4.0)),
    "tension, stabilisation": (Fabric(1e4), OnePoint(4.0)),
    "tension, shear": (Fabric(1e4, 0.5), OnePoint(0.0)),
    "tension": (Fabric(1e4), OnePoint(0.0)),
    "tension at 2×2 points": (Fabric(1e4), Full()),
}

IMPORTS = ("skfem", "skfem_textile", "skfem_textile.scenes", "skfem_textile.plot")


def assembled(ply, u):
    """Forces and tangent."""
    return ply.residual(u), ply.stiffness(u)


def imported(name):
    """Seconds to import a package in a new process."""
    code = (
        "from time import perf_counter as now; start = now(); "
        f"import {name}; print(now() - start)"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    return float(said.stdout)


def main():
    """Measure, print and write."""
    chosen = options(__doc__, "needs", rounds=7, size=20_000)
    scene = strip_of(chosen.size)
    times = {name: ([], []) for name in PLIES}
    for number in range(1 + chosen.rounds):
        for name, given in PLIES.items():
            ply, built = seconds(Ply, scene.mesh, *given)
            u = (1 + 1e-9 * number) * scene.displacement(ply.nodes, 0.2).T.ravel()
            assembled(ply, u)
            _, took = seconds(assembled, ply, (1 + 1e-9) * u)
            if number:
                times[name][0].append(built)
                times[name][1].append(took)
    found = {"elements": scene.mesh.nelements, "plies": {}, "imports": {}}
    most = [median(x) for x in next(iter(times.values()))]
    print("ply: set-up and forces with tangent in ms, and as shares of the first")
    for name, columns in times.items():
        values = [median(x) for x in columns]
        shares = [x / y for x, y in zip(values, most, strict=True)]
        found["plies"][name] = {"seconds": values, "shares": shares}
        print(
            f"{name:32} {1e3 * values[0]:6.0f} {1e3 * values[1]:6.1f}  "
            f"{shares[0]:.2f} {shares[1]:.2f}"
        )
    for name in IMPORTS:
        imported(name)  # once to have it in the file cache
        found["imports"][name] = median(imported(name) for _ in range(chosen.rounds))
        ratio = found["imports"][name] / found["imports"]["skfem"]
        print(
            f"import {name:25} {found['imports'][name]:.3f} s, {ratio:.2f} of skfem's"
        )
    head = ["", "set-up, share", "forces and tangent, share"]
    plies = [
        [name, *(f"{share:.2f}" for share in ply["shares"])]
        for name, ply in found["plies"].items()
    ]
    write(found, chosen.out, head, plies)
    skfem = found["imports"]["skfem"]
    imports = [
        [f"`import {name}`", f"{took:.3f}", f"{took / skfem:.2f}"]
        for name, took in found["imports"].items()
    ]
    path = chosen.out.with_name("imports.md")
    write_table(path, ["", "s", "share of skfem's"], imports)


if __name__ == "__main__":
    main()
