"""Construction of a case from its declaration, and tables of the laws of a fabric."""

import filecmp
import logging
import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct, structs

from ..declarations.scenes import (
    GRADED,
    Formed,
    Forming,
    OnTool,
    PlaneScene,
    Specimen,
    WithTools,
)
from ..fabric import Fabric
from ..fabric.directions import FibreDirections, directions_of, warn_of_directions
from ..fabric.regions import fabric_of_regions
from ..mesh.extents import warn_of_outline
from ..mesh.selection import SINGULAR
from ..mesh.user_input import coords, errors_in, printable
from ..outlines.drawings import kind_of_drawing
from ..ply.amount import AmountLike, proportional
from ..ply.formulations import DEFAULT
from ..ply.loads import BodyForce, Force
from ..ply.terms import Load
from ..scenes.scene import Case
from ..solve.on_surface import OnSurface
from .fabrics import fabric_of, fabric_of_tables, fabrics_of_plies, with_plies
from .phases import described_phase, furthest, in_phases
from .read import (
    CaseFile,
    CaseFileError,
    declared,
    default_laws,
    numbered,
    read_tables,
    with_files,
)
from .scenes import Scene as SceneTable
from .schema import (
    MESH_KINDS,
    Loads,
    Mesh,
)
from .schema import (
    Clamp as ClampTable,
)

if TYPE_CHECKING:
    from skfem import Mesh as SkfemMesh

    from ..outlines import Outline
    from ..outlines.fitting import Fitted
    from ..scenes import Scene

log = logging.getLogger(__name__)

# Name of the subdomain of elements outside all regions.
_OTHERS = "elements in no region"

# Share of its area by which elements may differ from an outline without a warning.
_CHORDS = 1e-3

# Keys that require another one of their table: one of those in the text.
_REQUIRED = {
    "fabric.thickness_mm": "fabric.file",
    "fabric.units": "fabric.file",
    "fabric.material": "fabric.file",
    "fabric.compression": "fabric.file: name the file, or use tension.compression",
    "fabric.in_compression": "fabric.file: name it, or use tension.in_compression",
    "fabric.samples": "fabric.file: name a fabric with the laws of its specimens",
    "fabric.seed": "fabric.samples",
    "mesh.unit": "mesh.outline",
    "mesh.layer": "mesh.outline",
    "stepping.most_unknowns": "stepping.tolerance",
    "output.part_reach_mm": "output.part_mesh or output.deck",
    "output.pattern": "output.part_mesh, output.deck or output.trim",
    "output.thickness_mm": "output.deck",
    "output.material": "output.deck",
    "output.calculix": "output.deck",
    "output.deck": "output.thickness_mm",
}

# Density of the mesh of a drawing before the conditions are known.
_COARSE = 0.25

# Sine of the angle below which two directions are equal. Chosen: above the six digits
# of a deck.
_SAME = 1e-5


def case_from_file(path: str | os.PathLike[str]) -> Case:
    """Build the case of a file.

    Parameters
    ----------
    path
        A case file, in TOML.

    Raises
    ------
    CaseFileError
        If the file does not describe a case; the message names the key.
    OSError
        If it cannot be read.
    """
    path = Path(path)
    tables = read_tables(path)
    with errors_in(f"{printable(path)}: ", CaseFileError):
        return case_from_tables(tables, path.parent)


def case_from_tables(
    tables: Mapping[str, Any], folder: str | os.PathLike[str] = "."
) -> Case:
    """Build a case from tables with the keys and values of a case file.

    Parameters
    ----------
    tables
        The tables of a case file, as dictionaries, lists, strings and numbers.
        Functions, which a file cannot contain, are refused: pass them to `Case`.
    folder
        Folder to which file names are relative.

    Raises
    ------
    CaseFileError
        If the tables do not describe a case.

    Examples
    --------
    >>> case = case_from_tables({"scene": {"name": "strip"}, "stepping": {"steps": 3}})
    >>> case.steps, case.scene.mesh.nelements
    (3, 150)
    >>> case_from_tables({"scene": {"name": "strip"}, "stepping": {"steps": max}})
    Traceback (most recent call last):
    skfem_textile.cases.read.CaseFileError: stepping.steps is a function, ...
    """
    with errors_in("", CaseFileError):
        return built(declared(tables, folder), default=default_laws(tables))


