"""Problems of the stability study, with their laws and scenes."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad

from skfem_textile.fabric import (
    Asymmetric,
    BiaxialLaw,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    Law,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from skfem_textile.mesh.checks import with_edges
from skfem_textile.mesh.splitting import split
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Macro, OnePoint, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension, picture_frame, strip, trellis
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.strip import HEIGHT, WIDTH
from skfem_textile.scenes.trellis import sheared
from skfem_textile.solve.conditions import Condition

# Decrimping strain, and pretension relative to E.
_TOE, _PRETENSION = 0.004, 1e-3

# Points of the tension table: strains, and tensions over the final stiffness.
_STRAINS = -0.1, -0.05, 0.0, 0.002, 0.005, 0.01, 0.03
_TENSIONS = -1e-4, -5e-5, 0.0, 1e-4, 1e-3, 5e-3, 2.5e-2

# Points of the shear table: degrees, and moments in N/mm, a hundredfold from 30 to 55.
_DEGREES = 0, 10, 20, 30, 40, 50, 55, 65
_MOMENTS = 0.0, 0.02, 0.04, 0.1, 0.6, 4.0, 10.0, 30.0


def _crimp_toe(initial_stiffness: float) -> Callable[[float], Law]:
    return lambda E: CrimpToe(E, _TOE, initial_stiffness)


#: Tension laws by name, as functions of the stiffness E in N/mm.
TENSIONS: Mapping[str, Callable[[float], Law | BiaxialLaw]] = {
    "crimp toe, k = 1": _crimp_toe(1.0),
    "crimp toe, k = 10": _crimp_toe(10.0),
    "crimp toe, k = 1000": _crimp_toe(1000.0),
    "tension only": lambda E: TensionOnly(Linear(E)),
    "asymmetric": lambda E: Asymmetric(Linear(E), Linear(1e-3 * E)),
    "pretensioned": lambda E: Pretensioned(TensionOnly(Linear(E)), _PRETENSION * E),
    "interchange": lambda E: CrimpInterchange(E, (0.01, 0.003), 1e-4 * E, 1e-3, 1.0),
    "table": lambda E: Tabulated(_STRAINS, E * np.array(_TENSIONS)),
    "polynomial": lambda E: Polynomial((0.01 * E, 0.0, 3e3 * E)),
}

#: Shear laws by name.
SHEARS: Mapping[str, Law] = {
    "locking": Locking(0.5, np.radians(65)),
    "shear table": Tabulated(np.radians(_DEGREES), _MOMENTS, odd=True),
    "sin²": Sin2(0.5),
    "shear polynomial": Polynomial((0.2, -0.4, 0.9), odd=True),
}

#: Default number of elements along the sides of a square.
SIZE = (8, 8)


def on_split_mesh(make: Callable[..., Scene], **options: Any) -> Scene:
    """A scene on its own mesh after splitting."""
    return make(**options | {"mesh": split(make(**options).mesh)})


def net_of(
    warp: float = 0,
    crossing: float = 90,
    shear: float = 0,
    bend: float = 0,
    size: tuple[int, int] = SIZE,
    mesh: str | Mesh = "irregular",
) -> Scene:
    """A trellis, with angles in degrees."""
    warp, weft = np.radians([warp, warp + crossing])
    turns = sheared(*np.radians([shear, bend]))
    return trellis(mesh, size, warp=warp, weft=weft, turns=turns)


def transformed_strip(scale: float, shift: float, **options: Any) -> Scene:
    """The strip, scaled and translated along x and y."""
    scene = on_split_mesh(strip, **options) if options else strip()

    def untransformed(X: ndarray) -> ndarray:
        return (X - shift) / scale

    def moved(condition: Condition) -> Condition:
        def value(X: ndarray, t: float) -> ndarray:
            values = scale * condition.values("", untransformed(X), t)
            return values if condition.direction is None else values[0]

        return Condition(condition.where, value, condition.direction)

    return replace(
        scene,
        mesh=scene.mesh.scaled(scale).translated((shift, shift)),
        conditions={
            name: moved(c)
            for name, c in scene.conditions.items()
            if isinstance(c, Condition)
        },
        displacement=lambda X, t: scale * scene.displacement(untransformed(X), t),
        shear_angle=lambda X, t: scene.shear_angle(untransformed(X), t),
    )


def strip_with_flat_angles(mesh: Mesh | None = None) -> Scene:
    """The strip on elements with angles of 179°, or on parts of such elements."""
    return strip(mesh or _with_flat_angles(WIDTH, HEIGHT, (10, 16)))


def frame_with_flat_angles() -> Scene:
    """The picture frame on elements with angles of 179°."""
    return picture_frame(_with_flat_angles(100.0, 100.0, SIZE))


def _with_flat_angles(width: float, height: float, size: tuple[int, int]) -> MeshQuad:
    """Move every other node so that one angle of an element becomes 179°.

    In an element with sides a, b the corner (a, b) moves to c·(a, b), where the edges
    to (a, 0) and (0, b) form this angle.
    """
    mesh = rectangle(width, height, size, "aligned")
    a, b = width / size[0], height / size[1]
    node = np.arange(mesh.p.shape[1]).reshape(size[1] + 1, size[0] + 1)
    moved = node[1:-1:2, 1:-1:2].ravel()
    points = mesh.p.copy()
    points[:, moved] -= (1 - _diagonal_share(a, b)) * np.array([[a], [b]])
    return with_edges(MeshQuad(points, mesh.t))


def _diagonal_share(a: float, b: float) -> float:
    """Fraction c of the diagonal that gives an angle of 179°, by bisection."""
    low, high = 0.5, 1.0
    for _ in range(60):
        c = 0.5 * (low + high)
        p, q = np.array([a - c * a, -c * b]), np.array([-c * a, b - c * b])
        cosine = p @ q / (np.linalg.norm(p) * np.linalg.norm(q))
        low, high = (low, c) if np.degrees(np.arccos(cosine)) < 179 else (c, high)
    return c


# Names of the formulations in reports.
_ELEMENTS = {
    "full": "2×2",
    "one-point": "one point",
    "macro": "macro",
    "quadratic": "quadratic",
}

# Formulations and fibre stiffnesses in N/mm of the family of laws.
_OF_LAWS: tuple[Formulation, ...] = Macro(), OnePoint(), Quadratic(80.0)
_STIFFNESSES = 1e3, 1e5, 1e8


@dataclass(frozen=True)
class Extreme:
    """A problem of the study.

    Attributes
    ----------
    family, label
        The varied quantity, and its value in this problem.
    scene
        Function that creates the scene.
    formulation
        Formulation.
    E, G
        Fibre and shear stiffness in N/mm.  Round-off is proportional to E.
    exact
        True if the mesh can represent the exact solution.
    seed
        Seed of the mesh, if problems differ only in the seed.
    tension, shear
        Laws that replace E and G.  The slope of the tension law at 1 % is about E.
    """

    family: str
    label: str
    scene: Callable[[], Scene]
    formulation: Formulation
    E: float = 1e4
    G: float = 0.0
    exact: bool = False
    seed: int | None = None
    tension: Law | BiaxialLaw | None = None
    shear: Law | None = None

    @property
    def kind(self) -> str:
        """Value and formulation."""
        return f"{self.label}, {_ELEMENTS[self.formulation.name]}"

    @property
    def name(self) -> str:
        """Value, formulation and seed."""
        return self.kind + ("" if self.seed is None else f", seed {self.seed}")

    def __str__(self) -> str:
        return f"{self.family}, {self.name}"

    def ply(self, scene: Scene) -> Ply:
        """The ply of the scene."""
        tension = self.E if self.tension is None else self.tension
        shear = self.G if self.shear is None else self.shear
        fabric = Fabric(tension, shear, scene.warp, scene.weft)
        return Ply(scene.mesh, fabric, self.formulation)


def extremes() -> list[Extreme]:
    """All problems."""
    families = (
        *(_stiffness_ratios, _stabilisations, _jitters, _slender, _flat_angles),
        *(_crossings, _inclinations, _large_shear, _coordinates, _macro_elements),
        *(_folding, _laws),
    )
    return [problem for family in families for problem in family()]


def _both(C_s: float) -> tuple[Formulation, Formulation]:
    return Full(), OnePoint(C_s)


def _stiffness_ratios() -> Iterator[Extreme]:
    for ratio, element in product((1e2, 1e4, 1e6, 1e8, 1e10), _both(5.0)):
        label = f"E/G = {ratio:.0e}"
        yield Extreme("stiffness", label, strip, element, 0.5 * ratio, 0.5)
    for E, element in product((1e4, 1e8), _both(10.0)):
        yield Extreme("stiffness", f"E = {E:.0e}, G = 0", strip, element, E)


def _stabilisations() -> Iterator[Extreme]:
    for C_s in (1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1000.0):
        yield Extreme("stabilisation", f"C_s = {C_s:g}", strip, OnePoint(C_s))
    for seed in (1, 2, 9):
        meshed, label = partial(strip, seed=seed), "C_s = 1, G = 0.5"
        yield Extreme("stabilisation", label, meshed, OnePoint(1.0), G=0.5, seed=seed)


def _jitters() -> Iterator[Extreme]:
    for jitter, element in product((0.0, 0.15, 0.45), _both(10.0)):
        yield Extreme(
            "jitter", f"jitter {jitter:g}", partial(strip, jitter=jitter), element
        )


def _slender() -> Iterator[Extreme]:
    """Elements of aspect ratio 100, along either fibre family."""
    for size, mesh, element in (
        *product([(2, 300)], ["irregular", "vertical"], _both(10.0)),
        *product([(200, 3)], ["irregular", "horizontal"], _both(10.0)),
    ):
        label = f"{size[0]}×{size[1]} {mesh}"
        yield Extreme("aspect 1:100", label, partial(strip, mesh, size), element)


def _flat_angles() -> Iterator[Extreme]:
    for element in _both(10.0):
        yield Extreme("angle 179°", "strip", strip_with_flat_angles, element)
    yield Extreme("angle 179°", "strip, C_s = 1", strip_with_flat_angles, OnePoint(1.0))
    for element in _both(10.0):
        yield Extreme(
            *("angle 179°", "picture frame", frame_with_flat_angles, element),
            G=0.5,
            exact=True,
        )


def _crossings() -> Iterator[Extreme]:
    for crossing, element in product((30, 60, 90, 120, 150), _both(5.0)):
        straight, bent = (
            partial(net_of, crossing=crossing, shear=15, bend=b) for b in (0, 8)
        )
        label = f"crossing {crossing}°"
        yield Extreme("crossing", label, straight, element, G=0.5, exact=True)
        yield Extreme("crossing", f"{label}, bent", bent, element, G=0.5)


def _inclinations() -> Iterator[Extreme]:
    for angle, element in product((0, 15, 30, 45, 60, 75, 90), _both(5.0)):
        scene = partial(net_of, warp=angle, shear=45, bend=30)
        yield Extreme("inclination", f"warp at {angle}°", scene, element, G=0.5)


def _large_shear() -> Iterator[Extreme]:
    for shear, element in product((20, 45, 70, 85), _both(5.0)):
        frame = partial(picture_frame, size=SIZE, shear_angle=np.radians(shear))
        net = partial(net_of, warp=30, shear=shear, bend=0)
        label = f"shear {shear}°"
        yield Extreme("shear", label, frame, element, G=0.5, exact=True)
        yield Extreme("shear", f"{label}, turned", net, element, G=0.5, exact=True)


def _coordinates() -> Iterator[Extreme]:
    """The strip in other units or translated; E and C_s are forces per length."""
    for element, stiffer in zip(_both(10.0), _both(1e4), strict=True):
        metres = partial(transformed_strip, scale=1e-3, shift=0.0)
        far = partial(transformed_strip, scale=1.0, shift=1e6)
        yield Extreme("coordinates", "metres", metres, stiffer, E=1e7)
        yield Extreme("coordinates", "10⁶ mm away", far, element)


def _macro_elements() -> Iterator[Extreme]:
    """Problems that are extreme for other formulations, on split elements."""

    def problem(
        label: str,
        make: Callable[..., Scene],
        E: float = 1e4,
        G: float = 0.0,
        exact: bool = False,
        **options: Any,
    ) -> Extreme:
        scene = partial(on_split_mesh, make, **options)
        return Extreme("macro-elements", label, scene, Macro(), E, G, exact)

    size = (5, 8)
    for ratio in (1e2, 1e4, 1e6, 1e8, 1e10):
        yield problem(f"E/G = {ratio:.0e}", strip, 0.5 * ratio, 0.5, size=size)
    for E, mesh in product((1e4, 1e8), ("irregular", "delaunay")):
        yield problem(f"E = {E:.0e}, G = 0, {mesh}", strip, E, mesh=mesh, size=size)
    for ratio, mesh in product((1e4, 1e10), ("irregular", "delaunay")):
        kinks: dict[str, Any] = {"mesh": mesh, "size": (4, 8)}
        label = f"bias, E/G = {ratio:.0e}, {mesh}"
        yield problem(label, bias_extension, 0.5 * ratio, 0.5, **kinks)
    yield problem("1:100", strip, size=(2, 150))
    yield problem("jitter 0.45", strip, jitter=0.45, size=size)
    yield problem("angle 179°", strip_with_flat_angles)
    for crossing, bend in product((30, 150), (0, 8)):
        net: dict[str, Any] = {
            "crossing": crossing,
            "shear": 15,
            "bend": bend,
            "size": (4, 4),
        }
        label = f"crossing {crossing}°" + (", bent" if bend else "")
        yield problem(label, net_of, G=0.5, exact=not bend, **net)
    net = {"warp": 30, "shear": 85, "size": (4, 4)}
    yield problem("shear 85°", net_of, G=0.5, exact=True, **net)
    for label, E, scale, shift in (
        ("metres", 1e7, 1e-3, 0.0),
        ("10⁶ mm away", 1e4, 1.0, 1e6),
    ):
        scene = partial(transformed_strip, scale=scale, shift=shift, size=size)
        yield Extreme("macro-elements", label, scene, Macro(), E)


def _folding() -> Iterator[Extreme]:
    """Plies whose elements tend to invert, on many meshes."""

    def on_meshes(
        label: str,
        seeds: Iterable[int],
        make: Callable[..., Scene],
        formulation: Formulation,
        G: float = 0.0,
        **options: Any,
    ) -> Iterator[Extreme]:
        for seed in seeds:
            scene = partial(make, seed=seed, **options)
            yield Extreme("folding", label, scene, formulation, G=G, seed=seed)

    for C_s, seeds in ((1.0, range(24)), (0.1, range(6)), (0.01, range(6))):
        label = f"strip 6×9, C_s = {C_s:g}"
        yield from on_meshes(label, seeds, strip, OnePoint(C_s), size=(6, 9))
    for C_s in (1.0, 0.1):
        label = f"strip 10×15, C_s = {C_s:g}"
        yield from on_meshes(label, range(2, 9), strip, OnePoint(C_s))
    for G, seeds in ((0.1, range(24)), (0.0, range(8))):
        label = f"bias 60°, Delaunay, G = {G:g}"
        pulled = partial(on_split_mesh, bias_extension, mesh="delaunay", size=(6, 12))
        angle = np.radians(60)
        yield from on_meshes(label, seeds, pulled, Macro(), G, shear_angle=angle)
    for label, make, size in (
        ("bias 40°, G = 0", bias_extension, (6, 12)),
        ("trellis, G = 0", trellis, SIZE),
    ):
        yield from on_meshes(label, range(4), make, OnePoint(), size=size)


def _laws() -> Iterator[Extreme]:
    """Laws of real fabrics: on the bias extension with all formulations.

    On the other scenes, formulations alternate between laws.  Each formulation of a law
    has another fibre stiffness; the assignment rotates from law to law.
    """
    angle = np.radians(60)
    scenes = {
        "strip": partial(strip, size=(5, 8)),
        "trellis": partial(net_of, shear=60, bend=30, size=(4, 4)),
        "picture frame": partial(picture_frame, size=(4, 4), shear_angle=angle),
        "bias extension": partial(bias_extension, size=(4, 8), shear_angle=angle),
    }
    for (i, (name, scene)), (j, law) in product(
        enumerate(scenes.items()), enumerate((*TENSIONS, *SHEARS))
    ):
        for k, formulation in enumerate(_OF_LAWS):
            if name != "bias extension" and (i + j - k) % len(_OF_LAWS):
                continue
            E = _STIFFNESSES[(j + k) % len(_STIFFNESSES)]
            yield Extreme(
                f"laws: {name}",
                f"{law}, E = {E:.0e}",
                scene,
                formulation,
                E,
                G=0.5,
                tension=TENSIONS[law](E) if law in TENSIONS else None,
                shear=SHEARS.get(law),
                exact=name == "picture frame",
            )
