"""A test, in a child process, whether VTK can draw off screen."""

import functools
import os
import subprocess
import sys

_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"

_DRAW = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.Render()
"""


@functools.cache
def require_offscreen() -> None:
    """Choose a kind of OpenGL window in which VTK can draw off screen.

    Without one VTK ends the process with a segmentation fault, so that each kind is
    tried in a child process.  The environment variable by which VTK chooses is
    set to the first kind that works: EGL, then OSMesa, then the default of VTK.

    Raises
    ------
    RuntimeError
        If none works; the message names the package to install.
    """
    preset = [os.environ[_WINDOW]] if _WINDOW in os.environ else []
    kinds = ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]
    for kind in preset + (kinds if sys.platform == "linux" else []):
        if _can_draw({_WINDOW: kind}):
            os.environ[_WINDOW] = kind
            return
    if not _can_draw({}):
        raise RuntimeError(
            "VTK cannot draw off screen here; "
            "install the Debian packages libegl1 and libgl1-mesa-dri"
        )


def _can_draw(environment: dict[str, str]) -> bool:
    child = subprocess.run(
        [sys.executable, "-c", _DRAW],
        env={**os.environ, **environment},
        capture_output=True,
        check=False,
    )
    return child.returncode == 0
