"""Everything public is on the page of the API or that of the internals."""

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import skfem_textile

pytest.importorskip("matplotlib")  # pages name what draws
pytest.importorskip("pyvista")

DOCS = Path(__file__).parents[2] / "docs"

DIRECTIVE = re.compile(r"^\.\. automodule:: (\S+)\n((?:   :.*\n)*)", re.MULTILINE)

PACKAGES = ["", ".calibration", ".drape", ".forms", ".io", ".plot", ".scenes"]


def documented():
    """The name and object of each entry of both pages."""
    for page in ("api.md", "internals.md"):
        text = (DOCS / page).read_text(encoding="utf-8")
        for name, options in DIRECTIVE.findall(text):
            module = import_module(name)
            named = re.search(r":members:(.*)", options)
            for member in members(module, named[1]) if named else []:
                assert hasattr(module, member), f"{page}: {name} has no {member}"
                yield member, getattr(module, member)


def members(module, named):
    """The members that a directive names; all that its module defines if it is bare."""
    if named.strip():
        return [name.strip() for name in named.split(",")]
    own = vars(module).items()
    return [n for n, x in own if getattr(x, "__module__", None) == module.__name__]


def forms_of(x):
    """It, and what it is with a kernel where it is that."""
    return x, getattr(x, "__wrapped__", x)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_documented(package):
    package = import_module(f"skfem_textile{package}")
    entries = list(documented())
    public = {name: getattr(package, name) for name in package.__all__}
    missing = [
        name
        for name, x in public.items()
        if not isinstance(x, ModuleType)
        and not any(name == entry and thing in forms_of(x) for entry, thing in entries)
    ]
    assert missing == []


def test_a_star_brings_the_packages_of_draping_and_forms_too():
    assert {"drape", "forms"} <= set(skfem_textile.__all__)
