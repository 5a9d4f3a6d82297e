"""Write the input files of a part: raw tests, an outline, tools and the part's mesh."""

import sys
from pathlib import Path

import ezdxf
import meshio
import numpy as np

from skfem_textile import Locking
from skfem_textile.calibration import PictureFrame

# Distance between punch and die, and gap of the holder, in mm.
CLEARANCE, GAP = 3.0, 0.3


def bump(x, y, a, b, power=2):
    """Height from 1 in the middle to 0, with half-axes a and b in mm."""
    return np.exp(-((x / a) ** power) - (y / b) ** power)


def hood(x, y):
    """A hood with a scoop."""
    return 26 * bump(x, y, 80, 55) + 12 * bump(x - 20, y, 22, 16)


def helmet(x, y):
    """A shell, open in the middle."""
    return 40 * bump(x, y, 62, 50)


def box(x, y):
    """A box of two levels with fillets."""
    return 22 * bump(x, y, 68, 48, 4) + 12 * bump(x - 18, y, 34, 30, 4)


PARTS = {"hood": hood, "helmet": helmet, "box": box}


def grid(half, n, height):
    """Points and quadrilaterals over a rectangle of half the given sides."""
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-h, h, n + 1) for h in half)))
    k = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
    corners = np.column_stack([k, k + 1, k + n + 2, k + n + 1])
    return np.column_stack([x, y, height(x, y)]), corners


def triangles(file, points, corners):
    """Write a tool as STL."""
    both = np.vstack([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    meshio.write_points_cells(file, points, [("triangle", both)])


def tools(folder, height):
    """Write a die with its flange at z = 0, and a punch below it; return the travel."""

    def offset(x, y, h=0.1):
        slope = [height(x + dx, y + dy) - height(x - dx, y - dy) for dx, dy in ((h, 0), (0, h))]
        return CLEARANCE * np.sqrt(1 + (np.hypot(*slope) / (2 * h)) ** 2)

    top = float(height(*np.mgrid[-120:121.0, -90:91.0]).max())
    triangles(folder / "die.stl", *grid((130, 100), 80, height))

    def punch(x, y):
        return height(x, y) - offset(x, y) - top + CLEARANCE - GAP

    triangles(folder / "punch.stl", *grid((110, 85), 70, punch))
    return top - CLEARANCE
