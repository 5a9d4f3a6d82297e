"""
A strip, with tension locking and without
=========================================

The strip of Hamila & Boisse (2013) is bent into an arc whose fibres do not stretch. It
is computed three times with about as many unknowns: on a mesh that follows no fibre
with 2×2 points, which lock; with one stabilised point, as in the paper; and on a
coarser mesh as macro-elements, which are split in four. Warp and weft are strained
where the elements lock, and the shape is best with macro-elements.
"""

from pathlib import Path

from skfem_textile import Fabric, Full, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.scenes import strip


def main(folder="strip-results"):
    scene = strip("irregular", size=(10, 15), jitter=0.3, seed=1)
    coarser = strip("irregular", size=(5, 8), jitter=0.3, seed=1)
    fabric = Fabric(tension=1e4, warp=scene.warp, weft=scene.weft)
    cases = [(scene, Full()), (scene, OnePoint(1.0)), (coarser, Macro())]
    results = [
        LoadStepper(Ply(s.mesh, fabric, formulation), s.conditions, steps=20).run()
        for s, formulation in cases
    ]

    summaries = [s.summary(r) for (s, _), r in zip(cases, results, strict=True)]
    print(f"{'':28}" + "".join(f"{f.title:>20}" for _, f in cases))
    for key in (
        "n_dofs",
        "max_fibre_strain",
        "mesh_fibre_strain",
        "reaction_x",
        "energy",
        "displacement_error_rms",
        "shear_angle_error_rms_deg",
        "linear_solves",
        "wall_time_s",
    ):
        print(f"{key:28}" + "".join(f"{s[key]:20.4g}" for s in summaries))
    locked, unlocked, macro = summaries
    assert locked["max_fibre_strain"] > 20 * unlocked["max_fibre_strain"]
    assert locked["energy"] > 200 * unlocked["energy"]
    assert unlocked["displacement_error_rms"] > 4 * macro["displacement_error_rms"]

    try:
        from skfem_textile import plot

        folder = Path(folder)
        folder.mkdir(exist_ok=True)
        for draw in (plot.fibre_strain, plot.shear_angle):
            file = folder / f"{draw.__name__}.png"
            draw(*results, filename=file)
            print(f"wrote {file}")
    except (ImportError, RuntimeError) as error:
        print(f"no pictures: {error}")


if __name__ == "__main__":
    main()
