"""Version and requirements agree in all files."""

import tomllib
from pathlib import Path

import pytest

import skfem_textile

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())


def test_version_is_the_same_everywhere():
    """The build takes it from the package; the other files state it."""
    stated = {RECIPE["context"]["version"], CITATION["version"]}
    assert stated == {skfem_textile.__version__}


def test_recipe_requires_what_the_project_requires():
    """The packages for Python and for the command line."""
    extras = PROJECT["optional-dependencies"]
    needed = *PROJECT["dependencies"], *extras["cli"], *extras["outlines"]
    needed = [one.partition(";")[0] for one in needed if "skfem-textile" not in one]
    python, *packages = RECIPE["requirements"]["run"]
    assert [package.replace(" ", "") for package in packages] == sorted(needed)
    assert python == "python >=${{ python_min }}"
    assert f">={RECIPE['context']['python_min']}" == PROJECT["requires-python"]


def test_recipe_installs_the_project_command():
    name, target = PROJECT["scripts"].popitem()
    assert RECIPE["build"]["python"]["entry_points"] == [f"{name} = {target}"]
