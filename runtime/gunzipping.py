"""A gzipped file as a stream of what it unpacks to, in one piece after the other: its packed bytes
and its parts are counted.
"""

import io
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from .errors import InputError
from .file_limits import LIMITS

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

_PIECE = 2**16  # bytes read at a time
_GZIP = 31  # zlib's window bits for gzip's header and checksum


class Gunzip(io.RawIOBase):
    """Unpacks a gzip file, whose parts (RFC 1952, 2.2) follow one another, with zeros behind them
    or not.

    Args:
        file: packed.
        path: of it, for errors.
        most: packed bytes that it may have.

    Reading raises InputError where there is more, and EOFError or ``zlib.error`` where the file is
    cut or spoiled.
    """

    def __init__(self, file: BinaryIO, path: Path, most: int) -> None:
        self._file, self._path, self._left = file, path, most
        self._most = most
        self._packed = b""
        self._machine = zlib.decompressobj(_GZIP)
        self._begun, self._parts = False, 0

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Put the next bytes into a buffer; return how many they are, 0 at the end."""
        view = memoryview(buffer).cast("B")
        while True:
            if not self._packed and not self._next():
                if self._begun:
                    raise EOFError("the packed data ends before its end is marked")
                return 0
            data = self._machine.decompress(self._packed, len(view))
            self._begun = True
            if self._machine.eof:
                self._packed = self._machine.unused_data
                self._machine, self._begun = zlib.decompressobj(_GZIP), False
                self._parts += 1
                if self._parts > LIMITS.gzip_members:
                    raise InputError(
                        f"{self._path}: more than {LIMITS.gzip_members} packed parts; expected one"
                    )
                self._packed = self._packed.lstrip(b"\0")
            else:
                self._packed = self._machine.unconsumed_tail
            if data:
                view[: len(data)] = data
                return len(data)

    def _next(self) -> bool:
        """Read on, over zeros between parts; return whether there is more."""
        while piece := self._file.read(_PIECE):
            self._left -= len(piece)
            if self._left < 0:
                raise InputError(f"{self._path}: more than {self._most} packed bytes")
            self._packed = piece if self._begun or not self._parts else piece.lstrip(b"\0")
            if self._packed:
                return True
        return False

    def close(self) -> None:
        """Close the packed file too."""
        self._file.close()
        super().close()