def _defaults(file: CaseFile, case: Case, default: Collection[str]) -> str:
    """Note on default laws, and on a wrinkling angle that a ply in space lacks."""
    stiffness = [
        f"{x} {getattr(file, x).law.stiffness_N_per_mm:g} N/mm" for x in default
    ]
    notes = []
    if stiffness:
        scene = f"the default of the scene {case.scene.name}"
        law = "linear, no locking" if "shear" in default else "linear"
        notes = [f"{scene} is used for {' and '.join(stiffness)}, {law}"]
    in_space = case.scene.dimension == 3
    if (in_space or notes) and np.min(case.fabric.wrinkling_angle) >= 0.5 * np.pi:
        notes.append("no wrinkling angle is given")
    return "; ".join(notes)


def built(file: CaseFile, density: float = 1.0, default: Collection[str] = ()) -> Case:
    """Build the case of a declaration.

    Parameters
    ----------
    file
        The declaration.
    density
        Factor of the number of lines of a graded mesh, or of elements along each side.
    default
        Names of laws that are defaults, for a note in the summary.

    Raises
    ------
    ValueError
        If the declaration does not describe a case.
    OSError
        If a file that it names cannot be read.
    """
    with_files(file, _refuse_missing)
    _refuse_contradictions(file)
    if file.vary:
        log.warning(
            "the table [vary] is for sweeps (`skfem-textile sweep`): this case has the "
            "values of its other tables"
        )
    file = with_plies(file)
    laws, assumed = fabric_of(file)
    scene = _with_tools(_scene(file, laws, density), file)
    if file.stepping.is_programme:
        scene = file.stepping.applied(scene)
    if file.mesh.outline is not None and scene.dimension == 3:
        _warn_of_unit(file.mesh.outline, scene)
    scene, fabrics = _with_fibres(scene, laws, file)
    loads = _all_loads(scene, file)
    fit = _fitted(scene, fabrics, loads, file.mesh.as_is)
    if isinstance(fabric := fit.fabric, Mapping):
        fabric = fabric_of_regions(fit.mesh, fabric)
    if scene.plies is not None:
        of_plies = fabrics_of_plies(file, fabric)
        scene = replace(scene, plies=replace(scene.plies, fabrics=of_plies))
    case = Case(
        scene=replace(scene, mesh=fit.mesh),
        fabric=fabric,
        loads=loads,
        formulation=file.formulation.construct() or fit.formulation,
        steps=_steps(file, scene),
        method=file.stepping.method,
        warn_only=file.stepping.warn_only,
        solver=file.stepping.solver,
        pictures=file.output.pictures,
        changes=fit.note,
        describe=described_phase(scene, file.output.describe),
    )
    notes = filter(None, (_defaults(file, case, default), *assumed))
    return replace(case, defaults="; ".join(notes))


def _with_fibres(
    scene: "Scene", laws: Fabric, file: CaseFile
) -> tuple["Scene", Fabric | dict[str, Fabric]]:
    """Scene and fabric with the fibre directions of the scene, a file or regions."""
    fabric: Any = replace(laws, warp=scene.warp, weft=scene.weft)
    if file.mesh.directions is not None:
        scene, fabric = _with_directions(file.mesh.directions, scene, fabric)
    if file.fabric.file is not None:
        _warn_of_other_directions(file, laws, scene, fabric)
    return _with_regions(scene, fabric, file) if file.regions else (scene, fabric)


def _all_loads(scene: "Scene", file: CaseFile) -> tuple[Any, ...]:
    """Loads and clamps of a case besides its scene."""
    of_phases = scene.process and scene.process.loads
    factor: AmountLike = of_phases or scene.programme or proportional
    loads = _loads(file.loads, factor, of_phases or 1.0)
    if scene.rotation:
        loads = tuple(load.turned(scene.turn) for load in loads)
    return *loads, *_clamps(scene, file.clamps)


def _steps(file: CaseFile, scene: "Scene") -> int | tuple[int, ...]:
    """Number of load steps, or numbers for each phase."""
    if scene.process:
        return scene.process.steps
    assert file.stepping.steps is not None  # it is refused beside phases only
    return file.stepping.steps * file.stepping.parts


