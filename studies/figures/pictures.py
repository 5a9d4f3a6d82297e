"""Pictures of the documentation, stored with a palette of 256 colours."""

from pathlib import Path

from .pages import ROOT


def without_palette() -> list[Path]:
    """PNG files of the documentation in full colour, outside built folders."""
    from PIL import Image

    def has_palette(file: Path) -> bool:
        with Image.open(file) as picture:
            return picture.mode == "P"

    built = ROOT / "docs" / "_build", ROOT / "docs" / "gallery"
    files = sorted((ROOT / "docs").rglob("*.png"))
    own = [x for x in files if not any(x.is_relative_to(folder) for folder in built)]
    return [file for file in own if not has_palette(file)]


def reduce(file: Path) -> None:
    """Store a picture with a palette; its size and resolution remain."""
    from PIL import Image

    with Image.open(file) as picture:
        dots = picture.info.get("dpi", (300, 300))
        few = picture.convert("RGB").quantize(dither=Image.Dither.NONE)
    few.save(file, optimize=True, dpi=dots)
