"""Bytes of the arrays of VTK's XML: as they are or in base64, plain or packed."""

import base64
import binascii
import lzma
import zlib
from typing import Any

import numpy as np

from ..mesh.checks import MeshError

#: What unpacks data, by VTK's name of it.
UNPACKERS: dict[str | None, Any] = {
    None: None,
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}


class Raw:
    """Bytes as they are."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def peek(self, count: int) -> bytes:
        """The next bytes, which stay the next ones."""
        if not 0 <= count <= len(self._content) - self._at:
            raise MeshError("it is cut off")
        return self._content[self._at : self._at + count]

    def take(self, count: int) -> bytes:
        """The next bytes."""
        taken = self.peek(count)
        self._at += count
        return taken

    def ends_after(self, count: int) -> bool:
        """Whether these bytes are encoded apart from those that follow."""
        return False


class Base64(Raw):
    """Bytes in base64, in runs of which each ends with a whole group of characters."""

    @staticmethod
    def _length(count: int) -> int:
        return -(-count // 3) * 4

    def peek(self, count: int) -> bytes:
        """The next bytes of a run."""
        try:
            chars = super().peek(self._length(count))
            return base64.b64decode(chars, validate=True)[:count]
        except binascii.Error:
            raise MeshError("it is not in base64") from None

    def take(self, count: int) -> bytes:
        """The next run, of so many bytes."""
        taken = self.peek(count)
        self._at += self._length(count)
        padding = self._content[: self._at][-2:].count(b"=")
        if len(taken) != count or padding != -count % 3:
            raise MeshError("it is not in base64")
        return taken

    def ends_after(self, count: int) -> bool:
        """Whether a run of so many bytes ends there."""
        end = b"=" * (-count % 3)
        return bool(end) and super().peek(self._length(count)).endswith(end)

    def end(self) -> None:
        """Refuse that there is more."""
        if self._at < len(self._content):
            raise MeshError("it is longer than it says")


def plain(data: Raw, header: np.dtype) -> bytes:
    """Bytes that follow their number."""
    (count,) = np.frombuffer(data.peek(header.itemsize), header).tolist()
    if data.ends_after(header.itemsize):
        data.take(header.itemsize)
        return data.take(count)
    return data.take(header.itemsize + count)[header.itemsize :]


def unpacked(data: Raw, header: np.dtype, unpacker: Any, due: int) -> bytes:
    """Bytes that are packed in blocks, as many as are due.

    The number of blocks, the size of one and of the last, and their sizes when packed
    stand before them.
    """
    (n,) = np.frombuffer(data.peek(header.itemsize), header).tolist()
    sizes = np.frombuffer(data.take((3 + n) * header.itemsize), header).tolist()[1:]
    full, last, *packed = sizes
    held = [full] * (n - 1) + [last or full] if n else []
    if sum(held) != due:
        raise MeshError(f"it holds {sum(held)} bytes, and {due} are due")
    rest, at, blocks = data.take(sum(packed)), 0, []
    for size, length in zip(packed, held, strict=True):
        one = unpacker()
        try:
            blocks.append(one.decompress(rest[at : at + size], max_length=length + 1))
        except (zlib.error, lzma.LZMAError):
            raise MeshError("it cannot be unpacked") from None
        if len(blocks[-1]) != length or not one.eof or one.unused_data:
            raise MeshError("a block is not as long as it says")
        at += size
    return b"".join(blocks)
