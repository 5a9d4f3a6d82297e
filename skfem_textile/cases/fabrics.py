"""Fabrics of cases: from files, with samples, and as tables of a case file."""

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from msgspec import structs

from ..declarations.scenes import Formed
from ..fabric import (
    Asymmetric,
    BiaxialLaw,
    Fabric,
    Pretensioned,
    TensionOnly,
    TwoLaws,
)
from ..fabric.law import n_slips
from ..mesh.user_input import errors_in
from .schema import (
    Bending,
    FabricOfFile,
    PlyTable,
    Shear,
    ShearLaw,
    Tension,
    TensionLaw,
    with_compression,
)
from .tables import tag_of
from .write import tables_of

if TYPE_CHECKING:
    from ..io.fabrics import FabricOfFile as FabricWithOrigin


def fabric_of_tables(
    tension: Tension,
    shear: Shear,
    bending: Bending,
    fibres: tuple[Any, Any] = (Fabric.warp, Fabric.weft),
) -> Fabric:
    """Fabric with the given laws; an error names the table."""
    with errors_in("tension "):
        warp = tension.build()
    with errors_in("tension weft "):
        weft = None if tension.weft is None else tension.weft.build()
    with errors_in("shear "):
        of_shear = shear.build()
    with errors_in("bending "):
        of_bending = bending.build()
    return Fabric(
        warp if weft is None else (warp, weft),
        of_shear,
        *fibres,
        of_bending,
        bending.twist_N_mm,
        np.radians(shear.wrinkling_angle_deg),
        None if shear.yarns is None else shear.yarns.construct(),
    )


def fabric_of(file: Any) -> tuple[Fabric, list[str]]:
    """Fabric of a case, and notes on it, see `fabric_of_file`."""
    if file.fabric.file is None:
        return fabric_of_tables(file.tension, file.shear, file.bending), []
    return fabric_of_file(file.fabric)


def with_plies(file: Any) -> Any:
    """Case whose scene has the plies of its tables ``[[plies]]``.

    Raises
    ------
    ValueError
        If the scene has no plies that are formed together, or its own, or there is one
        table.
    """
    if not file.plies:
        return file
    scene = file.scene
    if not issubclass(scene.declaration, Formed):
        raise ValueError(
            f"[[plies]] do not apply to the scene {tag_of(type(scene))}, which has one "
            "ply: use the scene forming"
        )
    if scene.layup is not None:
        raise ValueError(
            "scene.layup and [[plies]] both describe the plies: omit one of them"
        )
    if len(file.plies) < 2:
        raise ValueError(
            "[[plies]] describe one ply: add another table, or set scene.fibres_deg "
            "and the laws of the case instead"
        )
    plain = scene.ply_thickness_mm
    stated = [ply.thickness_mm for ply in file.plies]
    thickness = tuple(plain if x is None else x for x in stated)
    layup = tuple(ply.angle_deg for ply in file.plies)
    scene = structs.replace(scene, layup=layup, ply_thickness_mm=thickness)
    return structs.replace(file, scene=scene)


def fabrics_of_plies(file: Any, case: Fabric) -> tuple[Fabric | None, ...]:
    """Fabric of each ply of a case, with the directions of the fabric of the case.

    None for a ply without its own laws.
    """
    fabrics = (_fabric_of_ply(i, ply, file) for i, ply in enumerate(file.plies, 1))
    return tuple(x and replace(x, warp=case.warp, weft=case.weft) for x in fabrics)


def _fabric_of_ply(number: int, ply: PlyTable, file: Any) -> Fabric | None:
    """Fabric of a ply with its own laws; None without."""
    where, laws = f"ply_{number}", ("tension", "shear", "bending")
    stated = [name for name in laws if getattr(ply, name) is not None]
    for of in ("fabric.file", f"{where}.fabric"):
        named = file.fabric.file if of == "fabric.file" else ply.fabric
        if stated and named is not None:
            raise ValueError(
                f"{where}.{stated[0]} sets a law, but {of} contains all laws: omit one "
                "of them"
            )
    with errors_in(f"{where}: "):
        if ply.fabric is not None:
            return fabric_of_file(FabricOfFile(file=ply.fabric))[0]
        tables = (getattr(ply, name) or getattr(file, name) for name in laws)
        return fabric_of_tables(*tables) if stated else None


