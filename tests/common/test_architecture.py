"""The page on the architecture names what there is."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text()
CODE = "".join(
    file.read_text()
    for folder in ("skfem_textile", "studies", "tests")
    for file in (ROOT / folder).rglob("*.py")
)

PLACES = sorted(set(re.findall(r"`((?:[a-z_]+/)+(?:[a-z_]+\.py)?)`", PAGE)))
NAMES = sorted(set(re.findall(r"`(?:[A-Z]\w+\.)?(_?[A-Za-z]\w{3,})`", PAGE)))


@pytest.mark.parametrize("place", PLACES)
def test_files_and_folders_exist(place):
    assert any((ROOT / base / place).exists() for base in ("", "skfem_textile"))


@pytest.mark.parametrize("name", NAMES)
def test_names_are_in_the_code(name):
    assert re.search(rf"\b{name}\b", CODE)
