#!/usr/bin/env python3
"""Check the words of pages, docstrings, comments and messages of all tracked files.

Prints each finding with file and line, and what to write instead.  Code, quotations
and strings of tests and of this program, which are data, are not checked.
"""

import ast
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

from markdown_it import MarkdownIt

# Advice, pattern, and a sentence in which the pattern is found.
RULES = [
    (
        "evaluates / accounts for (a law does not see)",
        r"\b(law|laws|point|element|elements|term|estimate|stabilisation|check)s?\s+"
        r"(of\s+(tension|shear)\s+)?(sees?|knows?|asks?|meets?|feels?)\b",
        "Most of these points no law sees.",
    ),
    (
        "is given / receives",
        r"\b(is|are|was|were|has|have)\s+(told|asked|handed)\b",
        "The load stepper is told of each iteration.",
    ),
    (
        "predicts / gives (a mesh does not read a load)",
        r"\b(quadrilaterals|triangles|elements?|formulation|macro-elements|points?)\s+"
        r"(that\s+are\s+split\s+)?reads?\b",
        "Four triangles read the load too low.",
    ),
    ("except for", r"\bbut\s+for\b", "Right but for the finest meshes."),
    (
        "overestimates/underestimates by",
        r"\boff\s+by\b",
        "The load is off by two per cent.",
    ),
    (
        "the value in/for ...",
        r"\b(that|those)\s+of\b",
        "The stiffness is that of the ply at rest.",
    ),
    (
        "virtually",
        r"\bas\s+good\s+as\b",
        "The fibres are as good as inextensible.",
    ),
    ("on average", r"\bin\s+the\s+mean\b", "The strain in the mean over the element."),
    ("is also accepted", r"\bdoes\s+as\s+well\b", "A number does as well."),
    (
        "current / intermediate",
        r"\b(of\s+now|on\s+the\s+way)\b",
        "The stiffness of now is held.",
    ),
    (
        "user-defined / custom",
        r"\bof\s+(one's|its|their|your)\s+own\b",
        "A formulation of your own.",
    ),
    (
        "is not a / is not an",
        r"(?<!\bThere\s)(?<!\bthere\s)\b(is|are|was)\s+(no|none\s+of)\b",
        "The file is no mesh.",
    ),
    (
        "reports / lists / contains / describes",
        r"\b(page|table|column|line|summary|log|message|result|report|key|file)s?\s+"
        r"(tells?|has|have|says?|knows?)\b",
        "The summary tells the error.",
    ),
    (
        "the term itself (a docstring or heading that opens with a question word)",
        r"^(What|Whether|How)\b(?![\s\S]*\?)",
        "What is asked of an equilibrium before it counts",
    ),
]


_DEFINITIONS = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)

# A message is a text with a space between words.
_WORDS = re.compile(r"[a-zA-Z]{2,},? [a-zA-Z]{2,}")


def prose(source: str, with_messages: bool) -> str:
    """The prose of a module, each line at the line of the source.

    A message is on its first line, with … for each value.
    """
    lines = [""] * (source.count("\n") + 1)
    tree, taken = ast.parse(source), set()
    for node in ast.walk(tree):
        if isinstance(node, _DEFINITIONS) and ast.get_docstring(node) is not None:
            text = node.body[0].value
            taken.add(id(text))
            for number, line in _without_examples(text):
                lines[number - 1] = line
    for number, message in _messages(tree, taken) if with_messages else ():
        lines[number - 1] = f"{lines[number - 1]} {message}".strip()
    with_comments = tokenize.generate_tokens(iter(source.splitlines(True)).__next__)
    for token in with_comments:
        if token.type == tokenize.COMMENT and not re.match(
            "# (noqa|type:)|#!", token.string
        ):
            number = token.start[0]
            comment = token.string.lstrip("#: ")
            lines[number - 1] = f"{lines[number - 1]} {comment}".strip()
    return "\n".join(lines)


def _without_examples(text: ast.Constant) -> Iterator[tuple[int, str]]:
    """The lines of a docstring except for code, without indentation."""
    of_code = False
    for number, line in enumerate(text.value.splitlines(), text.lineno):
        of_code = bool(line.strip()) and (of_code or line.lstrip().startswith(">>>"))
        if not of_code:
            yield number, line.strip()


def _messages(tree: ast.AST, taken: set[int]) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            taken.update(map(id, node.values))
            parts = (
                p.value if isinstance(p, ast.Constant) else "…" for p in node.values
            )
            text = "".join(parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = "" if id(node) in taken else node.value
        else:
            continue
        text = " ".join(re.sub(r"%[sdgf]|\{.*?\}", "…", text).split())
        if _WORDS.search(text):
            yield node.lineno, text.replace("`", "")


def texts(page: str) -> Iterator[tuple[int, str]]:
    """Paragraphs, headings and cells of a Markdown page, each with its first line."""
    for block in MarkdownIt().enable("table").parse(page):
        words = [
            "\n" if part.type == "softbreak" else part.content
            for part in block.children or []
            if part.type in ("text", "softbreak")
        ]
        if words:
            yield block.map[0] + 1, "".join(words)


def findings(page: str) -> Iterator[tuple[int, str, str]]:
    """Line, words, and what to write instead."""
    for first, text in texts(page):
        for instead, pattern, _ in RULES:
            for found in re.finditer(pattern, text, re.MULTILINE):
                line = first + text.count("\n", 0, found.start())
                yield line, found.group(), instead


def main() -> int:
    """Print the findings in all tracked files; the number of them."""
    for instead, _, sentence in RULES:
        assert instead in [x for *_, x in findings(sentence)], f"not found: {sentence}"
    listed = ["git", "ls-files", "-z", "*.md", "*.py"]
    names = subprocess.run(listed, check=True, capture_output=True, text=True).stdout
    count = 0
    for name in names.split("\0")[:-1]:
        page = Path(name).read_text(encoding="utf-8")
        if name.endswith(".py"):
            page = prose(page, with_messages=not name.startswith(("tests/", ".ci/")))
        for line, words, instead in findings(page):
            count += 1
            print(f"{name}:{line}: {' '.join(words.split())} => {instead}")
    return count


if __name__ == "__main__":
    sys.exit(bool(main()))
