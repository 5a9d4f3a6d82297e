"""The case that values describe."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...fabric import Fabric, Law
from ...fabric.laws.one_sided import with_compression
from ...fabric.regions import fabric_of_regions
from ...mesh.user_input import printable
from ...ply.formulations import FORMULATIONS
from ...ply.loads import Force
from ...registration import Registration, Resistance
from ...scenes import SCENES, Scene
from ...scenes.case import Case
from ..fibres.from_files import from_files
from .laws import PREFIXES, law_name, law_table, laws_of, own_options
from .mesh import scene_of

# Name of the subdomain of elements that are in no region.
_OTHERS = "elements in no region"


def case_of(values: Mapping[str, Any]) -> tuple[Case, dict[str, Any]]:
    """The case that values describe, by the keys of their options.

    Parameters
    ----------
    values
        A value for each option of `tables_of`, the name of the ``scene``, and the
        ``regions``: by the name of a subdomain what is other there, the values of
        laws and the inclinations ``warp`` and ``weft`` in degrees, where they are not
        None.

    Returns
    -------
    tuple
        The case, and the values with those filled in that depend on others.

    Raises
    ------
    ValueError
        If they describe none.
    """
    scene, values = scene_of(values)
    chosen = _chosen("formulation", values["formulation"], FORMULATIONS, values)
    fabric = _fabric(scene, values, (scene.warp, scene.weft))
    laws = [option for of in PREFIXES for option in law_table(of).options]
    scene, fabric = from_files(values, scene, fabric, laws)
    if values["regions"]:
        fabric = _with_regions(scene, fabric, values)
        scene = replace(scene, misfit="the fabric differs from region to region")
    return Case(
        scene=scene,
        fabric=fabric,
        loads=tuple(Force(name, scene.turn @ total) for name, total in values["force"]),
        formulation=chosen(),
        steps=values["steps"],
        strategies=values["strategy"],
        warn_only=values["warn_only"],
        solver=values["solver"],
        pictures=values["pictures"],
    ), values


def _fabric(scene: Scene, values: Mapping[str, Any], fibres: Any) -> Fabric:
    return Fabric(_law("tension", values), _law("shear", values), *fibres)


def _with_regions(scene: Scene, fabric: Fabric, values: Mapping[str, Any]) -> Fabric:
    """The fabrics of the regions, and this one elsewhere."""
    mesh, fabrics = scene.mesh, {}
    for name, other in values["regions"].items():
        fibres = [
            plain if degrees is None else scene.turn @ _direction(degrees)
            for plain, degrees in zip(
                (scene.warp, scene.weft), (other["warp"], other["weft"]), strict=True
            )
        ]
        try:
            fabrics[name] = _fabric(scene, {**values, **other}, fibres)
        except ValueError as error:
            raise ValueError(f"region {name!r}: {error}") from None
    named = [
        cells for name, cells in (mesh.subdomains or {}).items() if name in fabrics
    ]
    elsewhere = np.setdiff1d(np.arange(mesh.nelements), np.concatenate([[], *named]))
    if elsewhere.size:
        mesh = mesh.with_subdomains({_OTHERS: elsewhere})
        fabrics[_OTHERS] = fabric
    return fabric_of_regions(mesh, fabrics)


def _direction(degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.array([np.cos(angle), np.sin(angle)])


def _law(of: Resistance, values: Mapping[str, Any]) -> Law:
    """The law of tension or shear that is chosen."""
    word, laws, prefix = values[f"{of}_law"], laws_of(of), PREFIXES[of]
    name = law_name(of, word) or word
    build = _chosen(f"{of}-law", name, laws, values, prefix)
    for option in laws[name].options:
        if build.keywords[option.key] is None:
            raise ValueError(f"--{of}-law {name} needs --{prefix}{option.name}")
    if not laws[name].suffix:
        try:
            return _in_compression(of, build(), values)
        except ValueError as error:
            raise ValueError(f"{of} {error}") from None
    try:
        return _in_compression(of, build(path=word, of=of), values)
    except (ValueError, OSError) as error:
        raise ValueError(f"--{of}-law {printable(error)}") from None


def _in_compression(of: Resistance, law: Law, values: Mapping[str, Any]) -> Law:
    return (
        with_compression(law, values["fibre_compression"]) if of == "tension" else law
    )


def _chosen(
    option: str,
    name: str,
    among: Mapping[str, Registration],
    values: Mapping[str, Any],
    prefix: str = "",
) -> partial[Any]:
    """What builds the one that an option names; refuses the options of others."""
    chosen, defaults = among[name], SCENES[values["scene"]].defaults
    given: dict[str, Any] = {}
    for own in own_options(among):
        full = replace(own, name=prefix + own.name)
        if own in chosen.options:
            given[own.key] = values[full.key]
        elif values[full.key] != defaults.get(full.name, own.default):
            names = [one.name for one in among.values() if own in one.options]
            raise ValueError(f"--{full.name} goes with --{option} {' or '.join(names)}")
    return partial(chosen.build, **given)
