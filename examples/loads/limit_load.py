"""A limit load: a square of cloth sheared by a dead force.

The shear law w = G sin²γ/2 lets a square of side L, whose fibres lie along its sides,
carry at most F = G L/2 along (1, −1)/√2, at γ = 45°.  Past it there is no equilibrium
nearby: the load stepper says so and gives the last state.
"""

import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Ply,
    Sin2,
    StepError,
)

L, G, E = 10.0, 0.5, 1e5  # mm, N/mm, N/mm
LIMIT = G * L / 2


def main():
    mesh = MeshQuad().refined(2).scaled(L).with_defaults()
    down = np.array([1.0, -1.0]) / np.sqrt(2)
    for applied in (1.5, 20.0):
        load = Force("top", applied * LIMIT * down)
        ply = Ply(mesh, Fabric(E, Sin2(G)), Full(), [load])
        stepper = LoadStepper(ply, {"clamp": Condition("bottom")}, steps=10)
        try:
            stepper.run()
        except StepError as error:
            print(error)
            last = error.result.states[-1]
        else:
            raise AssertionError("the load was carried past its limit")
        found = last.load_factor * applied
        angle = np.degrees(np.abs(ply.shear_angle(last.u)).max())
        print(f"limit load {found:.4f} of {LIMIT} N per newton, at {angle:.1f}°")
        assert abs(found - 1) < 0.01
        assert last.verdict.stable


if __name__ == "__main__":
    main()