def fabric_of_file(table: FabricOfFile) -> tuple[Fabric, list[str]]:
    """Fabric of the file of a case, with the behaviour in compression of the case.

    Also notes: what the file assumes of its stiffnesses, because it was not measured,
    and the range of the data of its shear law.
    """
    found = _read(table)
    notes = []
    if found.origin is not None:
        assumed, ranges = found.origin.assumed, found.origin.ranges
        stiffnesses = "tension", "shear", "bending"
        notes = [assumed[name] for name in stiffnesses if name in assumed]
        if "shear" in ranges:
            angle = f"{np.degrees(ranges['shear']):.2g}°"
            notes.append(
                f"the shear law is fitted up to {angle} and extrapolated beyond"
            )
    return _compressed(found.fabric, table), notes


def _read(table: FabricOfFile) -> "FabricWithOrigin":
    from ..io import read_fabric

    assert table.file is not None
    return read_fabric(table.file, table.thickness_mm, table.units, table.material)


def _compressed(found: Fabric, table: FabricOfFile) -> Fabric:
    if table.compression is None and table.in_compression is None:
        return found
    if isinstance(found.tension, BiaxialLaw) and not isinstance(found.tension, TwoLaws):
        raise ValueError(
            "fabric.file contains a tension law of both strains, which also applies in "
            "compression: omit fabric.compression and fabric.in_compression"
        )
    laws = (family.tension for family in found.families)
    return replace(found, tension=tuple(_law_compressed(law, table) for law in laws))


def _law_compressed(law: Any, table: FabricOfFile) -> Any:
    """The law of a family of the file, with the behaviour in compression."""
    if isinstance(law, Pretensioned) or n_slips(law):
        return replace(law, law=_law_compressed(law.law, table))
    if isinstance(law, Asymmetric | TensionOnly):
        raise ValueError(
            f"fabric.file already contains a law in compression, of "
            f"{type(law).__name__}: omit fabric.compression and "
            "fabric.in_compression, or remove it from the file"
        )
    return with_compression(law, table.compression or "law", table.in_compression)


def sampled_fabrics(table: FabricOfFile) -> list[Fabric]:
    """Fabrics of the samples of a case; empty without.

    Raises
    ------
    ValueError
        See `FabricOfFile.samples` of `io`.
    """
    if table.samples is None:
        return []
    with errors_in("fabric.samples: "):
        found = _read(table).samples(
            table.samples, 1 if table.seed is None else table.seed
        )
    return [_compressed(one, table) for one in found]


def fabric_tables(fabric: Fabric, tables: Collection[str], file: str) -> dict[str, Any]:
    """Tables of a case file with the numbers of laws, or with the file of the fabric.

    Parameters
    ----------
    fabric
        The fabric.
    tables
        Names of the tables: ``tension``, ``shear`` or ``bending``.
    file
        File of the fabric, for laws that no table contains, such as tabulated ones.
    """
    tensions, found = fabric.tensions, {}
    if "tension" in tables:
        if not isinstance(tensions, TwoLaws):
            return {"fabric": {"file": file}}
        found["tension"] = _table(tensions.warp)
        if found["tension"] and tensions.weft != tensions.warp:
            found["tension"]["weft"] = _table(tensions.weft)
    if "shear" in tables:
        found["shear"] = _table(fabric.shear_law)
    if "bending" in tables:
        stiffnesses: list[Any] = [*fabric.bending, fabric.twist]
        keys = "warp_N_mm", "weft_N_mm", "twist_N_mm"
        found["bending"] = {}
        if all(isinstance(one, float) for one in stiffnesses):
            found["bending"] = dict(zip(keys, stiffnesses, strict=True))
    complete = all(one and one.get("weft", True) for one in found.values())
    return found if complete else {"fabric": {"file": file}}


def _table(law: Any) -> dict[str, Any]:
    """Table of a law with its numbers; empty if there is none for its class."""
    if np.ndim(getattr(law, "stiffness", 0.0)):
        return {}
    for table in {*get_args(TensionLaw), *get_args(ShearLaw)}:
        if table.keys and type(law) is table.implementation():
            return tables_of(table.of(law))
    return {}
