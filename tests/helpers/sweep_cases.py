"""Processes, and files of sweeps, for tests."""

import hashlib
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.sweep.calls import wait_until

__all__ = ["is_alive", "lines", "process_pool", "wait_until"]


def is_alive(pid):
    try:
        return "zombie" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def process_pool(n):
    return ProcessPoolExecutor(n, multiprocessing.get_context("spawn"))


def lines(out):
    """Cases and results on file; every line ends with the digest of its content."""
    entries = []
    for line in out.read_bytes().splitlines():
        entry = json.loads(line)
        digest = hashlib.sha256(line[:-18]).hexdigest()[:16]
        assert entry.pop("digest") == digest
        assert line[-18:] == f'{digest}"}}'.encode()
        entries.append(entry)
    return entries
