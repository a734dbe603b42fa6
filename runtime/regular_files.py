"""Reading files that a user names: regular ones alone, and no more of them than is expected.

A pipe without a writer, or a device such as /dev/zero, would never end. A zip archive is counted by
its list of contents before anything is unpacked: Python's reader unpacks no more of a member than
the list claims, so the claims are a bound.
"""

import json
import os
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from .errors import InputError
from .file_limits import LIMITS

_ARCHIVE = b"PK\x03\x04"  # a member's header; other readers look here for what kind of file it is
_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


@contextmanager
def _reading(path: Path, what: str) -> Iterator[None]:
    """Have whatever the block raises say which file cannot be read."""
    try:
        yield
    except Exception as error:  # whatever a parser makes of bytes that are something else
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise InputError(f"{path}: cannot be read as {what}: {reason}") from error


def _check_kind(path: Path, mode: int, what: str) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for test, name in _KINDS if test(mode)), "no regular file")
        raise InputError(f"{path}: is {kind}; expected {what}, a regular file")


def check_regular(path: Path, what: str, most: int | None = None) -> None:
    """Check that a path names a regular file, for libraries that open it by its name.

    Args:
        path: the file.
        what: it is, for errors: ``"a flight log"``.
        most: bytes that it may have; None for any number.

    Raises:
        InputError: it does not exist, is of another kind, or is larger.
    """
    with _reading(path, what):
        found = path.stat()
    _check_kind(path, found.st_mode, what)
    if most is not None and found.st_size > most:
        raise InputError(
            f"{path}: more than {most} bytes ({found.st_size}); expected {what}, no larger"
        )


def open_regular(path: Path, what: str) -> BinaryIO:
    """Open a regular file for reading bytes; what is none is refused at once.

    Raises:
        InputError: it cannot be opened, or is a folder, a pipe or a device.
    """
    check_regular(path, what)  # opening a device may already do something
    with _reading(path, what):
        # of a pipe that took its place meanwhile, nobody waits for the writer
        file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb")
    try:
        _check_kind(path, os.fstat(file.fileno()).st_mode, what)
    except InputError:
        file.close()
        raise
    return file


def read_bytes(path: Path, what: str, most: int) -> bytes:
    """Return the bytes of a regular file that has at most ``most`` of them.

    Raises:
        InputError: it cannot be read, is no regular file, or is larger.
    """
    with open_regular(path, what) as file, _reading(path, what):
        # what states too large a size is not read; what states none may still hold more
        large = os.fstat(file.fileno()).st_size > most
        data = b"" if large else file.read(most + 1)
    if large or len(data) > most:
        raise InputError(f"{path}: more than {most} bytes; expected {what}, no larger")
    return data


def read_json(path: Path, what: str) -> Any:
    """Return the value in a JSON file.

    Raises:
        InputError: it cannot be read, is larger than ``FileLimits.json_text``, or is not JSON.
    """
    data = read_bytes(path, what, LIMITS.json_text)
    if not data.strip():
        raise InputError(f"{path}: empty file; expected {what}")
    with _reading(path, what):
        return json.loads(data.decode("utf-8"))


def check_archive(path: Path, data: BinaryIO, most: int, what: str, packed: bool = True) -> None:
    """Check that an archive's members unpack to at most ``most`` bytes in all.

    Args:
        path: the file, for errors.
        data: its bytes as a file, which is left at its beginning.
        most: bytes.
        what: it is, for errors: ``"a checkpoint"``.
        packed: members may be packed.

    Raises:
        InputError: it is no archive, or unpacks to more.
    """
    with _reading(path, what):
        if data.read(len(_ARCHIVE)) != _ARCHIVE:
            raise ValueError("no zip archive" if data.tell() else "empty file")
        with zipfile.ZipFile(data) as archive:
            claimed = sum(member.file_size for member in archive.infolist())
            if not packed and any(member.compress_type for member in archive.infolist()):
                raise ValueError("its members are packed")
        data.seek(0)
    if claimed > most:
        raise InputError(
            f"{path}: unpacks to {claimed} bytes; expected {what}, at most {most} bytes"
        )
