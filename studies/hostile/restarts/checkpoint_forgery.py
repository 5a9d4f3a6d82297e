"""Edits files of a checkpoint and computes their digests anew.

The format is described here independently of the library.
"""

import io
import json
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.random import Generator

#: Values that take the place of others.
_VALUES: tuple[Any, ...] = (
    *(0, -1, 1, 0.5, 1e308, 1e-300, float("nan"), float("inf"), 10**400),
    *(None, True, "auto", "", "two\nlines \x1b[31m", "long " * 2000, [], {}, [[]]),
    *(1 + 1e-7, [0.1, 0.2], {"a": 1}, -0.0),
)


def forged(rng: Generator, folder: Path) -> str:
    """Edit one to three things of a file; seal it anew, or all files after it too."""
    files = sorted(folder.glob("run.npz")) + sorted(folder.glob("state_*.npz"))
    number = int(rng.integers(len(files)))
    text, arrays = _read(files[number])
    edits = [_edit(rng, text, arrays) for _ in range(rng.choice([1, 1, 2, 3]))]
    body = _body(text, arrays)
    chain = bool(rng.random() < 0.7)
    _seal(files, number, body, chain=chain)
    whole = ", and all after it sealed" if chain else ""
    return f"{files[number].name}: {'; '.join(edits)}{whole}"


def _read(path: Path) -> tuple[Any, dict[str, ndarray]]:
    """Text and arrays of a file."""
    with np.load(io.BytesIO(path.read_bytes().rpartition(b"\n")[0])) as content:
        arrays = dict(content)
    return json.loads(str(arrays.pop("text"))), arrays


def _seal(files: list[Path], number: int, body: bytes, chain: bool) -> None:
    """Give a file another body and a new digest, or all after it too if chained."""
    for i in range(number, len(files) if chain else number + 1):
        old, _, old_seal = files[i].read_bytes().rpartition(b"\n")
        run, name, _ = old_seal.decode().split()
        before = files[i - 1].read_bytes()[-64:].decode() if i else ""
        content = body if i == number else old
        digest = sha256(f"{before} {run} {name} ".encode() + content).hexdigest()
        files[i].write_bytes(content + f"\n{run} {name} {digest}".encode())


def _body(text: Any, arrays: Mapping[str, ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, text=np.array(json.dumps(text)), **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def _edit(rng: Generator, text: Any, arrays: dict[str, ndarray]) -> str:
    if arrays and rng.random() < 0.3:
        return _edit_array(rng, arrays)
    return _edit_text(rng, text)


def _edit_text(rng: Generator, text: Any) -> str:
    """Change, remove or add one thing in a text of JSON."""
    places = _places(text)
    *path, key = places[rng.integers(len(places))]
    inside = text
    for step in path:
        inside = inside[step]
    where, kind = "/".join(map(str, [*path, key])), rng.random()
    if kind < 0.1:
        del inside[key]
        return f"{where} removed"
    if kind < 0.2 and isinstance(inside, dict):
        inside[f"{key} more"] = inside[key]
        return f"{where} doubled"
    old = inside[key]
    if isinstance(old, int | float) and not isinstance(old, bool) and kind < 0.6:
        factor = rng.choice([1 + 1e-6, 1.01, -1.0, 2.0, 1e-3, 1e3])
        inside[key] = old * factor if isinstance(old, float) else old + 1
    else:
        inside[key] = _VALUES[rng.integers(len(_VALUES))]
    return f"{where} from {str(old)[:20]} to {str(inside[key])[:20]!r}"


def _places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of keys to everything in a JSON value."""
    own = [path] if path else []
    if not isinstance(value, dict | list):
        return own
    items = value.items() if isinstance(value, dict) else enumerate(value)
    return own + [p for key, item in items for p in _places(item, (*path, key))]


def _edit_array(rng: Generator, arrays: dict[str, ndarray]) -> str:
    """Change one array, its shape or its kind."""
    name = str(rng.choice(list(arrays)))
    changes: dict[str, Callable[[ndarray], ndarray]] = {
        "moved": lambda x: x + rng.choice([1e-5, 1e-2, 1.0]) * (1 + np.abs(x).max()),
        "without an entry": lambda x: x.ravel()[:-1],
        "one axis more": lambda x: x[None],
        "complex": lambda x: x.astype(complex),
        "of single precision": lambda x: x.real.astype(np.float32),
        "of the other byte order": lambda x: x.astype(x.dtype.newbyteorder()),
        "of whole numbers": lambda x: np.rint(np.nan_to_num(x.real)).astype(int),
        "text": lambda x: x.astype(str),
        "not a number": lambda x: x * np.nan,
        "empty": lambda x: x.ravel()[:0],
        "with one entry changed": lambda x: _with_one_changed(rng, x),
    }
    change = str(rng.choice(list(changes)))
    if arrays[name].dtype.kind not in "fiuc" or rng.random() < 0.1:
        del arrays[name]
        return f"{name} removed"
    arrays[name] = changes[change](arrays[name])
    return f"{name} {change}"


def _with_one_changed(rng: Generator, x: ndarray) -> ndarray:
    changed = np.array(x)
    if changed.size:
        i = rng.integers(changed.size)
        changed.flat[i] = changed.flat[i] + rng.choice([1.0, -1.0, 1e-4])
    return changed
