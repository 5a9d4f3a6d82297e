"""Defective meshes are rejected in one line, and plies on valid ones are correct."""

import re
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import meshio
import numpy as np
import pytest
from hypothesis import strategies as st
from skfem import MeshQuad, MeshTri

from skfem_textile import Fabric, Full, Macro, OnePoint, Ply, Quadratic
from skfem_textile.io import read_mesh
from skfem_textile.mesh.splitting import cut, split, split_cells
from tests.helpers.hostile import (
    RIGHT,
    Family,
    UnclearError,
    WrongAnswerError,
    expect_close,
    rejected,
    seeds,
)
from tests.helpers.hostile.sheets import (
    Sheet,
    fans,
    in_triangles,
    jittered,
    joined,
    moved,
    opened,
    renumbered,
    rolled,
    sheet,
    shifted,
)
from tests.helpers.independent import polygon, shear_angle, strain

E, G, C_S = 50.0, 2.0, 4.0

# Relative tolerance of an energy or a force.
TOLERANCE = 1e-6

# Number of meshes of each defect in the study.
MESHES = 20

# Defects, each a function of random numbers


def plain_sheet(rng):
    return jittered(sheet(), rng)


def changed(change):
    """A sheet that a function of it and of random numbers changes or replaces."""

    def make(rng):
        base = plain_sheet(rng)
        return change(base, rng) or base

    return make


def inner_node(rng):
    return int(rng.choice([6, 7, 8, 11, 12, 13, 16, 17, 18]))


def with_coordinate(value):
    @changed
    def make(base, rng):
        base.p[rng.integers(2), inner_node(rng)] = value

    return make


@changed
def outlier(base, rng):
    base.p[:, inner_node(rng)] += rng.choice([-1, 1]) * np.array([1.6, 0.2])


def collapsed(gap):
    @changed
    def make(base, rng):
        node = inner_node(rng)
        base.p[:, node + 1] = base.p[:, node] + [gap, 0.0]

    return make


@changed
def bow_tie(base, rng):
    cell = rng.integers(16)
    base.t[:2, cell] = base.t[[1, 0], cell]


@changed
def node_twice(base, rng):
    cell = rng.integers(16)
    base.t[2, cell] = base.t[rng.integers(2), cell]


def with_number(number):
    @changed
    def make(base, rng):
        base.t[rng.integers(4), rng.integers(16)] = number

    return make


@changed
def repeated(base, rng):
    again = rng.integers(0, 16, rng.integers(1, 4))
    return base._replace(t=np.hstack([base.t, base.t[:, again]]))


@changed
def third_at_edge(base, rng):
    p = np.hstack([base.p, [[2.2, 2.7], [2.5, 2.4]]])
    return Sheet(p, np.hstack([base.t, [[12], [17], [25], [26]]]))


@changed
def with_unused_nodes(base, rng):
    return base._replace(p=np.hstack([base.p, rng.uniform(-9, 9, (2, 2))]))


def hanging_nodes(rng):
    """Fine cells beside coarse ones; they share the corners of the coarse ones."""
    base = joined(sheet(2, 2), shifted(sheet(2, 4), 4, 0))
    _, first, number = np.unique(
        base.p.round(6), axis=1, return_index=True, return_inverse=True
    )
    return Sheet(base.p[:, first], number.ravel()[base.t])


def inclusion(rng):
    """An inclusion; its nodes are not merged with the nodes of the sheet around it."""
    base = sheet()
    inside = (abs(base.p[:, base.t].mean(axis=1) - 2) < 1).all(axis=0)
    parts = []
    for cells in (base.t[:, inside], base.t[:, ~inside]):
        used, t = np.unique(cells, return_inverse=True)
        parts.append(Sheet(base.p[:, used], t.reshape(cells.shape)))
    return joined(*parts)


def layers(turned):
    return changed(lambda base, rng: joined(base, base._replace(t=base.t[::turned])))


def with_second(*position, first=sheet, second=sheet):
    """A second sheet at a position, perhaps scaled."""
    return lambda rng: joined(first(), shifted(second(), *position))


def scaled(*size):
    """Coordinates multiplied, the second one perhaps by another number."""
    return changed(lambda base, rng: base._replace(p=base.p * np.array(size)[:, None]))


def whole(make):
    return lambda rng: make()


class Defect(NamedTuple):
    """A defect of a mesh, and what its rejection says.

    ``sound`` is True if the mesh must be accepted, None if it may be; ``cells`` are
    "quads" if the defect needs quadrilaterals, "any" if triangles have it too.
    """

    make: Callable
    says: str = ""
    sound: bool | None = False
    cells: str = "any"
    metres: bool = False  # a file of it is rejected as one in metres


def valid(make, cells="any", metres=False):
    return Defect(make, "are the coordinates in metres?" * metres, True, cells, metres)


CUT = partial(opened, sheet(), 1.0, 3.0)
TURN = 2 * np.pi
REFLEX = Sheet(np.array([[0, 2, 0.95, 0], [0, 0, 0.98, 2.0]]), np.arange(4)[:, None])

