"""Processes, and files of sweeps, for tests."""

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from zlib import crc32

#: Lines that no sweep writes, and starts of lines that receive a valid checksum.
FOREIGN = (
    *(b"", b" ", b"\r", b"[]", b"{}", b"null", b"a note of mine", b"\x00" * 40),
    *(b'{"case": "0", "found": 1}', b'{"case": "0", "found": 1, "checksum": "0"}'),
    *(b"load,N", b"\xff\xfe\xfa", b'"' * 30, b"x" * 100_000),
)
FORGED = (
    *(b"", b"[", b"{", b"null", b'{"case": ', b'{"case": "0"', b'{"found": 1'),
    *(b'{"case": 1, "found": 1', b'{"case": ["0"], "found": 1', b"\xff\xff"),
    *(b'{"case": null, "found": 1', b'{"case": "0", "more": 1, "found": 1'),
    *(b'{"case": "0", "found": ' + b"[" * 50_000, b'{"case": {}, "found": 2'),
)


def with_checksum(start):
    """The start of a line, case and result, with its checksum and its end."""
    start += b', "checksum": "'
    return start + f'{crc32(start):08x}"}}\n'.encode()


def is_alive(pid):
    try:
        return "zombie" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def process_pool(n):
    return ProcessPoolExecutor(n, multiprocessing.get_context("spawn"))


def lines(out):
    """Cases and results on file; every line ends with the checksum of its content."""
    entries = []
    for line in out.read_bytes().splitlines():
        entry = json.loads(line)
        checksum = f"{crc32(line[:-10]):08x}"
        assert entry.pop("checksum") == checksum
        assert line[-10:] == f'{checksum}"}}'.encode()
        entries.append(entry)
    return entries
