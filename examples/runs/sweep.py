"""A parameter study: the load of a bias-extension test, by stiffness and shear angle.

Two worker processes share the cases, or with ``--dask`` the workers of a cluster, here
one on this machine.  Every result is on file as soon as it comes: a study that was
killed resumes when it is started again.
"""

import sys
from itertools import product

import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply
from skfem_textile.scenes import bias_extension
from skfem_textile.sweep import WorkerProcesses, sweep

G = 0.5  # N/mm
RATIOS, ANGLES = (2e4, 2e5, 2e6), (10, 20, 30, 40)  # E/G, degrees


def load(case):
    """The load over that of fibres that do not stretch."""
    ratio, degrees = case
    scene = bias_extension(size=(4, 8), shear_angle=np.radians(degrees))
    fabric = Fabric(ratio * G, G, scene.warp, scene.weft)
    result = LoadStepper(Ply(scene.mesh, fabric), scene.conditions, steps=4).run()
    return scene.summary(result)["load_over_exact"]


def study(executor):
    cases, shares = product(RATIOS, ANGLES), {}
    for (ratio, degrees), share in sweep(load, cases, executor, out="loads.jsonl"):
        print(f"E/G = {ratio:.0e}, {degrees}°: {share:.3f}")
        shares[ratio, degrees] = share
    return shares


def main(dask="--dask" in sys.argv):
    if dask:
        from dask.distributed import Client, LocalCluster

        # A cluster of many machines is Client("tcp://scheduler:8786") instead.
        with (
            LocalCluster(n_workers=2, threads_per_worker=1) as cluster,
            Client(cluster) as client,
        ):
            shares = study(client.get_executor())
    else:
        with WorkerProcesses(2) as executor:
            shares = study(executor)
    print("load over exact, by E/G and shear angle")
    print(" " * 8 + "".join(f"{degrees:7}°" for degrees in ANGLES))
    for ratio in RATIOS:
        row = (f"{shares[ratio, degrees]:8.3f}" for degrees in ANGLES)
        print(f"{ratio:8.0e}" + "".join(row))
    assert all(abs(share - 1) < 0.1 for share in shares.values())


if __name__ == "__main__":
    main()
