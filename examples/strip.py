"""The strip of Hamila & Boisse (2013), with and without tension locking.

The same unaligned mesh with 2×2 points and with one stabilised point: what the
fibres and the support feel, and a picture of both.
"""

from pathlib import Path

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import strip

FORMULATIONS = Full(), OnePoint(1.0)


def main(folder="strip-results"):
    scene = strip("irregular", size=(10, 15), jitter=0.3, seed=1)
    fabric = Fabric(tension=1e4, warp=scene.warp, weft=scene.weft)
    results = [
        LoadStepper(Ply(scene.mesh, fabric, f), scene.conditions, steps=20).run()
        for f in FORMULATIONS
    ]

    summaries = [scene.summary(result) for result in results]
    print(f"{'':28}" + "".join(f"{f.title:>20}" for f in FORMULATIONS))
    for key in (
        "max_fibre_strain",
        "max_fibre_strain_2x2",
        "reaction_x",
        "energy",
        "displacement_error_rms",
        "shear_angle_error_rms_deg",
        "newton_iterations",
        "wall_time_s",
    ):
        print(f"{key:28}" + "".join(f"{s[key]:20.4g}" for s in summaries))
    locked, unlocked = summaries
    assert locked["max_fibre_strain"] > 20 * unlocked["max_fibre_strain"]
    assert locked["energy"] > 200 * unlocked["energy"]

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
