"""Processes, and files of sweeps, for tests."""

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from zlib import crc32

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
    """Cases and results on file; every line ends with the checksum of its content."""
    entries = []
    for line in out.read_bytes().splitlines():
        entry = json.loads(line)
        checksum = f"{crc32(line[:-10]):08x}"
        assert entry.pop("checksum") == checksum
        assert line[-10:] == f'{checksum}"}}'.encode()
        entries.append(entry)
    return entries
