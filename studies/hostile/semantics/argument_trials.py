"""Trials of conditions, laws and settings: refused in one line, or run rightly."""

import warnings
from pathlib import Path

import numpy as np
from numpy.random import default_rng

from skfem_textile import StepError

from ..trial import SILENT, Family, Finding, checked, refused, surprised
from . import argument_cases, condition_cases
from .specimen import Case, Specimen, check_result

_CASES = {**condition_cases.CASES, **argument_cases.CASES}

#: Meshes for each case.
_MESHES = 10


def attempt(seed: int, folder: Path) -> Finding:
    """Try a case on the mesh of a seed."""
    name = list(_CASES)[seed % len(_CASES)]
    case, loose = _CASES[name], name in condition_cases.LOOSE
    specimen = Specimen.of(default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            result = case.act(specimen)
        except StepError as stop:
            if not loose:
                return Finding(SILENT, name, f"stopped: {stop}")
            return refused(name, str(stop))
        except ValueError as error:
            return _refusal(name, case, str(error))
        except Exception as error:
            return surprised(name, error)
    if case.names is not None and not loose:
        return Finding(SILENT, name, f"taken: {result!r}")
    with np.errstate(all="ignore"):
        moves = case.moves(specimen) if case.moves else ()
        return checked(name, check_result, result, moves)


def _refusal(name: str, case: Case, message: str) -> Finding:
    if case.names is None:
        return Finding(SILENT, name, f"refused, though sound: {message}")
    if case.names not in message:
        return Finding(SILENT, name, f"{case.names!r} is not named: {message}")
    return refused(name, message)


FAMILY = Family("conditions", attempt, len(_CASES) * _MESHES, short=100)
