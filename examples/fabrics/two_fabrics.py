"""Two fabrics on two subdomains, pulled one after the other along the warp.

Both carry the same force, so the softer one stretches more.
"""

import numpy as np
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, Macro, OnePoint, Ply

SOFT, STIFF, PULLED = 500.0, 2000.0, 0.5  # N/mm, N/mm, mm


def main():
    mesh = MeshQuad.init_tensor(np.linspace(0, 20, 9), np.linspace(0, 5, 3))
    mesh = mesh.with_defaults().with_subdomains(
        {"soft": lambda x: x[0] < 10, "stiff": lambda x: x[0] > 10}
    )
    fabrics = {"soft": Fabric(SOFT, 0.1), "stiff": Fabric(STIFF, 0.1)}
    conditions = {
        "held": Condition("left", 0.0, direction=(1, 0)),
        "pulled": Condition("right", PULLED, direction=(1, 0)),
        "level": Condition("bottom", 0.0, direction=(0, 1)),
    }
    for formulation in (OnePoint(), Macro()):
        ply = Ply(mesh, fabrics, formulation)
        result = LoadStepper(ply, conditions, steps=2).run()
        strain = ply.law_strain(result.u)[0]
        low, high = float(strain.min()), float(strain.max())
        force = result.states[-1].reactions["pulled"][0] / 5.0
        print(f"{ply.formulation.name:10} strains {low:.5f} and {high:.5f}")
        # The force per width is T/λ in both, and both are 10 mm long.
        assert abs(STIFF * low / np.exp(low) / force - 1) < 1e-6
        assert abs(SOFT * high / np.exp(high) / force - 1) < 1e-6
        assert abs(10 * (np.exp(low) + np.exp(high)) - 20 - PULLED) < 1e-6


if __name__ == "__main__":
    main()
