"""
Animation of a ply that a hemisphere forms
==========================================

A hemispherical punch forms a ply with fibres along x and y through a die. The script
writes the animation of the start page, its poster and the animation of the README. It
computes the whole ply in 48 load steps, which takes some minutes:

    python examples/media/forming_animation.py docs/images
"""

import sys
from pathlib import Path

from skfem_textile import Fabric, Result, plot
from skfem_textile.plot.pictures import stage_of
from skfem_textile.scenes import Case, hemisphere_forming

# %%
# One frame per state. The shear angle changes its sign from quarter to quarter. Fibres
# are 2.4 mm apart on a picture of the given width.


def formed(elements: int = 24, steps: int = 48) -> Result:
    """Ply of as many elements along x and y, formed by 75 mm."""
    scene = hemisphere_forming(part="whole", tension=0.5, size=(elements, elements))
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    return Case(scene=scene, fabric=fabric, steps=steps).run()


def draw(result: Result, folder: Path) -> None:
    """Write video, poster and GIF."""
    how = {"fibres": True, "size": 85}
    plot.animation(result, folder / "forming.webm", **how)
    plot.animation(result, folder / "forming.gif", **how)
    titles = [stage_of(result, result.states[-1])]
    plot.field(result, titles=titles, filename=folder / "forming.png", **how)


if __name__ == "__main__":
    draw(formed(), Path(sys.argv[1]))