ON_TOP = "lie on top of others, edge on edge"
CROSS = "overlap others that are not neighbours, where the boundary crosses itself"
INSIDE = "overlap .* because one part of the mesh lies inside another"
DOUBLED = r"node\(s\) coincide with others"
HANG = r"node\(s\) lie in the interior of an edge"
OVERLAP = "overlap a neighbour|inverted or degenerate"
FLAT = "inverted or degenerate"
SHARED = "share an edge with more than one other"
UNDEFINED = r"\(s\) refer to an undefined node"

DEFECTS = {
    "none": valid(plain_sheet),
    "two layers": Defect(layers(1), ON_TOP),
    "a layer turned over": Defect(layers(-1), ON_TOP),
    "a layer shifted by a cell": Defect(with_second(1, 0), ON_TOP),
    "a layer shifted": Defect(with_second(0.3, 1.3), f"^[^0-9]*4 .*{CROSS}"),
    "a patch on the sheet": Defect(with_second(1.3, 1.3, 0.1), INSIDE),
    "an inclusion": Defect(inclusion, DOUBLED),
    "a seam": Defect(with_second(4, 0), DOUBLED),
    "a seam of 1e-12": Defect(with_second(4 + 4e-12, 0), DOUBLED),
    "a gap of 1 %": valid(with_second(4.01, 0)),
    "half a seam": Defect(whole(partial(opened, sheet(), 0, 1)), DOUBLED),
    "all of a seam": Defect(whole(partial(opened, sheet(), 0, 4)), DOUBLED),
    "a cut": valid(whole(CUT)),
    "an open cut": valid(whole(partial(CUT, by=0.05))),
    "a slit from an edge": valid(whole(partial(opened, sheet(), 0, 1, by=0.05))),
    "a cut and a seam": Defect(with_second(4, 0, first=CUT), DOUBLED),
    "hanging nodes": Defect(hanging_nodes, HANG),
    "a seam between other meshes": Defect(
        with_second(4, 0, second=partial(sheet, 3, 3)), HANG
    ),
    "a node in two pieces": valid(
        whole(partial(fans, (0, 90, 1), (180, 270, 1))), "quads"
    ),
    "corners at one place": Defect(with_second(4, 4), DOUBLED),
    "fans that overlap": Defect(
        whole(partial(fans, (0, 90, 1), (45, 135, 1))), CROSS, cells="quads"
    ),
    "a fan in a fan": Defect(
        whole(partial(fans, (0, 90, 1), (30, 60, 0.3))), INSIDE, cells="quads"
    ),
    "rolled onto itself": Defect(whole(partial(rolled, TURN * 1.3, 0.0)), CROSS),
    "rolled, and apart": valid(whole(partial(rolled, TURN * 1.6, 1.4))),
    "rolled into a slit": valid(whole(partial(rolled, TURN * 0.97, 0.0))),
    "rolled into a ring": Defect(whole(partial(rolled, TURN, 0.0)), DOUBLED),
    "a node thrown out": Defect(outlier, OVERLAP),
    "an edge collapsed": Defect(collapsed(0.0), FLAT),
    "an edge of 1e-12": Defect(collapsed(1e-12), FLAT),
    "all in a line": Defect(
        changed(lambda base, rng: Sheet(base.p[0] * [[1.0], [0.3]], base.t)), FLAT
    ),
    "a bow-tie": Defect(bow_tie, f"{OVERLAP}|{SHARED}", cells="quads"),
    "a cell twice": Defect(repeated, SHARED),
    "three cells at an edge": Defect(third_at_edge, SHARED),
    "unused nodes": Defect(with_unused_nodes, r"2 node\(s\) belong to no "),
    "a node twice in a cell": Defect(node_twice, f"{FLAT}|{SHARED}|belong to no"),
    "a corner beyond flat": valid(lambda rng: REFLEX, "quads"),
    "not a number": Defect(with_coordinate(np.nan), "coordinates that are not finite"),
    "infinite": Defect(with_coordinate(-np.inf), "coordinates that are not finite"),
    "at 1e200": Defect(with_coordinate(1e200), r"coordinates beyond ±1e\+100 mm"),
    "node -1": Defect(with_number(-1), UNDEFINED),
    "node 25": Defect(with_number(25), UNDEFINED),
    "node 2^30": Defect(with_number(2**30), UNDEFINED),
    "no nodes": Defect(
        lambda rng: Sheet(np.zeros((2, 0)), np.zeros((4, 0), int)), "has no nodes"
    ),
    "no cells": Defect(
        changed(lambda base, rng: base._replace(t=base.t[:, :0])), "to no |found none"
    ),
    "in units of 1e-9": valid(scaled(1e-9, 1e-9), metres=True),
    "in units of 1e9": valid(scaled(1e9, 1e9)),
    "in units of 1e-200": Defect(scaled(1e-200, 1e-200), FLAT, None),
    "in units of 1e90": Defect(scaled(1e90, 1e90), "", None),
    "in units of 1e120": Defect(scaled(1e120, 1e120), r"beyond ±1e\+100 mm"),
    "far away": valid(lambda rng: shifted(sheet(), 1e6, 0)),
    "too far away": Defect(lambda rng: shifted(sheet(), 1e17, 0), FLAT),
    "thin": valid(scaled(1.0, 1e-4)),
    "thinner than round-off": Defect(scaled(1.0, 1e-14), FLAT, None),
}


