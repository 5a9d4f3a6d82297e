"""
Animation of a ply that a hemisphere forms
==========================================

A hemispherical punch forms a ply with fibres along x and y through a die. The script
writes the animation of README and start page. It computes the whole ply in 48 load
steps, which takes some minutes:

    python examples/media/forming_animation.py docs/images
"""

import sys
from pathlib import Path

from skfem_textile import Fabric, Result, plot
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
    """Write the animation."""
    plot.animation(result, folder / "forming.gif", fibres=True, size=85)


if __name__ == "__main__":
    draw(formed(), Path(sys.argv[1]))
