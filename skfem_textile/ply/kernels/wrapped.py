"""The forms as the package exports them: their numbers come from kernels."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

from ... import forms
from ...forms import Forms
from .fused import with_kernel
from .kernel import (
    HourglassKernel,
    Kernel,
    MeanTensionKernel,
    ShearKernel,
    TensionKernel,
)

_P = ParamSpec("_P")


def _fast(
    definition: Callable[_P, Forms], kernel: Callable[_P, Kernel]
) -> Callable[_P, Forms]:
    """The definition of a term, its forms assembled by a kernel of the same arguments.

    Where the kernel does not know a basis they are assembled as defined.
    """

    @wraps(definition)
    def wrapped(*args: _P.args, **kwargs: _P.kwargs) -> Forms:
        return with_kernel(definition(*args, **kwargs), kernel(*args, **kwargs))

    return wrapped


tension = _fast(forms.tension, TensionKernel)
shear = _fast(forms.shear, ShearKernel)
hourglass = _fast(forms.hourglass, HourglassKernel)
mean_tension = _fast(forms.mean_tension, MeanTensionKernel)
