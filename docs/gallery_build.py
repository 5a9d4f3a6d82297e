"""How the gallery is made of the scripts in ``examples`` by sphinx-gallery."""

import logging
import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst

# Sphinx logs all that is logged; what runs say of every step belongs on no page.
for name in ("skfem", "skfem_textile"):
    logging.getLogger(name).setLevel(logging.WARNING)

_PICTURES = {".png", ".gif"}

_FOLDERS = ("forms", "fabrics", "meshes", "loads", "runs")


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
    return figure_rst(shown, gallery_conf["src_dir"])


def script_knows_its_file(
    gallery_conf: dict[str, Any], script_vars: dict[str, Any]
) -> list[str]:
    """Define ``__file__``, beside which a script finds its data; no arguments."""
    script_vars["example_globals"]["__file__"] = script_vars["src_file"]
    return []


CONFIGURATION = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "ignore_pattern": "half_size",
    "subsection_order": [f"../examples/{folder}" for folder in _FOLDERS],
    "within_subsection_order": "FileNameSortKey",
    # By name, so that Sphinx can compare them with those of the last build.
    "image_scrapers": ("gallery_build.written_pictures",),
    "reset_argv": "gallery_build.script_knows_its_file",
    "thumbnail_size": (400, 280),
    "capture_repr": (),
    "notebook_extensions": set(),
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
}
