"""The case that values describe."""

import filecmp
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from skfem import Mesh

from ...fabric import Fabric, Law
from ...fabric.laws.one_sided import Asymmetric, with_compression
from ...fabric.laws.pretensioned import with_pretension
from ...fabric.regions import fabric_of_regions
from ...mesh.user_input import printable
from ...ply.formulations import FORMULATIONS
from ...ply.loads import Force
from ...registration import Registration, Resistance, SceneRegistration
from ...scenes import SCENES, Scene
from ...scenes.case import Case
from ...scenes.rectangle import KINDS
from ..fibres import from_files
from .laws import (
    BENDING,
    IN_COMPRESSION,
    OF_WEFT,
    PREFIXES,
    WRINKLING_ANGLE,
    law_name,
    law_table,
    laws_of,
    own_options,
)
from .mesh_options import SEED, is_mesh_file

if TYPE_CHECKING:
    from ...drape import TriangleMesh

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
    scene, values = _scene_of(values)
    chosen = _chosen("formulation", values["formulation"], FORMULATIONS, values)
    fabric = _fabric(scene, values, (scene.warp, scene.weft))
    if values["fabric"] is not None:
        _refuse_parts(values)
    options = [option for of in PREFIXES for option in law_table(of).options]
    defaults = SCENES[values["scene"]].defaults
    laws = {o: defaults.get(o.name, o.default) for o in (*options, *BENDING.options)}
    scene, fabric = from_files(values, scene, fabric, laws)
    if values["regions"]:
        fabric = _with_regions(scene, fabric, values)
        scene = replace(scene, misfit="the fabric differs from region to region")
    return Case(
        scene=scene,
        fabric=fabric,
        loads=tuple(_force(scene, *one) for one in values["force"]),
        formulation=chosen(),
        steps=values["steps"],
        method=values["method"],
        warn_only=values["warn_only"],
        solver=values["solver"],
        pictures=values["pictures"],
    ), values


def _scene_of(values: Mapping[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """The scene on its mesh, and the values, completed for a generated mesh."""
    registration, mesh = SCENES[values["scene"]], values["mesh"]
    if is_mesh_file(mesh) and not Path(mesh).is_file():
        raise ValueError(
            f"--mesh {printable(mesh)}: neither a file nor {', '.join(KINDS)}"
        )
    values = completed(values, registration)
    if is_mesh_file(mesh):
        mesh = _read(mesh, values)
    own = {option.key: values[option.key] for option in registration.options}
    if "tool" in own:
        own["tool"] = _tool(own["tool"])
    made = {name: values[name] for name in ("size", "jitter", "seed")}
    scene = registration.build(mesh=mesh, **made, **own)
    return scene.rotated(np.radians(values.get("rotate", 0.0))), values


def _read(file: str, values: Mapping[str, Any]) -> Mesh:
    """The mesh of a file, of which directions and the fabric may be read too."""
    from ...io import OF_DIRECTIONS, OF_FABRICS, read_mesh

    given = {"directions": OF_DIRECTIONS, "fabric": OF_FABRICS}
    same = [option for option in given if _is_copy(values[option], file)]
    others = [name for option in same for name in given[option]]
    return read_mesh(file, others)


def _tool(file: str | None) -> "TriangleMesh":
    """The surface of the file of a tool."""
    if file is None:
        raise ValueError("--tool is not given: name an STL file of triangles")
    from ...io import read_surface

    return read_surface(file)


def _is_copy(named: str | None, file: str) -> bool:
    """Whether a file is another or a copy of it, as a written case has them."""
    try:
        return named is not None and filecmp.cmp(named, file, shallow=False)
    except (OSError, ValueError):  # its reader tells
        return False


def completed(values: Mapping[str, Any], scene: SceneRegistration) -> dict[str, Any]:
    """Fill in defaults of a generated mesh; refuse its options beside a mesh file."""
    made = {"size": scene.size, "jitter": scene.jitter, "seed": SEED}
    if not is_mesh_file(values["mesh"]):
        given = {name: values[name] for name in made if values[name] is not None}
        return {**values, **made, **given}
    for name in made:
        if values[name] is not None:
            raise ValueError(
                f"--{name} is of a mesh to make, but --mesh names a file: leave one of "
                "them out"
            )
    return dict(values)


def _fabric(scene: Scene, values: Mapping[str, Any], fibres: Any) -> Fabric:
    warp, weft = fibres
    of_warp, of_weft, twist = (values[option.key] for option in BENDING.options)
    laws = _tension(values), _law("shear", values)
    wrinkling = values[WRINKLING_ANGLE]
    if not 0 < wrinkling <= 90:
        raise ValueError(
            "--shear-wrinkling-angle must be above 0 and at most 90 degrees, not "
            f"{wrinkling:g}"
        )
    bending = of_warp, of_weft
    return Fabric(*laws, warp, weft, bending, twist, np.radians(wrinkling))


def _force(scene: Scene, name: str, total: tuple[float, ...]) -> Force:
    """A force in the axes of the problem that is not turned."""
    return Force(name, scene.turn @ total if len(total) == 2 else total)


def _refuse_parts(values: Mapping[str, Any]) -> None:
    for part in law_table("tension").parts:
        if values[part.entry] is not None:
            raise ValueError(
                f"tension.{part.name} is a law, but --fabric names a file that has "
                "all: leave one of them out"
            )


def _tension(values: Mapping[str, Any]) -> Any:
    """The law of the fibres, or one of the warp and one of the weft."""
    law = _of_fibres(values)
    if values[OF_WEFT] is None:
        return law
    return law, _of_part("weft", OF_WEFT, _of_fibres, values)


def _of_fibres(values: Mapping[str, Any]) -> Law:
    """The law of fibres, with what they do in compression and their pretension."""
    law, word = _law("tension", values), values["fibre_compression"]
    other = None
    if values[IN_COMPRESSION] is not None:
        if word != "law":
            raise ValueError(
                f"--fibre-compression is {word}, but in_compression is a law: leave "
                "one of them out"
            )
        plain = partial(_law, "tension")
        other = _of_part("in_compression", IN_COMPRESSION, plain, values)
    try:
        both = with_compression(law, word) if other is None else Asymmetric(law, other)
        return with_pretension(both, values["fibre_pretension"])
    except ValueError as error:
        raise ValueError(f"tension {error}") from None


def _of_part(
    part: str,
    entry: str,
    make: Callable[[Mapping[str, Any]], Law],
    values: Mapping[str, Any],
) -> Law:
    """The law that a table within that of the tension says."""
    try:
        return make({**values, **values[entry]})
    except ValueError as error:
        raise ValueError(f"{part}: {error}") from None


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
    if elsewhere.size and len(named) == len(fabrics):
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
            return build()
        except ValueError as error:
            raise ValueError(f"{of} {error}") from None
    try:
        return build(path=word, of=of)
    except (ValueError, OSError) as error:
        raise ValueError(f"--{of}-law {printable(error)}") from None


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
