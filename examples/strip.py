"""
Strip with and without tension locking
======================================

The strip of Hamila & Boisse (2013) is bent into an arc without fibre stretch. Three
computations have about the same number of unknowns. On a mesh not aligned with the
fibres, elements with 2×2 points lock: warp and weft are strained. Elements with one
stabilised point, as in the paper, have small strains, but larger position errors than
the locked mesh: away from this point only the stabilisation resists. Macro-elements, on
a coarser mesh, are elements that are split in four and evaluate the tension law at
their average strain; they have the smallest strains and position errors.
"""

import logging
from pathlib import Path

import numpy as np

from skfem_textile import Fabric, Full, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.scenes import strip

# Rows of the table: keys of the summary and factors. Except for unknowns, linear solves
# and time, the exact values are zero.
ROWS = {
    "unknowns": ("n_dofs", 1),
    "largest fibre strain (%)": ("max_fibre_strain", 100),
    "force (N)": ("reaction_x", 1),
    "energy (N·mm)": ("energy", 1),
    "position error, rms over nodes (mm)": ("displacement_error_rms", 1),
    "shear-angle error, rms over elements (°)": ("shear_angle_error_rms_deg", 1),
    "linear solves": ("linear_solves", 1),
    "run time (s)": ("wall_time_s", 1),
}


def draw_locking(results, exact, filename):
    """Draw fibre strains (top) and position errors (bottom)."""
    from matplotlib import colors, pyplot
    from matplotlib.collections import PolyCollection

    from skfem_textile.plot import FIELDS

    pyplot.rcParams["font.size"] = 9
    figure, rows = pyplot.subplots(2, 3, figsize=(6.3, 3.7), layout="constrained")
    scale = colors.SymLogNorm(1e-3, vmin=-3, vmax=3)
    strain = {"norm": scale, "cmap": FIELDS["warp_strain"].cmap}  # %
    error = {"norm": colors.Normalize(0, 0.3), "cmap": "viridis_r"}  # mm
    for column, result in zip(rows.T, results, strict=True):
        ply, moved = result.ply, result.ply.nodal(result.u)
        strains = 100 * ply.law_strain(result.u)
        low, high = strains.min(axis=(0, 2)), strains.max(axis=(0, 2))
        largest = np.where(-low > high, low, high)
        off = np.linalg.norm(moved - exact(ply.nodes, 1.0), axis=0)
        column[0].set_title(
            f"{ply.formulation.title}\nup to {np.abs(largest).max():.2g} %"
        )
        column[1].set_title(f"rms over nodes\n{np.sqrt(np.mean(off**2)):.3f} mm")
        shown = (largest, strain), (off[ply.mesh.t].mean(axis=0), error)
        for axes, (values, scale) in zip(column, shown, strict=True):
            corners = (ply.nodes + moved).T[ply.mesh.t.T]
            axes.add_collection(
                PolyCollection(corners, array=values, ec="k", lw=0.2, **scale)
            )
            axes.autoscale_view()
            axes.set_aspect("equal")
            axes.set_axis_off()
    labels = "Fibre strain (%)", "Position error (mm)"
    for row, label, extend in zip(rows, labels, ("neither", "max"), strict=True):
        shown = row[0].collections[0]
        figure.colorbar(shown, ax=row, label=label, extend=extend, format="%g")
    figure.savefig(filename, dpi=300)
    pyplot.close(figure)


def main(folder="strip-results"):
    scene = strip("irregular", size=(10, 15), jitter=0.3, seed=1)
    coarser = strip("irregular", size=(5, 8), jitter=0.3, seed=1)
    fabric = Fabric(tension=1e4, warp=scene.warp, weft=scene.weft)
    cases = [(scene, Full()), (scene, OnePoint(1.0)), (coarser, Macro())]
    log = logging.getLogger("skfem_textile")
    log.setLevel(logging.ERROR)  # each run would warn of the missing shear stiffness
    results = [
        LoadStepper(Ply(s.mesh, fabric, formulation), s.conditions, steps=20).run()
        for s, formulation in cases
    ]
    log.setLevel(logging.NOTSET)

    summaries = [s.summary(r) for (s, _), r in zip(cases, results, strict=True)]
    print(f"{'':40}" + "".join(f"{f.title:>24}" for _, f in cases))
    for label, (key, factor) in ROWS.items():
        numbers = "".join(f"{factor * summary[key]:24.4g}" for summary in summaries)
        print(f"{label:40}{numbers}")
    locked, unlocked, macro = summaries
    assert locked["max_fibre_strain"] > 20 * unlocked["max_fibre_strain"]
    assert locked["energy"] > 200 * unlocked["energy"]
    assert unlocked["max_fibre_strain"] > 10 * macro["max_fibre_strain"]
    assert unlocked["displacement_error_rms"] > 3 * locked["displacement_error_rms"]
    assert locked["displacement_error_rms"] > 2 * macro["displacement_error_rms"]

    try:
        from skfem_textile import plot

        folder = Path(folder)
        folder.mkdir(exist_ok=True)
        draw_locking(results, scene.displacement, folder / "locking.png")
        plot.shear_angle(*results, filename=folder / "shear_angle.png")
        print(f"pictures: {folder / 'locking.png'}, {folder / 'shear_angle.png'}")
    except (ImportError, RuntimeError) as error:
        print(f"the pictures were not drawn: {error}")


if __name__ == "__main__":
    main()
