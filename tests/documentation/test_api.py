"""Every public name has a page, which a page of names lists."""

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import skfem_textile

pytest.importorskip("matplotlib")  # pages name functions for drawing
pytest.importorskip("pyvista")

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
LISTS = (*sorted((REFERENCE / "api").glob("*.md")), REFERENCE / "internals.md")

#: A block of ``autosummary``, with its options and its names.
BLOCK = re.compile(r"^\.\. autosummary::\n(?:   :.*\n)*\n((?:   \S+\n)+)", re.MULTILINE)

PACKAGES = [
    *("", ".calibration", ".drape", ".contact", ".forms", ".io", ".plot", ".scenes")
]


def blocks(pages=LISTS):
    """The names of each table."""
    for page in pages:
        for names in BLOCK.findall(page.read_text(encoding="utf-8")):
            yield [f"skfem_textile.{name}" for name in names.split()]


LISTED = [name for names in blocks() for name in names]
INTERNAL = {name for names in blocks(LISTS[-1:]) for name in names}


def documented():
    """The name and the object of each entry."""
    for full in LISTED:
        module, _, name = full.rpartition(".")
        yield name, getattr(import_module(module), name)


def forms_of(x):
    """The class itself and its counterpart with a kernel, if any."""
    return x, getattr(x, "__wrapped__", x)


def same(x, other):
    """True for one object, also with and without its kernel."""
    return any(a is b for a in forms_of(x) for b in forms_of(other))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_documented(package):
    package = import_module(f"skfem_textile{package}")
    entries = list(documented())
    public = {name: getattr(package, name) for name in package.__all__}
    missing = [
        name
        for name, x in public.items()
        if not isinstance(x, ModuleType)
        and not any(name == entry and same(x, value) for entry, value in entries)
    ]
    assert missing == []


#: A module and its names on the page of public names.
MODULE = re.compile(r"^`(skfem_textile[\w.]*)`\n\n```text\n(.*?)```", re.M | re.S)

PAGE_OF_NAMES = (REFERENCE / "public-names.md").read_text(encoding="utf-8")
NAMED = {module: names.split() for module, names in MODULE.findall(PAGE_OF_NAMES)}


@pytest.mark.parametrize("package", [*PACKAGES, ".cases", ".fabric", ".outlines"])
def test_the_page_of_public_names_lists_those_of_each_package(package):
    package = f"skfem_textile{package}"
    assert NAMED[package] == sorted(import_module(package).__all__)


def test_the_page_of_public_names_lists_the_names_of_the_api():
    named = {f"{module}.{name}" for module, names in NAMED.items() for name in names}
    assert {name for name in LISTED if name not in INTERNAL} - named == set()
    for name in named:
        module, _, name = name.rpartition(".")
        assert hasattr(import_module(module), name)


def test_every_name_is_listed_once_in_a_table_of_at_most_thirty_rows():
    assert len(LISTED) > 300
    assert len(set(LISTED)) == len(LISTED)
    assert max(map(len, blocks())) <= 30


def test_a_star_import_includes_drape_and_forms():
    assert {"drape", "forms"} <= set(skfem_textile.__all__)