def defective(name, rng):
    """A sheet with a defect, sometimes of triangles, moved and renumbered."""
    defect = DEFECTS[name]
    base = defect.make(rng)
    base = Sheet(base.p.astype(float), np.array(base.t))
    if defect.cells == "any" and base.t.size and rng.random() < 0.4:
        base = in_triangles(base)
    if 0.1 < np.abs(base.p).max(initial=0) < 1e3:
        base = moved(base, rng)
    listed = (base.t >= 0) & (base.t < base.p.shape[1])
    return renumbered(base, rng) if listed.all() and base.t.size else base


# Ways to give a mesh to the library


def directly(base):
    return (MeshTri if len(base.t) == 3 else MeshQuad)(base.p, base.t)


def in_a_file(base):
    kind = "triangle" if len(base.t) == 3 else "quad"
    points = np.pad(base.p, ((0, 1), (0, 0))).T
    meshio.Mesh(points, {kind: base.t.T}).write("mesh.vtu")
    return read_mesh(Path("mesh.vtu"))


def split_in_a_file(base):
    mesh = in_a_file(base)
    return split(mesh) if isinstance(mesh, MeshTri) else mesh


def was_cut(base):
    mesh = directly(base)
    return cut(mesh) if isinstance(mesh, MeshQuad) else mesh


WAYS = {
    "directly": directly,
    "in a file": in_a_file,
    "split in a file": split_in_a_file,
    "split": lambda given: split(directly(given)),
    "cut": was_cut,
    "cells": lambda given: split_cells(given.p, [given.t]),
}


def attempt(hostile):
    name, reader, seed = hostile
    rng, sound = np.random.default_rng(seed), DEFECTS[name].sound
    if DEFECTS[name].metres and "file" in reader:
        sound = False
    base = defective(name, rng)
    angles = rng.uniform(0, np.pi) + np.array([0.0, rng.uniform(1, 2)])
    A = np.array([np.cos(angles), np.sin(angles)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            mesh = WAYS[reader](base)
            formulations = [Quadratic(), Quadratic(20.0)]
            if isinstance(mesh, MeshQuad):
                formulations = [Full(), OnePoint(C_S)]
                formulations += [Macro(C_S)] if reader in ("split", "cells") else []
            chosen = formulations[rng.integers(len(formulations))]
            ply = Ply(mesh, Fabric(E, G, *A.T), chosen)
        except ValueError as error:
            if sound:
                raise WrongAnswerError(f"a sound mesh is refused: {error}") from None
            if not re.search(DEFECTS[name].says, str(error)):
                raise UnclearError(error) from None
            return rejected(error)
    if sound is False:
        raise WrongAnswerError(f"taken: {ply}")
    with np.errstate(all="ignore"):
        check_uniform_stretch(ply, A.T, rng)
    return RIGHT


def check_uniform_stretch(ply, A, rng):
    """Energies of a uniform deformation gradient agree with the formula."""
    F = np.eye(2) + 0.1 * (2 * rng.random((2, 2)) - 1)
    middle = ply.nodes.mean(axis=1, keepdims=True)
    u = np.empty(ply.basis.N)
    u[ply.nodal(np.arange(ply.basis.N))] = (F - np.eye(2)) @ (ply.nodes - middle)
    energies = ply.energies(u)
    area = sum(polygon(ply.mesh.p[:, cell]) for cell in ply.mesh.t.T)
    F = F[..., None]
    tension = area * E / 2 * float(sum(strain(F, a)[0] ** 2 for a in A))
    shear = area * G / 2 * float(shear_angle(F, A)[0]) ** 2
    expected = {"tension": tension, "shear": shear}
    for name, energy in energies.items():
        expect_close(name, energy, expected.get(name, 0.0), TOLERANCE * tension)


FAMILY = Family(
    "mesh defects",
    {
        name: st.tuples(st.just(name), st.sampled_from(["directly", *WAYS]), seeds)
        for name in DEFECTS
    },
    attempt,
    len(DEFECTS) * MESHES,
    short=len(DEFECTS),
)


@pytest.mark.parametrize("number", range(len(DEFECTS)))
def test_a_defective_mesh_is_rejected_and_a_valid_one_is_computed_correctly(number):
    """Every defect twice, as given and in another way."""
    for seed, way in ((1, "directly"), (number, list(WAYS)[number % len(WAYS)])):
        FAMILY.outcome((list(DEFECTS)[number], way, seed))
