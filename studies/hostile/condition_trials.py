"""Trials of conditions, laws and settings: refused in one line, or run rightly."""

import warnings
from pathlib import Path

import numpy as np
from numpy.random import default_rng

from skfem_textile import Result, StepError

from . import argument_cases, condition_cases
from .bench import Bench, Case, check_result
from .mechanics import WrongError
from .trial import RIGHT, SILENT, Family, Finding, refused, surprised

_CASES = {**condition_cases.CASES, **argument_cases.CASES}

#: How many meshes for each case.
_MESHES = 10


def attempt(seed: int, folder: Path) -> Finding:
    """Try a case on the mesh of a seed."""
    name = list(_CASES)[seed % len(_CASES)]
    case, loose = _CASES[name], name in condition_cases.LOOSE
    bench = Bench.of(default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = case.act(bench)
        except StepError as stop:
            if not loose:
                return Finding(SILENT, name, f"stopped: {stop}")
            return refused(name, str(stop))
        except ValueError as error:
            return _judge_refusal(name, case, str(error))
        except Exception as error:
            return surprised(name, error)
    if case.names is not None and not loose:
        return Finding(SILENT, name, f"taken: {found!r}")
    return _judge(name, found, case.moves(bench) if case.moves else ())


def _judge_refusal(name: str, case: Case, line: str) -> Finding:
    if case.names is None:
        return Finding(SILENT, name, f"refused, though sound: {line}")
    if case.names not in line:
        return Finding(SILENT, name, f"{case.names!r} is not named: {line}")
    return refused(name, line)


def _judge(name: str, found: Result, moves: object) -> Finding:
    try:
        with np.errstate(all="ignore"):
            check_result(found, moves)
    except WrongError as wrong:
        return Finding(SILENT, name, str(wrong))
    return Finding(RIGHT, name)


FAMILY = Family("conditions", attempt, len(_CASES) * _MESHES, short=100)
