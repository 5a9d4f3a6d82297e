"""Animations: a field on the moving ply, as a GIF or as a video by ffmpeg."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from ..solve.result import Result
from .drawing import pyvista_drawing
from .fields import (
    Field,
    fibres_of,
    field_of,
    refuse_other_than_result,
    scale_of,
    shapes_of,
    values_of,
)
from .layout import PRINTED, lay_out
from .picture_files import atomic_file, picture_path
from .pictures import stage_of
from .sheet import THREADS, Legend, Panel, Sheet, extent

# Dots per inch of a GIF, as on a screen; videos, which are enlarged, have more.
_DOTS = 150

# Longest duration of a frame, of the motion, and of the last frame in addition, in ms.
# Chosen by eye.
_FRAME, _MOTION, _REST = 120, 4000, 1000

# Formats of videos: arguments of ffmpeg for the codec and its quality.  Constant
# quality, chosen by eye: lines of fibres are sharp.
_CODECS = {
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "34", "-b:v", "0", "-cpu-used", "2"),
    ".mp4": ("-c:v", "libx264", "-crf", "23", "-movflags", "+faststart"),
}


def animation(
    result: Result,
    filename: str | os.PathLike[str],
    field: str | Field = "shear_angle",
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    fibres: bool = False,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> None:
    """Write a field on the moving ply, one frame per state on one scale.

    Tools between which a ply is formed are drawn, those in front of it translucent.

    Parameters
    ----------
    result
        Result whose states are drawn.
    filename
        Output file: GIF with 6 pixels per mm, or a video (.webm or .mp4) with 12, which
        requires the program ffmpeg.

    Other parameters and exceptions as for `field`; `FileNotFoundError` also if ffmpeg
    is not installed, and `RuntimeError` if it fails.
    """
    refuse_other_than_result("animation", result)
    path = picture_path(filename, (".gif", *_CODECS))
    suffix = path.suffix.lower() or ".gif"
    if suffix in _CODECS and shutil.which("ffmpeg") is None:
        raise FileNotFoundError(
            f"{path}: videos are written by ffmpeg, which is not installed: install "
            "it, or write a .gif file"
        )
    sheets = _sheets(result, field_of(field), cmap, clim, fibres, show_edges)
    frames = _drawn(sheets, size, PRINTED if suffix in _CODECS else _DOTS)
    duration = min(_FRAME, _MOTION // len(frames))
    with atomic_file(path, suffix) as file:
        if suffix in _CODECS:
            _write_video(file, frames, duration)
        else:
            _write_gif(file, frames, duration)


def _sheets(
    result: Result,
    field: Field,
    cmap: Any,
    clim: Sequence[float] | None,
    fibres: bool,
    show_edges: bool | None,
) -> list[Sheet]:
    """Content of the frames."""
    states = result.states
    shapes = shapes_of([result] * len(states), states, veiled=True)
    values = [values_of(field, result.ply, state.u) for state in states]
    scale = scale_of(field, values, cmap, clim)
    of_ply = fibres_of(result.ply) if fibres else None
    legend = Legend(0, 1, scale, THREADS if fibres else ())
    reach = extent(shapes)
    return [
        Sheet(
            [[Panel(stage_of(result, state), shape, each, scale, of_ply)]],
            *([legend], reach, show_edges),
        )
        for state, shape, each in zip(states, shapes, values, strict=True)
    ]


def _drawn(
    sheets: Sequence[Sheet], size: float | tuple[float, float] | None, dots: float
) -> list[ndarray]:
    """Pixels of each sheet, of shape (height, width, 3), drawn in one window."""
    layouts = [lay_out(sheet, size) for sheet in sheets]
    renderer, frames = pyvista_drawing(), []
    plotter = renderer.new_plotter(layouts[0], dots)
    for sheet, layout in zip(sheets, layouts, strict=True):
        plotter.clear()
        renderer.draw_new(plotter, sheet, layout)
        frames.append(plotter.screenshot(return_img=True))
    plotter.close()
    return frames


def _write_gif(file: Path, frames: Sequence[ndarray], duration: int) -> None:
    from PIL import Image

    first, *others = [
        Image.fromarray(frame).quantize(dither=Image.Dither.NONE) for frame in frames
    ]
    durations = [duration] * len(others) + [duration + _REST]
    first.save(file, save_all=True, append_images=others, duration=durations, loop=0)


def _write_video(file: Path, frames: Sequence[ndarray], duration: int) -> None:
    """Pass the frames to ffmpeg, cut to an even number of pixels, as codecs require."""
    height, width = (n - n % 2 for n in frames[0].shape[:2])
    raw = "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"
    rate = "-r", f"1000/{duration}"
    exact = "-fflags", "+bitexact", "-flags:v", "+bitexact"
    codec = *_CODECS[file.suffix], "-pix_fmt", "yuv420p", *exact
    rest = [frames[-1]] * (_REST // duration)
    pixels = b"".join(
        np.ascontiguousarray(frame[:height, :width]).tobytes()
        for frame in [*frames, *rest]
    )
    done = subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-y", *raw, *rate, "-i", "-", *codec, file],
        input=pixels,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        reason = done.stderr.decode(errors="replace").strip().splitlines() or ["?"]
        raise RuntimeError(f"{file.name}: ffmpeg failed: {reason[-1]}")
