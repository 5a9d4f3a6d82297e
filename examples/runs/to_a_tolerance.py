"""A load to a tolerance: the mesh is refined where the shear angle jumps.

The bias extension on Delaunay's triangles, whose edges do not follow the fibres.  Kinks
of the shear angle run along the fibres from the corners of the clamps, and the coarse
mesh smears them.  Every summary has an estimate of what that costs.
"""

from skfem_textile import AdaptiveStepper, Fabric, LoadStepper, Ply
from skfem_textile.scenes import bias_extension


def main():
    scene = bias_extension("delaunay", (6, 12))
    ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
    coarse = LoadStepper(ply, scene.conditions, steps=8).run()
    stepper = AdaptiveStepper(ply, scene.conditions, tolerance=0.01, steps=8)
    result = stepper.run()
    for one in result.rounds:
        print(one)
    for name, of in (("coarse", coarse), ("refined", result)):
        summary, load = of.summary(), of.states[-1].reactions["top"][1]
        print(
            f"{name:8} {summary['n_dofs']:6} unknowns, {load:.2f} N, estimated error "
            f"{summary['estimated_load_error']:.1%}"
        )
    assert result.tolerance_met
    assert result.ply.basis.N > coarse.ply.basis.N


if __name__ == "__main__":
    main()
