"""Converged loads on meshes along the fibres, computed once and stored."""

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from ..common.tables import json_text
from ..study import Row
from .cases import ANGLES, REFERENCES, Reference, Specimen
from .runs import loads_over_inextensible, stepper

#: Where they are stored.
FILE = Path(__file__).parents[2] / "docs" / "angles" / "references.json"

#: Most by which two formulations may differ, and by which the load may change when
#: cells are halved, as shares of the load.
AGREEMENT = 0.005

# Digits after the point that are stored.  Chosen: far finer than the agreement.
_DIGITS = 6


def computed(case: Reference) -> list[Row]:
    """A row for each shear angle.

    ``load`` is the load over that of fibres that do not stretch.  ``apart`` is by how
    much another formulation differs, ``halving`` by how much the load changed when
    cells were halved, both as shares of the load.  ``lost`` is the estimate of the
    share of the load that is lost to stretch.

    Raises
    ------
    StepError
        If a run does not reach its end.
    """
    specimen = case.specimen
    loads = []
    for formulation, cells in REFERENCES:
        scene = specimen.scene(case.mesh(cells))
        result = stepper(scene, specimen, formulation).run()
        loads.append(loads_over_inextensible(scene, specimen, result))
    other, coarse, answer = loads
    assert scene.load_lost is not None
    rows = []
    for angle in ANGLES:
        shares = {
            "load": answer[angle],
            "apart": other[angle] / answer[angle] - 1,
            "halving": answer[angle] / coarse[angle] - 1,
            "lost": scene.load_lost(result.ply.fabric, angle / ANGLES[-1]),
        }
        rounded = {key: round(share, _DIGITS) for key, share in shares.items()}
        rows.append({**specimen.row, "shear_angle": angle, **rounded})
    return rows


def agree(row: Row) -> bool:
    """Whether formulations and meshes of a reference agree."""
    return max(abs(row["apart"]), abs(row["halving"])) <= AGREEMENT


def text(rows: Sequence[Row]) -> str:
    """Rows as the file stores them."""
    return json_text(list(rows))


@cache
def stored() -> dict[tuple[Specimen, int], Row]:
    """The stored rows by ply and shear angle.

    Raises
    ------
    FileNotFoundError
        If the file is missing.
    """
    rows = json.loads(FILE.read_text(encoding="utf-8"))
    return {(Specimen.of(row), row["shear_angle"]): row for row in rows}
