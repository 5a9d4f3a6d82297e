"""Runs on a small ply in shear; its C_s depends on the last converged state."""

import json

import numpy as np

from skfem_textile import Condition, Fabric, LoadStepper, OnePoint, Ply, Sin2
from tests.helpers import distorted


def stepper(folder, pull=0.3, **options):
    ply = Ply(distorted(1).with_defaults(), Fabric(1e3, Sin2(0.5)), OnePoint())
    conditions = {
        "clamp": Condition("bottom"),
        "pull": Condition("top", pull, (1, 0)),
        "level": Condition("top", 0.0, (0, 1)),
    }
    return LoadStepper(ply, conditions, 3, checkpoint=folder, **options)


def read_npz(path):
    """Run, name, text and arrays of a file."""
    with np.load(path) as content:
        arrays = dict(content)
    of_run, name, _, text = json.loads(str(arrays.pop("text")))
    return of_run, name, text, arrays
