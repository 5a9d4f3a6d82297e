"""Output of a run, compared with its case and with plain formulas."""

import csv
import json
import tomllib
from pathlib import Path

import meshio
import numpy as np
from skfem import MeshTri

from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import independent as plain
from tests.helpers.hostile import (
    WrongAnswerError,
    expect,
    expect_close,
    expect_equal,
)
from tests.helpers.hostile.options import GRADED, MESHES, SIDES
from tests.helpers.independent import polygon

# Tolerance of a number, relative to the largest of its kind.
_TOLERANCE = 1e-7

_PICTURES = ("fibre_strain.png", "shear_angle.png", "load.png", "animation.gif")

# Radius of the circle onto which the strip is bent, and length over which a fibre of
# the trellis rotates by the bend angle, in mm.
_RADIUS, _SIDE = 55.0, 100.0


def expect_near(name, value, expected, size):
    """Check that numbers agree, relative to a size."""
    expect_close(name, value, expected, _TOLERANCE * size + 1e-300)


class Results:
    """The files of a run of a scene in the plane, and vectors before it is turned."""

    def __init__(self, out: Path) -> None:
        text = (out / "case.toml").read_text(encoding="utf-8")
        self.out, self.case = out, tomllib.loads(text)
        self.scene = self.case["scene"]
        text = (out / "summary.json").read_text()
        self.summary = json.loads(text, parse_constant=_refuse_constant)
        with open(out / "history.csv", newline="") as file:
            self.history = list(csv.DictReader(file))
        n = self.summary["load_steps"]
        files = (out / "fields" / f"step_{i:04d}.vtu" for i in (0, n))
        self.first, self.last = map(meshio.read, files)
        self.t = self.summary["load_factor"]
        self.X = self.unrotated(self.last.points)
        self.u = self.unrotated(self.last.point_data["displacement"])
        degrees = [self.scene.get("warp_deg", 0.0)]
        mirrored = self.scene["name"] in ("bias_extension", "specimen")
        degrees.append(
            self.scene.get("weft_deg", 180 - degrees[0] if mirrored else 90.0)
        )
        self.fibres = np.radians(degrees)
        if self.scene["name"] == "bias_extension":
            self.fibres = self.fibres % np.pi

    def unrotated(self, x):
        """Vectors of a file, (n, 3), in the scene before it is rotated, (2, n)."""
        a = -np.radians(self.scene["rotate_deg"])
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        return turn @ x.T[:2]

    def check(self, converged: bool) -> None:
        """Check that results agree with the case."""
        self.check_summary(converged)
        self.check_mesh()
        self.check_fields()
        error = self.misplaced()
        expect(error <= 1e-6, f"an edge is off by {error} mm")
        self.check_energies()
        self.check_forces()

    def check_checkpoint(self, folder: Path | None) -> None:
        """Check that a folder has a checkpoint of every state, or none."""
        states = len(list(folder.glob("state_*.npz"))) if folder else 0
        expect_equal("kept", states, (self.summary["load_steps"] + 1) * bool(folder))
        is_there = (self.out / "checkpoint").exists()
        expect(folder or not is_there, "there is a checkpoint")

    def check_summary(self, converged):
        """The case, load factors, conditions and pictures."""
        summary, case, rows = self.summary, self.case, self.history
        inputs = {k: v for k, v in summary["inputs"].items() if k != "version"}
        expect_equal("inputs", list(differences("", inputs, case)), [])
        expect_equal("scene", summary["scene"], self.scene["name"])
        if (name := case["formulation"]["name"]) != "auto":
            expect_equal("formulation", summary["formulation"], name)
        empty = {k for k, v in summary.items() if v is None} - {"negative_pivots"}
        interval = summary["error_interval"]
        if "none for the load: " in interval:
            empty -= {"load_half_width", "load_N_half_width"}
        if interval.startswith("none: "):
            empty -= {"load_half_width", "load_N_half_width", "shear_angle_error_deg"}
        expect_equal("numbers that are none", empty, set())
        expect_equal("converged", summary["converged"], converged)
        expect_equal("rows", len(rows), summary["load_steps"] + 1)
        reached = [float(row["load_factor"]) for row in rows]
        expect_equal("load factor", reached[-1], _rounded(self.t))
        expect_equal("the whole load", reached[-1] == 1.0, converged)
        steps = np.linspace(0, 1, case["stepping"]["steps"] + 1).tolist()
        targets = {t for t in map(_rounded, steps) if t <= reached[-1]}
        expect(targets <= set(reached), f"load factors {reached}, not {targets}")
        ending = "_reaction_x"
        names = {k.removesuffix(ending) for k in rows[0] if k.endswith(ending)}
        expect_equal("conditions", names, self.conditions())
        for name in _PICTURES if case["output"]["pictures"] else ():
            expect((self.out / name).stat().st_size, f"no {name}")

    def conditions(self):
        """Names of the conditions."""
        scene = self.scene
        if scene["name"] == "strip":
            return {"bottom", "right"}
        if scene["name"] == "bias_extension":
            half = scene["part"] == "half"
            return {"bottom", "top", "axis"} if half else {"bottom", "top"}
        if scene["name"] == "specimen":
            moves = scene["move_mm"].items()
            return {name for name, move in moves if move != ["free", "free"]}
        free, rollers = scene.get("free", []), set(scene.get("roller_deg", ()))
        return {"held", next(s for s in SIDES if s not in free)} | rollers

    def sides(self):
        """Width and height of the generated mesh, in mm."""
        scene = self.scene
        if scene["name"] == "strip":
            return 40.0, 60.0
        if scene["name"] == "bias_extension":
            share = 0.5 if scene["part"] == "half" else 1.0
            return share * 50.0, 100.0 * float(np.tan(self.fibres[0]))
        return scene.get("width_mm", 100.0), scene.get("height_mm", 100.0)

    def check_mesh(self):
        """Nodes, and the number of elements."""
        mesh, X = self.case["mesh"], self.unrotated(self.first.points)
        if mesh["source"] == GRADED or "nodes" in self.summary.get("mesh_changes", ""):
            return self.check_graded_mesh(X)
        if mesh["source"] in MESHES:
            settings = mesh["source"], mesh["jitter"], mesh["seed"]
            made = rectangle(*self.sides(), mesh["size"], *settings, *self.fibres)
            points, triangles, least = made.p, isinstance(made, MeshTri), made.nelements
        else:
            file = meshio.read(self.out / mesh["source"])
            points, triangles = file.points.T[:2], "triangle" in file.cells_dict
            least = len(file.cells[0].data)
        expect_near("nodes", X[:, : points.shape[1]], points, np.abs(points).max())
        name = self.summary["formulation"]
        parts = [3, 3] if triangles else [4, 6] if name == "macro" else [1, 1]
        if name == "quadratic":
            parts = [1, 1] if triangles else [2, 2]
        n = self.summary["n_elements"]
        is_right = parts[0] * least <= n <= parts[1] * least
        expect(is_right, f"{n} elements of {least} that were given")
        expect_equal("cells", sum(len(c.data) for c in self.first.cells), n)

    def check_graded_mesh(self, X):
        """Sides and area of a mesh along the singular fibres."""
        sides, n = self.sides(), self.summary["n_elements"]
        expect_near("sides", X.max(axis=1), np.array(sides), max(sides))
        area, cells = 0.0, self.first.cells
        for block in cells:
            corners = 4 if block.type.startswith("quad") else 3
            x, y = X[:, block.data.T[:corners]]
            twice = np.sum(x * np.roll(y, -1, 0) - np.roll(x, -1, 0) * y, axis=0)
            area += np.abs(twice).sum() / 2
        expect_near("area", area, np.prod(sides), np.prod(sides))
        expect_equal("cells", sum(len(c.data) for c in cells), n)

    def check_fields(self):
        """Inclinations of the fibres at rest, and tension against strain."""
        tension, formulation = self.case["tension"], self.case["formulation"]
        if not _is_linear(tension):
            return  # tension at rest, which a smooth switch has too, moves fibres
        means = formulation["name"] in ("auto", "macro") or "deviation" in formulation
        E = tension["stiffness_N_per_mm"]
        for family, angle in zip(("warp", "weft"), self.fibres, strict=True):
            direction = self.unrotated(self.first.cell_data[f"{family}_direction"][0])
            expected = np.array([[np.cos(angle)], [np.sin(angle)]])
            expect_near(f"{family} at rest", direction, expected, 1.0)
            if not means:
                strain = self.last.cell_data[f"{family}_strain"][0]
                value = self.last.cell_data[f"{family}_tension"][0]
                expect_near(f"{family} tension", value, E * strain, E)

    def misplaced(self):
        """The largest distance of an edge's node from its prescribed position."""
        scene, X, u, t = self.scene, self.X, self.u, self.t
        size = X.max(axis=1)
        on = {
            side: abs(X[axis] - end * size[axis]) < 1e-9 * size[axis]
            for side, axis, end in (
                *(("left", 0, 0), ("right", 0, 1), ("bottom", 1, 0), ("top", 1, 1)),
            )
        }
        if scene["name"] == "strip":
            R = _RADIUS / t if t else np.inf
            arc = R * (1 - np.cos(X[1] / R)) if t else 0 * X[1]
            off = [u[:, on["bottom"]].ravel(), (u[0] - arc)[on["right"]]]
        elif scene["name"] == "bias_extension":
            theta, half = self.fibres[0], scene["part"] == "half"
            gamma = np.radians(scene["shear_angle_deg"])
            width, height = size * ((2, 1) if half else (1, 1))
            length = (height / np.sin(theta) - width / np.cos(theta)) / 2
            rise = 2 * length * (np.sin(theta + t * gamma / 2) - np.sin(theta))
            off = [u[:, on["bottom"]].ravel(), u[0, on["top"]], u[1, on["top"]] - rise]
            off += [u[0, on["right"]]] if half else []
        elif scene["name"] == "specimen":
            off = [
                u[axis, on[side]] - t * component
                for side, move in scene["move_mm"].items()
                for axis, component in enumerate(move)
                if component != "free"
            ]
        else:
            x, rollers = self.trellis() - X - u, scene.get("roller_deg", {})
            carried = {*scene.get("free", ()), *rollers}
            held = np.any([on[side] for side in on if side not in carried], axis=0)
            off = [x[:, held].ravel()]
            for side, degrees in rollers.items():
                normal = np.array(
                    [-np.sin(np.radians(degrees)), np.cos(np.radians(degrees))]
                )
                off.append(normal @ x[:, on[side]])
        return float(np.abs(np.concatenate(off)).max())

    def trellis(self):
        """Positions of nodes in a trellis whose fibres bend onto circles."""
        scene, t, gamma = self.scene, self.t, np.radians(self.scene["shear_angle_deg"])
        s = np.linalg.solve([np.cos(self.fibres), np.sin(self.fibres)], self.X)
        turns = (0.0, 0.0), (-t * gamma, 0.0)
        if scene["name"] == "trellis":
            bend = t * np.radians(scene["bend_deg"]) / _SIDE
            turns = (t * gamma / 2, -bend), (-t * gamma / 2, bend)
        x = np.zeros_like(self.X)
        for angle, (turn, curvature), along in zip(self.fibres, turns, s, strict=True):
            half = curvature * along / 2  # of a chord of an arc
            inclination = angle + turn + half
            chord = along * np.sinc(half / np.pi)
            x += chord * np.stack([np.cos(inclination), np.sin(inclination)])
        return x

    def check_energies(self):
        """Energies by their definitions, of bilinear quadrilaterals."""
        formulation, tension = self.case["formulation"], self.case["tension"]
        name, shear = self.summary["formulation"], self.case["shear"]
        if name == "quadratic":
            return  # the files do not contain the nodes at the middles of edges
        E, G = tension["stiffness_N_per_mm"], shear["stiffness_N_per_mm"]
        sine, rule = shear["law"] == "sin2", "gauss" if name == "full" else "centre"
        laws = (
            plain.Law(lambda e: E * e**2 / 2, None, E),
            plain.Law(lambda g: G * (np.sin(g) if sine else g) ** 2 / 2, None, G),
        )
        A = np.stack([np.cos(self.fibres), np.sin(self.fibres)]).T
        cells = list(self.last.cells[0].data)
        cloth = plain.Cloth(self.X, cells, lambda e, X: A, laws[:1] * 2, laws[1])
        x, summary = (self.X + self.u)[..., None], self.summary
        if name != "macro" and _is_linear(tension):
            scale = E * sum(polygon(self.X[:, cell]) for cell in cells)
            expected = float(plain.tension(cloth, x, rule)[0])
            size = min(1e-3 * scale, expected + 1e-9 * E)
            expect_near("tension", summary["tension_energy"], expected, size)
        expected = float(plain.shear(cloth, x, rule)[0])
        expect_near("shear", summary["shear_energy"], expected, expected + 1e-9 * G)
        C_s = formulation.get("cs_N_per_mm", "auto")
        kind = formulation.get("stabilisation", "energy")
        if C_s != "auto" and kind in ("energy", "isotropic"):
            held = plain.isotropic if kind == "isotropic" else plain.hourglass
            expected = float(held(cloth, x, C_s)[0])
            size = expected + 1e-9 * C_s
            expect_near("held", summary["stabilisation_energy"], expected, size)

    def check_forces(self):
        """The potential −F·u of a force, u the mean displacement of its side."""
        for side, total in self.case["loads"].get("force_N", {}).items():
            across, end = (0, 1) if side in ("left", "right") else (1, 0)
            x = self.X[across]
            edge = x.max() if side in ("right", "top") else x.min()
            on = np.flatnonzero(np.abs(x - edge) < 1e-9 * np.ptp(x))
            on = on[np.argsort(self.X[end, on])]
            length = np.diff(self.X[end, on])
            middles = self.u[:, on[1:]] + self.u[:, on[:-1]]
            mean = middles @ length / (2 * length.sum())
            written = self.summary[f"force on {side}_potential"]
            size = np.abs(total).max() * np.abs(self.u).max()
            if self.summary["formulation"] != "quadratic":
                expect_near(
                    f"force on {side}", written, -self.t * float(mean @ total), size
                )


def _is_linear(tension):
    """True if fibres have the default linear law."""
    return tension["compression"] == "law" and not tension["pretension_N_per_mm"]


def _refuse_constant(constant):
    raise WrongAnswerError(f"{constant} in summary.json")


def _rounded(number):
    """A number as files contain it, with twelve digits."""
    return float(f"{number:.12g}")


def differences(where, data, written):
    """Differences between given and written values; names of files may differ."""
    if isinstance(data, dict) and isinstance(written, dict):
        for key, value in data.items():
            if key in written:
                yield from differences(f"{where}.{key}", value, written[key])
            elif value != {}:
                yield f"{where}.{key} is not written"
    elif isinstance(data, list) and isinstance(written, list):
        if len(data) != len(written):
            yield f"{where} is {written!r}, not {data!r}"
        for one, other in zip(data, written, strict=False):
            yield from differences(where, one, other)
    elif isinstance(written, str) and written.startswith("case_files/"):
        return
    else:
        exact = float(data) if isinstance(written, float) else data
        if exact != written and not (data != data and written != written):
            yield f"{where} is {written!r}, not {data!r}"
