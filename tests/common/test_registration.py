import sys

import pytest

from skfem_textile.fabric.laws import LAWS
from skfem_textile.ply.formulations import FORMULATIONS
from skfem_textile.registration import Registration, registered
from skfem_textile.scenes import SCENES
from skfem_textile.solve.linear import SOLVERS

ONE = """
from skfem_textile.registration import Registration
REGISTRATION = Registration(name={!r}, description="", build=dict, rank={})
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A new package; gives a function that adds a module to it."""
    folder = tmp_path / "registering"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    __import__("registering")

    def add(module, text):
        file = folder / f"{module}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)

    yield add
    for name in [name for name in sys.modules if name.startswith("registering")]:
        del sys.modules[name]


def test_modules_register_in_the_order_of_their_ranks(package):
    package("a", ONE.format("last", 2))
    package("b", ONE.format("first", 1))
    package("c", "REGISTRATION = 'of another kind'")
    package("d", "")
    assert list(registered("registering", Registration)) == ["first", "last"]


def test_modules_in_folders_register_too(package):
    package("a", ONE.format("one", 1))
    package("inner/__init__", "")
    package("inner/b", ONE.format("two", 0))
    assert list(registered("registering", Registration)) == ["two", "one"]


def test_a_name_is_registered_once(package):
    package("a", ONE.format("one", 0))
    package("b", ONE.format("one", 0))
    with pytest.raises(ValueError, match="registering: 'one' is registered twice"):
        registered("registering", Registration)


@pytest.mark.parametrize(
    ("among", "names"),
    [
        (
            SCENES,
            [
                *("strip", "picture_frame", "trellis", "bias_extension", "specimen"),
                *("cantilever", "buckling"),
                *("hemisphere", "cylinder", "double_dome", "saddle", "drape"),
            ],
        ),
        (
            LAWS,
            [
                *("linear", "sin2", "FILE.csv", "crimp-interchange", "crimp-toe"),
                *("locking", "polynomial", "FILE.json"),
            ],
        ),
        (FORMULATIONS, ["one-point", "macro", "full", "quadratic"]),
        (SOLVERS, ["cholmod", "pardiso", "superlu"]),
    ],
)
def test_what_the_package_registers_is_in_the_order_of_its_lists(among, names):
    assert list(among) == names