def _fitted(
    scene: "Scene", fabrics: Any, loads: tuple[Load, ...], as_is: bool
) -> "Fitted":
    """Mesh and fabric of a scene along its singular fibres, and its formulation."""
    from ..outlines.fitting import Fitted, fitted

    mesh = scene.mesh
    if scene.dimension == 3 or (as_is and SINGULAR not in (mesh.boundaries or {})):
        return Fitted(mesh, fabrics, DEFAULT, "")
    fit = fitted(mesh, fabrics, scene.conditions, (*scene.loads, *loads))
    differs = fit.mesh is not mesh or fit.formulation is DEFAULT
    return fit if differs else fit._replace(note="")


def _refuse_missing(key: str, name: str) -> str:
    """Refuse the name of a file that does not exist."""
    if key != "mesh.source" and not os.path.isfile(name):  # it may be a kind of mesh
        law = key.endswith(".file") and key != "fabric.file"
        key = f"{key.removesuffix('.file')}.law" if law else key
        raise ValueError(f"{key} {printable(name)}: no such file")
    return name


def _refuse_contradictions(file: CaseFile) -> None:
    """Refuse keys that contradict each other."""
    tables = "fabric", "mesh", "stepping", "output"
    refuse_incomplete({name: getattr(file, name) for name in tables})
    of_ply = {
        "fabric.file": file.fabric.file,
        "mesh.directions": file.mesh.directions,
    }
    for key, named in of_ply.items():
        if named is not None and file.regions:
            raise ValueError(
                f"{key} applies to the whole ply, but regions are given: omit one of "
                "them"
            )
    if file.fabric.samples is not None and file.stepping.tolerance is not None:
        raise ValueError(
            "fabric.samples requires one mesh, but stepping.tolerance makes others: "
            "omit one of them"
        )
    for key in ("part_mesh", "deck", "trim", "pattern"):
        in_space = issubclass(file.scene.declaration, WithTools)
        if getattr(file.output, key) and not in_space:
            raise ValueError(f"output.{key} requires a scene with tools")
        if getattr(file.output, key) and (file.plies or _has_layup(file)):
            raise ValueError(
                f"output.{key} describes one ply, but the case has several: omit it"
            )


def _has_layup(file: CaseFile) -> bool:
    return getattr(file.scene, "layup", None) is not None


def refuse_incomplete(
    tables: Mapping[str, Struct], known: Collection[str] = ()
) -> None:
    """Refuse keys that require another one of their table.

    Parameters
    ----------
    tables
        Tables by name.
    known
        Keys that count as given.
    """

    def is_given(key: str) -> bool:
        table, name = key.split(".")
        plain = type(tables[table])()
        return key in known or getattr(tables[table], name) != getattr(plain, name)

    for key, required in _REQUIRED.items():
        table = key.partition(".")[0]
        others = re.findall(rf"\b{table}\.\w+", required)
        if table in tables and is_given(key) and not any(map(is_given, others)):
            raise ValueError(f"{key} requires {required}")


def _loads(
    of: Loads, factor: AmountLike = proportional, of_weight: AmountLike = 1.0
) -> tuple[Any, ...]:
    """Forces on boundaries and the weight, with their factors."""
    forces = tuple(Force(name, total, factor) for name, total in of.force_N.items())
    if (weight := of.weight_N_per_mm2) is None:
        return forces
    return *forces, BodyForce(weight, factor=of_weight, name="weight")


def _clamps(scene: "Scene", tables: Sequence[ClampTable]) -> tuple[Any, ...]:
    """Clamps of the case, in the axes of the ply."""
    clamps: list[Any] = []
    for number, table in enumerate(tables, 1):
        given = table.values()
        given["name"] = name = given["name"] or numbered("clamps", number)
        if name in [clamp.name for clamp in clamps]:
            raise ValueError(
                f"two clamps have the name {printable(name)!r}: rename one of them"
            )
        if given["within"] is not None:
            given["within"] = given["within"] - np.tile(scene.axes.origin[:2], 2)
        clamps.append(table.construct(**given))
    if scene.rotation:
        clamps = [clamp.turned(scene.turn) for clamp in clamps]
    return tuple(clamps)


