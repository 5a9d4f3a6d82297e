"""The forms that the package exports: with kernels, which compute their entries."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

from ... import forms
from ...forms import Forms
from .element_groups import Kernel
from .kernel import (
    HourglassKernel,
    MeanTensionKernel,
    ShearKernel,
    TensionKernel,
)
from .kernel_forms import with_kernel

_P = ParamSpec("_P")


def _with_kernel_of(
    definition: Callable[_P, Forms], kernel: Callable[_P, Kernel]
) -> Callable[_P, Forms]:
    """Give the forms of a term a kernel, which takes the same arguments."""

    @wraps(definition)
    def wrapped(*args: _P.args, **kwargs: _P.kwargs) -> Forms:
        return with_kernel(definition(*args, **kwargs), kernel(*args, **kwargs))

    return wrapped


tension = _with_kernel_of(forms.tension, TensionKernel)
shear = _with_kernel_of(forms.shear, ShearKernel)
hourglass = _with_kernel_of(forms.hourglass, HourglassKernel)
mean_tension = _with_kernel_of(forms.mean_tension, MeanTensionKernel)
