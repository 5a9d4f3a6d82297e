"""Write the docstrings, comments and messages of Python files as text, line by line.

    python prose.py FOLDER FILE_OR_FOLDER ...

Each file becomes FOLDER/PATH.md with the same number of lines, so that findings have
the line numbers of the source. A message is on its first line, with … for each value.
Strings of tests are data, such as invalid input, and are left out.
"""

import ast
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

_DEFINITIONS = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)

# A message is a text with a space between words.
_WORDS = re.compile(r"[a-zA-Z]{2,},? [a-zA-Z]{2,}")


def prose(source: str, with_messages: bool = True) -> list[str]:
    """The prose of a module, each line at the line of the source."""
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
    return lines


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


def main(folder: str, *given: str) -> None:
    """Write the prose of files, and of all files of folders."""
    for name in map(Path, given):
        for path in sorted(name.rglob("*.py")) if name.is_dir() else [name]:
            target = Path(folder) / f"{path}.md"
            target.parent.mkdir(parents=True, exist_ok=True)
            of_tests = path.parts[0] == "tests"
            target.write_text("\n".join(prose(path.read_text(), not of_tests)))


if __name__ == "__main__":
    main(*sys.argv[1:])