def _scene(file: CaseFile, laws: Fabric, density: float) -> "Scene":
    """The scene on its mesh, rotated.

    For a run to a tolerance a mesh along the singular fibres replaces a file's mesh.
    """
    scene, options = file.scene, file.mesh
    _refuse_other_mesh_keys(scene, options)
    if options.source == GRADED:
        built = _graded(file, laws, density)
    elif options.outline is not None:
        built = _outlined(file, density)
    elif options.source in MESH_KINDS:
        size = options.size and tuple(round(density * n) for n in options.size)
        of_grid = {"size": size, "jitter": options.jitter, "seed": options.seed}
        stated = {key: value for key, value in of_grid.items() if value is not None}
        built = scene.build(options.source, **stated)
    else:
        mesh = _read(options.source, options.directions, file.fabric.file)
        built = scene.build(mesh)
        if file.stepping.tolerance is not None:
            _refuse_fields(file, built)
            built = built.graded(laws, density, _loads(file.loads))
    return built.rotated(np.radians(getattr(scene, "rotate_deg", 0.0)))


def _with_tools(scene: "Scene", file: CaseFile) -> "Scene":
    """Scene with the tools of the case."""
    of: Any = file.scene
    tables = file.tools
    names = [tool.name for tool in scene.tools]
    names += [tool.name or numbered("tools", i) for i, tool in enumerate(tables, 1)]
    file = structs.replace(file, phases=tuple(x.of_each(names) for x in file.phases))
    if tables and (scene.dimension == 2 or issubclass(of.declaration, OnTool)):
        where = "is in its plane" if scene.dimension == 2 else "lies on a surface"
        raise ValueError(
            f"[[tools]] do not apply to the scene {scene.name}, whose ply {where}: use "
            "the scene forming"
        )
    changed: dict[str, set[str]] = {}
    for phase in file.phases:
        for name, changes in phase.tools.items():
            changed.setdefault(name, set()).update(changes.stated())
    if tables and not scene.tools and of.declaration is Forming:
        of.refuse_keys_of_tools(furthest(file.phases, "punch"))
    tools = []
    for number, tool in enumerate(tables, 1):
        name = tool.name or numbered("tools", number)
        tools.append(tool.build(name, scene.axes, changed.get(name, ())))
    all_tools = *scene.tools, *tools
    if not (scene.driven or all_tools):
        raise ValueError(
            "scene.punch is missing: name STL files of punch and die, or describe "
            "tools in [[tools]]"
        )
    for name in names:
        if name == "*":
            raise ValueError("a tool has the name '*', which selects all: rename it")
        if names.count(name) > 1:
            raise ValueError(
                f"two tools have the name {printable(name)!r}: rename one of them"
            )
    if tools and not issubclass(of.declaration, Formed):
        scene = replace(scene, misfit=scene.misfit or "tools act on the ply")
    if file.phases:
        return in_phases(scene, file, tools)
    if not tables:
        return scene
    from ..scenes.processes import with_tools

    return with_tools(scene, all_tools)


def _refuse_other_mesh_keys(scene: SceneTable, options: Mesh) -> None:
    """Refuse keys of the mesh that do not apply to its kind."""
    source, plane = printable(options.source), issubclass(scene.declaration, PlaneScene)
    if options.outline is not None:
        _refuse_keys_beside_outline(scene, options)
    if options.source == GRADED:
        what, suitable = "a graded mesh", {"outline", "density", "unit", "layer"}
        if not plane:
            raise ValueError("mesh.source graded applies to scenes in the plane only")
    elif options.outline is not None:
        what, suitable = "an outline in space", {"outline", "unit", "layer", "size"}
    elif options.source in MESH_KINDS:
        what = f"the mesh {source}"
        suitable = {"size", "jitter", "seed", "directions", "as_is"}
    elif not Path(options.source).is_file():
        raise ValueError(
            f"mesh.source {source} is neither an existing file nor one of "
            f"{', '.join(MESH_KINDS)}"
        )
    elif kind_of_drawing(options.source) is not None:
        raise ValueError(f"mesh.source {source} is a drawing: name it in mesh.outline")
    else:
        what, suitable = f"the mesh {source}", {"directions", "as_is"}
    if options.as_is and not issubclass(scene.declaration, PlaneScene):
        raise ValueError(
            "mesh.as_is applies to scenes in the plane only: in space no mesh is fitted"
        )
    for key in options.__struct_fields__:
        given = getattr(options, key) not in (None, False)
        if key not in {"source", *suitable} and given:
            raise ValueError(
                f"mesh.{key} does not apply to {what}: omit it, or set another "
                "mesh.source"
            )


