"""
Load lost to fibre stretch
==========================

Load of a bias-extension test relative to the load for inextensible fibres, for several
stiffnesses and shear angles. Each result is saved immediately: an interrupted sweep
resumes when it is restarted. The lower the fibre stiffness, the larger the load lost to
fibre stretch.
"""

import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, plot
from skfem_textile.scenes import bias_extension
from skfem_textile.sweep import WorkerProcesses, sweep

G = 0.5  # N/mm
RATIOS, ANGLES = (2e4, 2e5, 2e6), (10, 20, 30, 40)  # E/G, degrees

# %%
# A case is a pair of E/G and a shear angle in degrees.


def load(case):
    """Ratio of the load to the load for inextensible fibres."""
    ratio, degrees = case
    scene = bias_extension(size=(4, 8), shear_angle=np.radians(degrees))
    fabric = Fabric(ratio * G, G, scene.warp, scene.weft)
    result = LoadStepper(Ply(scene.mesh, fabric), scene.conditions, steps=4).run()
    return scene.summary(result)["load_over_exact"]


# %%
# This page uses threads. ``python sweep.py --processes`` runs two cases at a time on
# two processors, and ``--dask`` on the workers of a cluster, here a local one. Code
# that must not run again when a process imports the script is below
# ``if __name__ == "__main__"``.


def study(executor, folder):
    """All cases, by E/G and shear angle."""
    cases, shares = product(RATIOS, ANGLES), {}
    for (ratio, degrees), share in sweep(load, cases, executor, out=folder / "loads"):
        print(f"E/G = {ratio:.0e}, {degrees}°: {share:.3f}")
        shares[ratio, degrees] = share
    return shares


def run(folder, workers):
    """Run the study on threads, processes or dask workers."""
    if workers == "dask":
        from dask.distributed import Client, LocalCluster

        # For a cluster of several machines, use Client("tcp://scheduler:8786").
        with (
            LocalCluster(n_workers=2, threads_per_worker=1) as cluster,
            Client(cluster) as client,
        ):
            return study(client.get_executor(), folder)
    many = WorkerProcesses if workers == "processes" else ThreadPoolExecutor
    with many(2) as executor:
        return study(executor, folder)


# %%
# The results are written to a temporary folder here. Use a permanent one in practice.

if __name__ == "__main__":
    workers = sys.argv[-1].removeprefix("--")
    shares = run(Path(mkdtemp()), workers)
    assert all(abs(share - 1) < 0.1 for share in shares.values())
    assert all(shares[2e4, angle] < shares[2e6, angle] for angle in ANGLES)
    curves = {
        f"E/G = {ratio:,.0f}": (ANGLES, [shares[ratio, angle] for angle in ANGLES])
        for ratio in RATIOS
    }
    plot.curves({"": curves}, "Shear angle (°)", "Load / exact load", "load.png")
