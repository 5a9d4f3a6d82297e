"""Links of the documentation resolve, and its lists are complete."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

import skfem_textile
from skfem_textile import Fabric, Force, LoadStepper, Ply, Polynomial, io, write_law
from skfem_textile.cli import results
from skfem_textile.cli.curve import CURVE
from skfem_textile.cli.main import command_parser
from skfem_textile.io.results import cell_fields, point_fields
from skfem_textile.scenes import bias_extension

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted(DOCS.rglob("*.md")),
]
RESULTS = (DOCS / "reference" / "results.md").read_text()

#: A block between fences, and the text after the first.
FENCED = re.compile(r"^```(.*)\n(?:.*\n)*?```$", re.M)

#: Every external address that a page links to.
EXTERNAL = {
    "https://gmsh.info",
    "https://github.com/bertoldi-collab/aerodynamic-textile-metamaterials",
    "https://github.com/chrkrogh/Export-Draped-Pattern-from-Abaqus-Composites-Modeler",
    "https://doi.org/10.1016/j.compositesa.2008.02.016",
    "https://github.com/guzmalalo/bias_test",
    "https://github.com/nschloe/meshio",
    "https://keepachangelog.com/en/1.1.0/",
    "https://scikit-fem.readthedocs.io",
}


def prose(page):
    """The text of a page without its code; directives, such as images, remain."""
    return FENCED.sub(lambda m: m[0] if m[1].startswith("{") else "", page.read_text())


def links(page):
    """Targets of links, tables, images and downloads."""
    text = re.sub(r"(?<!\})`[^`\n]*`", "", prose(page))
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    return targets + re.findall(r'^<img src="([^"]+)"', text, re.M)


def anchors(page):
    """Names of the headings of a page, as Sphinx and GitHub make them."""
    titles = re.findall(r"^#{1,3} (.+)$", prose(page), re.M)
    return {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_have_existing_targets(page):
    lost = []
    for target in links(page):
        if target.startswith("http"):
            continue
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            lost.append(target)
    assert lost == []


def test_external_addresses_are_listed():
    urls = {link for page in PAGES for link in links(page) if link.startswith("http")}
    assert urls == EXTERNAL


def test_no_line_of_a_page_is_a_comment():
    """A line that begins with % is not shown."""
    lines = [line for page in PAGES for line in page.read_text().splitlines()]
    assert [line for line in lines if line.lstrip().startswith("%")] == []


def test_included_files_are_not_separate_pages():
    """They are in the folder of a study, which Sphinx excludes."""
    for page in DOCS.rglob("*.md"):
        for name in re.findall(r"^\[Table: .*\]\((\S+)\)$", page.read_text(), re.M):
            file = (page.parent / name).resolve().relative_to(DOCS)
            assert (DOCS / file.parts[0] / "provenance.json").is_file()


def test_the_version_to_cite_is_the_version_of_the_package():
    assert (
        f"{{{skfem_textile.__version__}}}"
        in (DOCS / "reference" / "cite.md").read_text()
    )


def commands():
    """Every line of the command line that a page shows in a block."""
    for page in PAGES:
        for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.M | re.S):
            for line in block.splitlines():
                words = shlex.split(line, comments=True)
                if words[:1] == ["skfem-textile"]:
                    yield " ".join(words), words[1:]


def test_the_command_line_accepts_every_option_on_the_pages(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(DOCS / "tutorial" / "shear.csv", ".")
    Path("tension.csv").write_text("fibre strain (-),tension (N/mm)\n0,0\n0.01,70\n")
    Path("shear").mkdir()
    for name in ("shear/law.json", "sine.json", "ln.json"):
        write_law(Polynomial((1.0,), odd=True), name)
    lines = dict(commands())
    assert len(lines) > 30
    for words in lines.values():
        assert command_parser(words).parse_args(words).command == words[0]


@pytest.fixture(scope="module")
def run():
    """A scene with a load, and the result of a run of it."""
    scene = bias_extension(size=(2, 4))
    fabric = Fabric(1e5, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, terms=[Force("right", (0.0, 1e-3), name="NAME")])
    return scene, LoadStepper(ply, scene.conditions, steps=2).run()


def described(name):
    """True if the page on results contains a name as code."""
    return f"`{name}`" in RESULTS


def test_every_key_of_a_summary_is_described(run):
    scene, result = run
    keys = [*scene.summary(result), "inputs", "versions"]
    keys += ["tolerance", "tolerance_met", "rounds"]
    assert [key for key in keys if not described(key)] == []


def test_every_column_of_a_history_is_described(run):
    scene, result = run
    shares = re.compile("_share_of_.*")
    columns = {
        shares.sub("_share_of_...", re.sub("_[xyz]$", "_x", column))
        for column in result.history()[-1]
    }
    names = "|".join(scene.conditions)
    columns = {re.sub(f"^({names})_", "NAME_", column) for column in columns}
    assert [column for column in sorted(columns) if not described(column)] == []


def test_every_field_and_file_is_described(run):
    _, result = run
    names = [*cell_fields(result.ply, result.u), *point_fields(result.ply, result.u)]
    names += ["summary.json", "history.csv", CURVE, *io.DRAPED]
    names += [*results.PICTURES, *results.CURVES]
    assert [name for name in names if not described(name)] == []