def _refuse_keys_beside_outline(scene: SceneTable, options: Mesh) -> None:
    """Refuse keys of a scene and its mesh that contradict an outline."""
    in_space = issubclass(scene.declaration, WithTools)
    if not (in_space or scene.declaration is Specimen):
        raise ValueError(
            "mesh.outline applies to the scene specimen and to scenes with tools only"
        )
    if options.source != scene.declaration.kind:
        raise ValueError(
            f"mesh.outline does not apply to the mesh {printable(options.source)}: "
            "omit one of them"
        )
    if getattr(scene, "part", None) == "quarter":
        raise ValueError(
            "scene.part quarter does not apply to mesh.outline: use the whole ply"
        )
    for side in ("width", "height"):
        if scene.values()[side] != getattr(scene.declaration, side):
            raise ValueError(
                f"scene.{side}_mm does not apply to the outline of a drawing: omit one "
                "of them"
            )


def _refuse_fields(file: CaseFile, scene: "Scene") -> None:
    """Refuse a tolerance where no graded mesh can replace the mesh of a file."""
    reasons = {
        "regions": bool(file.regions),
        "mesh.directions": file.mesh.directions is not None,
        f"the scene {scene.name}, which is in space": scene.dimension == 3,
    }
    for reason in (name for name, applies in reasons.items() if applies):
        raise ValueError(
            "stepping.tolerance replaces the mesh of a file by graded ones, which is "
            f"not possible with {reason}: omit stepping.tolerance and compare with a "
            "finer mesh"
        )


def _graded(file: CaseFile, laws: Fabric, factor: float) -> "Scene":
    """The scene on a mesh along the singular fibres."""
    from ..outlines import mesh_outline

    outline = None
    if file.mesh.outline is None:
        scene = file.scene.build("irregular", size=(1, 1))
    else:
        outline = _outline(file.mesh)
        scene = file.scene.build(mesh_outline(outline, Fabric(), density=_COARSE))
    density = file.mesh.density
    assert density is not None  # by default 1
    return scene.graded(laws, factor * density, _loads(file.loads), outline)


def _outline(options: Mesh) -> "Outline":
    """The outline of a file."""
    from ..outlines import Outline

    assert options.outline is not None
    return Outline.from_file(options.outline, unit=options.unit, layer=options.layer)


def _outlined(file: CaseFile, density: float) -> "Scene":
    """A scene in space whose ply has an outline, its middle at the centre."""
    import shapely

    from ..outlines.meshing import quadrilaterals

    options = file.mesh
    outline = _outline(options)
    low, high = outline.polygon.min(axis=1), outline.polygon.max(axis=1)
    assert options.size is not None  # by default of the scene
    across, along = (round(density * n) for n in options.size)
    middle = 0.5 * (low + high)
    mesh = quadrilaterals(outline, (across, along))
    elements = shapely.coverage_union_all(shapely.polygons(mesh.p[:, mesh.t].T))
    share = (elements ^ outline.shape()).area / outline.shape().area
    chords = (
        f"; elements and outline differ by {100 * share:.1f} % of its area: use more "
        "elements if this is too much"
    ) * (share > _CHORDS)
    if middle.any() or chords:
        text = "%s: the middle of the outline, %s mm, is the centre of the ply%s"
        log.warning(text, printable(options.outline), coords(middle), chords)
    return file.scene.build(mesh.translated(-middle), part="whole")


def _warn_of_unit(outline: str, scene: "Scene") -> None:
    """Warn if the extents of a ply and of its tools indicate two units of length."""
    on_surfaces = (x for x in scene.conditions.values() if isinstance(x, OnSurface))
    surfaces: list[Any] = [one.surface for one in (*scene.tools, *on_surfaces)]
    tools = [one.facets.points for one in surfaces if hasattr(one, "facets")]
    warn_of_outline(outline, scene.mesh.p, tools)


