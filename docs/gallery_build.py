"""Gallery of the scripts in ``examples``, built by sphinx-gallery."""

import logging
import shutil
import warnings
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from PIL import Image
from sphinx_gallery.scrapers import figure_rst

# Sphinx shows all that is logged; what runs say of their steps is not for its readers.
for name in ("skfem", "skfem_textile"):
    logging.getLogger(name).setLevel(logging.ERROR)

_PICTURES = {".png", ".gif"}

# A picture with more pixels across, 120 mm at 300 dots per inch, has the page's width.
_COLUMN_WIDTH = 1417

# Order of the scripts; a script that is not named comes last.
_SCRIPTS = {
    "forms": (
        *("paper_element", "own_newton", "ply_newton", "locking", "own_terms"),
        *("glued_sheet", "bonded", "two_fields"),
    ),
    "fabrics": (
        "bias_extension",
        "picture_frame",
        "simple_shear",
        "crimped_fibres",
        "measured_fabric",
        "calibration",
        "scatter",
        "fabric_fields",
        "two_fabrics",
    ),
    "meshes": ("hole", "gmsh_mesh", "from_abaqus", "along_fibres"),
    "loads": (
        "loads",
        "limit_load",
        "hanging_sheet",
        "pressure",
        "double_dome",
        "own_tool",
        "forming",
    ),
    "runs": ("compare_processes", "sweep", "to_a_tolerance"),
}


class Order:
    """The place of a script in its folder."""

    def __init__(self, folder: str) -> None:
        self.scripts = _SCRIPTS.get(Path(folder).name, ())

    def __call__(self, filename: str) -> int:
        """Return its place, from 0 on."""
        name = Path(filename).stem
        known = name in self.scripts
        return self.scripts.index(name) if known else len(self.scripts)


def written_pictures(
    block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]
) -> str:
    """Move the pictures that a block of a script wrote into the gallery.

    The page shows what a reader finds who runs the script, and nothing stays among the
    scripts.
    """
    folder = Path(block_vars["src_file"]).parent
    found = [file for file in folder.rglob("*") if file.suffix in _PICTURES]
    shown = []
    for file in sorted(found, key=lambda file: file.stat().st_mtime_ns):
        place = Path(next(block_vars["image_path_iterator"])).with_suffix(file.suffix)
        shown.append(str(shutil.move(file, place)))
    return "".join(_picture(file, gallery_conf["src_dir"]) for file in shown)


def _picture(file: str, source: str) -> str:
    """Return the directive that shows a picture."""
    text = str(figure_rst([file], source))
    with Image.open(file) as picture:
        wide = picture.width > _COLUMN_WIDTH
    return text.replace("sphx-glr-single-img", "page-wide") if wide else text


def script_knows_its_file(
    gallery_conf: dict[str, Any], script_vars: dict[str, Any]
) -> list[str]:
    """Define ``__file__``, beside which a script finds its data; no arguments."""
    script_vars["example_globals"]["__file__"] = script_vars["src_file"]
    return []


_running = ExitStack()


def warnings_are_errors(
    gallery_conf: dict[str, Any], file: str | None, when: str
) -> None:
    """Let a script end with an error where it would warn."""
    _running.close()
    if when == "before" and file is not None:
        _running.enter_context(warnings.catch_warnings())
        warnings.simplefilter("error")


# The first cell of each notebook.
SHOW_PICTURES = """
# Shows each picture that a cell writes. Data are in the folder of the notebook.
from pathlib import Path

import matplotlib
from IPython import get_ipython
from IPython.display import Image, display

matplotlib.use("agg")
__file__ = str(Path("notebook").resolve())


def written_pictures():
    files = (file for kind in ("png", "gif") for file in Path().rglob(f"*.{kind}"))
    return {file: file.stat().st_mtime_ns for file in files}


def show_new_pictures(_):
    global shown_pictures
    written = written_pictures()
    for file, _ in sorted(written.items() - shown_pictures.items()):
        display(Image(file, width=600))
    shown_pictures = written


shown_pictures = written_pictures()
get_ipython().events.register("post_run_cell", show_new_pictures)
"""

CONFIGURATION = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    # The page of a class or a function shows the scripts that use it.
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("skfem_textile",),
    "filename_pattern": r"\.py$",
    "ignore_pattern": "half_size",
    "subsection_order": [f"../examples/{folder}" for folder in _SCRIPTS],
    # By name, so that Sphinx can compare these with the last build.
    "within_subsection_order": "gallery_build.Order",
    "image_scrapers": ("gallery_build.written_pictures",),
    "reset_modules": ("matplotlib", "gallery_build.warnings_are_errors"),
    "reset_modules_order": "both",
    "reset_argv": "gallery_build.script_knows_its_file",
    "thumbnail_size": (400, 280),
    "capture_repr": (),
    "remove_config_comments": True,
    "first_notebook_cell": SHOW_PICTURES,
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
}
