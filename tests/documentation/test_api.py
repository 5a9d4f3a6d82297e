"""Every public name is listed on the API page or on the page of the internals."""

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import skfem_textile

pytest.importorskip("matplotlib")  # pages name functions for drawing
pytest.importorskip("pyvista")

DOCS = Path(__file__).parents[2] / "docs"

DIRECTIVE = re.compile(r"^\.\. automodule:: (\S+)\n((?:   :.*\n)*)", re.MULTILINE)

PACKAGES = [
    *("", ".calibration", ".drape", ".forming", ".forms", ".io", ".plot", ".scenes")
]


def documented_names():
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
    """The members that a directive names, or all that its module defines."""
    if named.strip():
        return [name.strip() for name in named.split(",")]
    entries = vars(module).items()
    return [n for n, x in entries if getattr(x, "__module__", None) == module.__name__]


def forms_of(x):
    """The class itself and its counterpart with a kernel, if any."""
    return x, getattr(x, "__wrapped__", x)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_documented(package):
    package = import_module(f"skfem_textile{package}")
    entries = list(documented_names())
    public = {name: getattr(package, name) for name in package.__all__}
    missing = [
        name
        for name, x in public.items()
        if not isinstance(x, ModuleType)
        and not any(name == entry and value in forms_of(x) for entry, value in entries)
    ]
    assert missing == []


def test_a_star_import_includes_drape_and_forms():
    assert {"drape", "forms"} <= set(skfem_textile.__all__)
