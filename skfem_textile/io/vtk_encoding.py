"""Binary arrays in XML files of VTK: raw or in base64, compressed or not."""

import base64
import binascii
import lzma
import zlib
from typing import Any

import numpy as np

from ..mesh.checks import MeshError

#: Decompressors by VTK's name.
DECOMPRESSORS: dict[str | None, Any] = {
    None: None,
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}


class RawData:
    """Bytes that are not encoded."""

    def __init__(self, content: bytes) -> None:
        self._content, self._position = content, 0

    def peek(self, count: int) -> bytes:
        """The next bytes, without taking them."""
        if not 0 <= count <= len(self._content) - self._position:
            raise MeshError("it is cut off")
        return self._content[self._position : self._position + count]

    def take(self, count: int) -> bytes:
        """The next bytes."""
        taken = self.peek(count)
        self._position += count
        return taken

    def ends_after(self, count: int) -> bool:
        """Whether these bytes are encoded apart from those that follow."""
        return False


class Base64Data(RawData):
    """Bytes in base64, in runs that each end with a whole group of characters."""

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
        self._position += self._length(count)
        padding = self._content[: self._position][-2:].count(b"=")
        if len(taken) != count or padding != -count % 3:
            raise MeshError("it is not in base64")
        return taken

    def ends_after(self, count: int) -> bool:
        """Whether a run of so many bytes ends there."""
        end = b"=" * (-count % 3)
        return bool(end) and super().peek(self._length(count)).endswith(end)

    def refuse_rest(self) -> None:
        """Refuse further data."""
        if self._position < len(self._content):
            raise MeshError("it is longer than it states")


def read_uncompressed(data: RawData, header: np.dtype) -> bytes:
    """Read bytes that follow their number."""
    (count,) = np.frombuffer(data.peek(header.itemsize), header).tolist()
    if data.ends_after(header.itemsize):
        data.take(header.itemsize)
        return data.take(count)
    return data.take(header.itemsize + count)[header.itemsize :]


def read_compressed(
    data: RawData, header: np.dtype, decompressor: Any, n_bytes: int
) -> bytes:
    """Read a number of bytes that are compressed in blocks.

    Before them stand the number of blocks, the size of one and of the last, and their
    compressed sizes.
    """
    (n,) = np.frombuffer(data.peek(header.itemsize), header).tolist()
    sizes = np.frombuffer(data.take((3 + n) * header.itemsize), header).tolist()[1:]
    full, last, *compressed = sizes
    lengths = [full] * (n - 1) + [last or full] if n else []
    if sum(lengths) != n_bytes:
        raise MeshError(f"it holds {sum(lengths)} bytes, and {n_bytes} are due")
    rest, start, blocks = data.take(sum(compressed)), 0, []
    for size, length in zip(compressed, lengths, strict=True):
        block = decompressor()
        try:
            part = rest[start : start + size]
            blocks.append(block.decompress(part, max_length=length + 1))
        except (zlib.error, lzma.LZMAError):
            raise MeshError("it cannot be unpacked") from None
        if len(blocks[-1]) != length or not block.eof or block.unused_data:
            raise MeshError("a block has another length than it states")
        start += size
    return b"".join(blocks)
