"""Menus, titles and tables of the documentation are short."""

import re
from argparse import SUPPRESS
from importlib.util import module_from_spec, spec_from_file_location
from itertools import permutations
from pathlib import Path

import pytest

from skfem_textile.cases.write import reference

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
NAMES = [str(page.relative_to(DOCS)) for page in PAGES]

SECTIONS = ["tutorial", "how-to", "gallery", "theory", "benchmarks", "reference"]
MOST_ENTRIES = 9
MOST_ROWS = 30

#: Pages that the front page links to: a code host shows directives as code.
FRONT = [
    ROOT / name
    for name in re.findall(r"\]\(([\w/-]+\.md)", (ROOT / "README.md").read_text())
]

#: Words that do not distinguish titles.
COMMON = {*("a", "an", "and", "as", "at", "between", "by", "for", "from", "in", "of")}
COMMON |= {"on", "or", "own", "the", "to", "with"}


def loaded(name):
    """A module of the folder of the documentation."""
    spec = spec_from_file_location(name, DOCS / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TABLES = loaded("generated_tables")
DATA = loaded("data_links")
PLAIN = loaded("plain_markdown")


def menu(page):
    """The entries of the menu of a page, as paths below the folder of the pages."""
    lines = PLAIN.MENUS.get(str(page.relative_to(DOCS).with_suffix("")), [])
    entries = [re.sub(r".*<(.*)>", r"\1", line) for line in lines]
    return [str((page.parent / entry).resolve().relative_to(DOCS)) for entry in entries]


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda x: x.stem)
def test_comments_are_whole_lines(page):
    assert re.findall(r"^.*\S.*<!--.*$|^.*-->.*\S.*$", page.read_text(), re.M) == []


@pytest.mark.parametrize("page", FRONT, ids=lambda x: f"{x.parent.name}/{x.stem}")
def test_linked_pages_read_as_they_are(page):
    """They contain neither directives nor roles."""
    found = re.findall(r"^```\{.*|\{[a-z:]+\}`|^:::.*", page.read_text(), re.M)
    assert found == []


def test_sphinx_shows_tables_built_pages_and_menus():
    text = "[Table: a](../x/a.md)\n\n[gallery](../examples)\n"
    shown = PLAIN.for_sphinx(text, "how-to/files")
    assert "```{include} ../x/a.md\n```\n" in shown
    assert "[gallery](gallery/index.rst)" in shown
    assert shown.endswith("```{toctree}\n:hidden:\n\ncase-files\ndecks\n```\n")


def title(page):
    return re.search(r"^# (.+)$", page.read_text(), re.M)[1]


def in_menus():
    """The entries of all menus."""
    return [entry for page in PAGES for entry in menu(page)]


def included():
    """Files that pages include."""
    for page in PAGES:
        for name in PLAIN.TABLE.findall(page.read_text()):
            yield (page.parent / name).resolve()


def test_the_menu_begins_with_the_sections():
    sections = [f"{section}/index" for section in SECTIONS]
    sections.insert(sections.index("benchmarks/index"), "validation")
    assert menu(DOCS / "index.md") == ["self", *sections]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_menus_are_short(page):
    assert len(menu(page)) <= MOST_ENTRIES


def test_every_page_is_in_one_menu():
    pages = {str(page.relative_to(DOCS).with_suffix("")) for page in PAGES}
    inner = {str(file.relative_to(DOCS).with_suffix("")) for file in included()}
    entries = in_menus()
    assert len(set(entries)) == len(entries)
    assert {*entries, "index"} - {"self", "gallery/index"} == pages - inner


def words_of(text):
    """The words that distinguish a title, in the singular."""
    words = set(re.findall(r"[\w-]+", text.lower())) - COMMON
    return {re.sub("e?s$", "", word) for word in words}


def test_titles_do_not_compete():
    """No title has all the words of another one, except on a page below it."""
    pages = [DOCS / f"{entry}.md" for entry in in_menus()]
    titles = {page: title(page) for page in pages if page.is_file()}
    for head in (ROOT / "examples").glob("*/GALLERY_HEADER.rst"):
        titles[head] = head.read_text().split("\n", 1)[0]
    for script in (ROOT / "examples").rglob("*.py"):
        if script.stem not in ("half_size", "inputs"):
            titles[script] = script.read_text().split("\n", 2)[1]
    words = {page: words_of(text) for page, text in titles.items()}
    below = {
        page: {DOCS / f"{entry}.md" for entry in menu(page)}
        for page in titles
        if page.suffix == ".md"
    }
    assert [
        (titles[page], titles[other])
        for page, other in permutations(titles, 2)
        if words[page] <= words[other] and other not in below.get(page, ())
    ] == []


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_tables_have_at_most_thirty_rows(page):
    """Longer ones are files beside the page, and their summary is on it."""
    text = TABLES.filled(page.read_text())
    tables = re.findall(r"^(?:\|.*\n?)+", text, re.M)
    head = 2
    assert [t.count("\n") for t in tables if t.count("\n") > MOST_ROWS + head] == []


def groups(command=""):
    """Each group of options of the command and of its subcommands."""
    parser = TABLES.parser_of(command)
    inner = TABLES.commands_of(parser)
    for name in inner:
        yield from groups(f"{command} {name}".strip())
    for group in parser._action_groups if command and not inner else ():
        if any(action.help != SUPPRESS for action in group._group_actions):
            yield command, group.title


def _as_run(command, group):
    """A sweep has the options of a run, except for those in its table."""
    if not command.startswith("sweep"):
        return command, group
    if group == "options":
        return "sweep specimen", group
    shared = group == "mesh, laws, elements and load steps"
    return "run specimen" if shared else command.replace("sweep", "run"), group


def test_every_group_of_options_has_a_table():
    """All scenes share two groups, which one table describes."""
    pages = (DOCS / "reference" / "command-line").glob("*.md")
    text = "".join(page.read_text() for page in pages)
    shared = "options", "mesh, laws, elements and load steps"
    wanted = {
        ("run specimen", group)
        if command.startswith("run") and group in shared
        else _as_run(command, group)
        for command, group in groups()
    }
    present = set(re.findall(r"^OPTIONS-OF (.*): (.*)$", text, re.M))
    assert wanted <= present


def test_every_key_of_a_case_is_in_a_table():
    text = (DOCS / "reference" / "case-keys.md").read_text()
    present = re.findall(r"^KEYS-OF ([^:\n]*)(?:: (.*))?$", text, re.M)
    listed = {(table, name) for table, names in present for name in names.split()}
    entries = [(own.table, own.choice) for own in reference()]
    assert {table for table, _ in entries} == {table for table, _ in present}
    divided = {table for table, _ in listed}
    assert {own for own in entries if own[0] in divided and own[1]} == listed
    assert "scene" in divided


def test_all_data_of_the_studies_can_be_downloaded():
    linked = {
        (page.parent / name).resolve()
        for page in PAGES
        for name in DATA.LINKED.findall(DATA.with_data(page.read_text(), page))
    }
    files = {
        file
        for folder in DOCS.glob("*/provenance.json")
        for kind in ("*.csv", "*.json")
        for file in folder.parent.glob(kind)
    }
    assert len(files) > 40
    assert [f for f in files - linked if f.name != "provenance.json"] == []
