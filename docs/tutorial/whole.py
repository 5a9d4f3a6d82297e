"""Pull a measured fabric with a hole in it: the tutorial's script, whole."""

import csv

import numpy as np

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    LoadStepper,
    Outline,
    Ply,
    Quadratic,
    Tabulated,
    TensionOnly,
    mesh_outline,
    plot,
)
from skfem_textile.io import read_mesh
from skfem_textile.plot.curves import curves

# Part 1: an outline, a fabric and a mesh
outline = Outline([[0, 50, 50, 0], [0, 0, 120, 120]])
fabric = Fabric(tension=7e3, shear=0.1, warp=(1, 1), weft=(-1, 1))
conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (0.0, 20.0))}
mesh = mesh_outline(outline, fabric, conditions)


# Part 2: a tensile test
def stretch(ply, conditions=conditions):
    """Apply the conditions in eight steps."""
    return LoadStepper(ply, conditions, steps=8).run()


result = stretch(Ply(mesh, fabric, Quadratic(400, points=6)))
print(result)
force = result.states[-1].reactions["pull"][1]
print(f"force: {force:.2f} N")


# Part 3: a curve and a picture
def force_against_displacement(result):
    """Displacement in mm, force and its half-width in N along y, for each state."""
    displacement = [state.displacements["pull"][1] for state in result.states]
    force = [state.reactions["pull"][1] for state in result.states]
    unknown = np.full(2, np.nan)  # at rest there is no interval
    intervals = [result.interval(state) for state in result.states]
    half_width = [of.reactions.get("pull", unknown)[1] for of in intervals]
    return np.array(displacement), np.array(force), np.array(half_width)


def show(result, name):
    """Write a table and a diagram of the force, and a picture of the shear angle."""
    columns = force_against_displacement(result)
    with open(f"{name}.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["displacement (mm)", "force (N)", "half-width (N)"])
        writer.writerows(zip(*columns, strict=True))
    panel = {"Pull": {name: columns}}
    curves(panel, "Displacement (mm)", "Force (N)", f"{name}_force.png")
    plot.shear_angle(result, filename=f"{name}_shear_angle.png")


show(result, "first")


# Part 4: can I trust it?
def judge(result):
    """Print the values that indicate whether a result can be trusted."""
    summary = result.summary()
    for key in (
        "stable",
        "path_resolved",
        "min_det_F",
        "max_shear_angle_deg",
        "max_fibre_strain",
        "energy_share_of_stabilisation",
        "energy_share_of_deviation",
        "load_half_width",
    ):
        value = summary[key]
        print(f"{key:32}", f"{value:.3g}" if isinstance(value, float) else value)


judge(result)

# Part 5: your own fabric
shear = Tabulated.from_csv("shear.csv", odd=True)
fibres = TensionOnly(CrimpToe(7e3, toe=0.003, initial_stiffness=10.0))
measured = Fabric(fibres, shear, warp=(1, 1), weft=(-1, 1))
mesh = mesh_outline(outline, measured, conditions)
own_fabric = stretch(Ply(mesh, measured, Quadratic(400, points=6)))
show(own_fabric, "own_fabric")
print(f"measured fabric: {own_fabric.states[-1].reactions['pull'][1]:.2f} N")

# Part 6: your own outline
drawn = Outline.from_svg("coupon.svg")
print(list(drawn.boundaries))
shorter = {**conditions, "pull": Condition("top", (0.0, 15.0))}
mesh = mesh_outline(drawn, measured, shorter)
own_outline = stretch(Ply(mesh, measured, Quadratic(400, points=6)), shorter)
show(own_outline, "own_outline")
judge(own_outline)
print(f"force: {own_outline.states[-1].reactions['pull'][1]:.2f} N")

# Part 7: your own mesh
with_hole = read_mesh("coupon.msh")
own_mesh = stretch(Ply(with_hole, measured), shorter)
judge(own_mesh)
print(f"force: {own_mesh.states[-1].reactions['pull'][1]:.2f} N")
