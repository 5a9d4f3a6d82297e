"""Kernels of the forms, which the package imports on first use."""

from .assembly import (
    energy_entries as energy_entries,
    force_entries as force_entries,
    states as states,
    stiffness_entries as stiffness_entries,
)
from .kernel import (
    HourglassKernel as HourglassKernel,
    MeanTensionKernel as MeanTensionKernel,
    ShearKernel as ShearKernel,
    TensionKernel as TensionKernel,
    can_compute as can_compute,
)
