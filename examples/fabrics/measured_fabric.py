"""A fabric from a laboratory: a table of shear, and fibres with crimp in tension only.

Strips of it are pulled along the warp, where the force is that of the law, and sheared
in a picture frame, where the moment is that of the table.
"""

from pathlib import Path

import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    Full,
    LoadStepper,
    Ply,
    Tabulated,
    TensionOnly,
)
from skfem_textile.scenes import picture_frame

MEASURED = """shear angle (deg),moment (N mm/mm2)
0,0
30,0.035
40,0.120
50,0.900
"""


def main():
    Path("shear.csv").write_text(MEASURED)
    shear = Tabulated.from_csv("shear.csv", odd=True)
    fibres = TensionOnly(CrimpToe(1e5, toe=0.004, initial_stiffness=10.0))

    scene = picture_frame(size=(2, 2), shear_angle=np.radians(40.0))
    ply = Ply(scene.mesh, Fabric(fibres, shear, scene.warp, scene.weft), Full())
    result = LoadStepper(ply, scene.conditions, steps=4).run()
    moments = shear.value(ply.shear_angle(result.u))
    print(f"moment at 40 degrees: {moments.mean():.4f} N mm/mm2")
    assert np.allclose(moments, 0.120, rtol=1e-6)

    mesh = MeshQuad().scaled(10.0).refined(1).with_defaults()
    ply = Ply(mesh, Fabric(fibres, shear), Full())
    pulled = {
        "held": Condition("left", 0.0, direction=(1, 0)),
        "pulled": Condition("right", 0.1, direction=(1, 0)),
        "level": Condition("bottom", 0.0, direction=(0, 1)),
    }
    force = LoadStepper(ply, pulled, steps=4).run().states[-1].reactions["pulled"][0]
    exact = 10.0 * fibres.value(np.log([1.01]))[0] / 1.01  # W T/λ
    print(f"pull of 1 %: {force:.3f} N, exactly {exact:.3f} N")
    assert abs(force / exact - 1) < 1e-8


if __name__ == "__main__":
    main()
