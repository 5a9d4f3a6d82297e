"""Pages agree with the data of the studies, or the check fails."""

import pytest

from studies.common.tables import rows_of_csv, table
from studies.figures import pages, prose
from studies.study import Part, Study, descriptions, load

PAGE = """\
# Page

![A picture](a.png)

*A caption.*

<!--results squares-->

| largest |
|---|
| 9 mm |

<!--/results-->

The error is 9 mm with 5 % of noise.

```sh
sleep 3.2
```
"""
BLOCK = """\
| largest |
|---|
| {squares.largest} |
"""
SETTINGS = '"docs/page.md" = ["with 5 % of noise"]\n'


class Squares(Study):
    """A minimal study."""

    parts = (
        Part(
            "squares.csv",
            {
                "squares.md": lambda rows: table(
                    rows, {"n": "{number}", "n²": "{square}"}
                )
            },
        ),
    )
    sample = "2"

    def cases(self, options):
        return 2, 3

    def examine(self, case):
        return [{"number": case, "square": self.square(case), "seconds": 0.5}]

    def square(self, number):
        return float(number**2)

    def figures(self, rows):
        return {"largest": f"{max(row['square'] for row in rows):g} mm"}


@pytest.fixture
def docs(tmp_path, monkeypatch):
    """Documentation with one page and the results of one study."""
    folder = tmp_path / "docs" / "squares"
    folder.mkdir(parents=True)
    study = Squares()
    rows = [row for case in study.cases(None) for row in study.examine(case)]
    for name, text in study.tables(rows).items():
        (folder / name).write_text(text)
    (folder / "provenance.json").write_text('{"squares": []}')
    page, settings = tmp_path / "docs" / "page.md", tmp_path / "settings.toml"
    page.write_text(PAGE)
    (tmp_path / "squares.md").write_text(BLOCK)
    settings.write_text(SETTINGS)
    monkeypatch.setattr(pages, "load", lambda name: study)
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    monkeypatch.setattr(pages, "BLOCKS", tmp_path)
    monkeypatch.setattr(pages, "descriptions", lambda: {"squares": "Squares"})
    monkeypatch.setattr(pages, "PAGES", (page,))
    monkeypatch.setattr(prose, "CHECKED", (page,))
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    monkeypatch.setattr(prose, "SETTINGS", settings)
    return tmp_path / "docs"


def replaced(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_pages_that_agree_with_the_data_pass(docs, capsys):
    assert pages.main(check=True) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("file", "old", "new", "named"),
    [
        ("page.md", "| 9 mm", "| 8 mm", "docs/page.md differs from its data"),
        ("squares/squares.csv", "3,9.0", "3,9.5", "docs/page.md differs from its data"),
        ("squares/squares.md", "9.0", "9.1", "docs/squares/squares.md differs"),
        ("page.md", "is 9 mm", "is 8 mm", "the result '8 mm'"),
        ("page.md", "is 9 mm", "is 9 N", "the result '9 N'"),
        ("page.md", "noise", "noise in 3.2 s", "the result '3.2 s'"),
        ("page.md", "A caption", "Within 7 mm", "the result '7 mm'"),
        ("page.md", "A picture", "Within 7 mm", "the result '7 mm'"),
        ("page.md", "noise", "noise, 1/3.2 of it", "the result '1/3.2'"),
        ("page.md", "noise", "noise, 62 cases", "the result '62'"),
        ("page.md", "noise", "noise; 1415 are right", "the result '1415'"),
        ("page.md", "noise", "noise, error = 7.9 %", "the result '7.9 %'"),
        ("page.md", "noise", "noise in 8 linear solves", "the result '8'"),
        ("page.md", "5 %", "7 %", "'with 5 % of noise' is not in"),
        ("../squares.md", ".largest", ".least", "unknown result squares.least"),
        ("page.md", "results squares", "results lost", "No such file"),
    ],
)
def test_changes_of_pages_or_their_data_are_found(docs, capsys, file, old, new, named):
    replaced(docs / file, old, new)
    assert pages.main(check=True) == 1
    assert named in capsys.readouterr().err


def test_data_that_the_code_does_not_reproduce_are_detected(docs, monkeypatch, capsys):
    monkeypatch.setattr(Squares, "square", lambda self, number: 1.001 * number**2)
    assert pages.main(check=True) == 1
    stderr = capsys.readouterr().err
    assert "squares, 2: square is 4.004, not 4.0" in stderr


def test_results_without_their_origin_are_named(docs, capsys):
    (docs / "squares" / "provenance.json").unlink()
    assert pages.main(check=True) == 1
    assert (
        "docs/squares: the provenance of squares is missing" in capsys.readouterr().err
    )


def test_results_are_written_into_pages_and_tables(docs):
    replaced(docs / "squares" / "squares.csv", "3,9.0", "3,16.0")
    assert pages.main(check=False) == 0
    assert "| 16 mm |\n\n<!--/results-->" in (docs / "page.md").read_text()
    assert "| 3 | 16.0 |" in (docs / "squares" / "squares.md").read_text()
    rows = rows_of_csv((docs / "squares" / "squares.csv").read_text())
    assert rows[1]["square"] == 16.0  # data are never written


def test_every_page_with_tasks_or_results_is_checked():
    folders = {page.parent.name for page in prose.CHECKED}
    assert folders >= {"docs", "benchmarks", "how-to", "tutorial"}


def test_every_template_is_a_block_of_a_page():
    names = {
        block[1]
        for page in pages.PAGES
        for block in pages.BLOCK.findall(page.read_text())
    }
    assert names == {template.stem for template in pages.BLOCKS.iterdir()}


@pytest.mark.parametrize("name", descriptions())
def test_every_result_for_prose_stands_in_a_block(name):
    study = load(name)
    quoted = {
        entry
        for template in pages.BLOCKS.iterdir()
        for of, entry in pages.RESULT.findall(template.read_text())
        if of == name
    }
    folder = pages.ROOT / "docs" / (study.folder or name)
    assert {*study.figures(study.stored(folder))} == quoted
