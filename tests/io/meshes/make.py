"""Make the meshes of this folder with Gmsh: ``python tests/meshes/make.py``.

Two squares of 1 mm × 2 mm side by side.  Groups overlap: ``bottom`` and ``two sides``
share an edge, ``half`` is a part of ``ply``; ``inner`` lies between the two squares and
``corner`` is a point.
"""

from pathlib import Path

import gmsh

FOLDER = Path(__file__).parent
CORNERS = ((0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2))


def geometry(recombine):
    gmsh.clear()
    geo, model = gmsh.model.geo, gmsh.model
    p = [geo.addPoint(x, y, 0, 1) for x, y in CORNERS]
    outer = [geo.addLine(p[i], p[(i + 1) % 6]) for i in range(6)]
    inner = geo.addLine(p[1], p[4])
    loops = [outer[0], inner, *outer[4:]], [*outer[1:4], -inner]
    left, right = (geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops)
    geo.synchronize()
    model.addPhysicalGroup(0, [p[2]], name="corner")
    model.addPhysicalGroup(1, outer[:2], name="bottom")
    model.addPhysicalGroup(1, [inner], name="inner")
    model.addPhysicalGroup(1, [outer[0], outer[5]], name="two sides")
    model.addPhysicalGroup(2, [left, right], name="ply")
    model.addPhysicalGroup(2, [left], name="half")
    if recombine:
        for surface in (left, right):
            model.mesh.setTransfiniteSurface(surface)
            model.mesh.setRecombine(2, surface)
    model.mesh.generate(2)


if __name__ == "__main__":
    gmsh.initialize()
    for cells in ("triangles", "quads"):
        geometry(cells == "quads")
        for version, binary in ((2.2, 0), (4.1, 0), (4.1, 1)):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            kind = f"{10 * version:.0f}{'b' if binary else ''}"
            gmsh.write(str(FOLDER / f"{cells}{kind}.msh"))
        deck = FOLDER / f"{cells}.inp"
        gmsh.write(str(deck))
        deck.write_text(deck.read_text().replace(str(deck), deck.name))
    gmsh.finalize()