def _read(source: str, directions: str | None, fabric: str | None) -> "SkfemMesh":
    """The mesh of a file, which may also contain directions and the fabric."""
    from ..io import OF_DIRECTIONS, OF_FABRICS, read_mesh

    others = OF_DIRECTIONS * _is_copy(directions, source)
    return read_mesh(source, (*others, *OF_FABRICS * _is_copy(fabric, source)))


def _is_copy(named: str | None, file: str) -> bool:
    """True if two files are identical, as in written cases."""
    try:
        return named is not None and filecmp.cmp(named, file, shallow=False)
    except (OSError, ValueError):  # reported when the file is read
        return False


def _with_directions(
    file: str, scene: "Scene", fabric: Fabric
) -> tuple["Scene", Fabric]:
    """Scene and fabric with the fibre directions of a file."""
    from ..io import read_directions

    if any(isinstance(one, OnSurface) for one in scene.conditions.values()):
        raise ValueError(
            f"mesh.directions is not supported for the scene {scene.name}: set "
            "scene.fibres_deg"
        )
    field = read_directions(file)
    turned = FibreDirections(scene.turn @ field.warp, scene.turn @ field.weft)
    with errors_in(f"mesh.directions {printable(file)}: "):
        warn_of_directions(scene.mesh, turned)
    misfit = scene.misfit or f"fibre directions are read from {printable(file)}"
    return replace(scene, misfit=misfit), turned.on(fabric)


def _warn_of_other_directions(
    file: CaseFile, laws: Fabric, scene: "Scene", used: Fabric
) -> None:
    """Warn if the file of the fabric states directions that the run does not use.

    A file that states none has the default directions, too.
    """
    fabric, other = str(file.fabric.file), file.mesh.directions
    is_deck = Path(fabric).suffix.lower() != ".json"
    stated: Any = laws.warp, laws.weft
    default: Any = Fabric.warp, Fabric.weft
    if np.array_equal(stated, default):
        return
    if not _has_other_directions(laws, scene, used):
        return
    how = (
        "name this file in mesh.directions too"
        if is_deck
        else "write them with write_directions and name this file in mesh.directions"
    )
    log.warning(
        "%s: the fibre directions in this file are ignored; the directions from %s "
        "are used: to use them, %s",
        printable(fabric),
        "the scene" if other is None else printable(other),
        how,
    )


def _has_other_directions(laws: Fabric, scene: "Scene", used: Fabric) -> bool:
    try:
        first, second = (directions_of(scene.mesh, one) for one in (laws, used))
    except ValueError:  # another number of elements
        return True
    for A, B in (first.warp, second.warp), (first.weft, second.weft):
        x, y = scene.turn @ A
        if np.abs(x * B[1] - y * B[0]).max() > _SAME:
            return True
    return False


def _with_regions(
    scene: "Scene", fabric: Fabric, file: CaseFile
) -> tuple["Scene", dict[str, Fabric]]:
    """Scene whose elements outside all regions are one more, and a fabric for each."""
    mesh, fabrics = scene.mesh, {}
    for name, region in file.regions.items():
        angles = (scene.warp, region.warp_deg), (scene.weft, region.weft_deg)
        fibres = [
            plain if degrees is None else scene.turn @ _direction(degrees)
            for plain, degrees in angles
        ]
        with errors_in(f"region {name!r}: "):
            fabrics[name] = fabric_of_tables(
                region.tension or file.tension,
                region.shear or file.shear,
                region.bending or file.bending,
                (fibres[0], fibres[1]),
            )
    subdomains = mesh.subdomains or {}
    named = [cells for name, cells in subdomains.items() if name in fabrics]
    elsewhere = np.setdiff1d(np.arange(mesh.nelements), np.concatenate([[], *named]))
    if elsewhere.size and len(named) == len(fabrics):
        mesh = mesh.with_subdomains({_OTHERS: elsewhere})
        fabrics[_OTHERS] = fabric
    misfit = "the fabric differs between regions"
    return replace(scene, mesh=mesh, misfit=misfit), fabrics


def _direction(degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.array([np.cos(angle), np.sin(angle)])
