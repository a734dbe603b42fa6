"""Reading files named by a user: regular ones alone, up to the expected size.

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

_ARCHIVE = b"PK\x03\x04"  # header of a member; other readers tell the kind of a file by these bytes
_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Have any error of the block name the file; an ``InputError`` stays as it is.

    Args:
        path: the file.
        what: the file's kind, for the error.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # any error of a parser on bytes of another kind
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise InputError(f"{path}: cannot be read as {what}: {reason}") from error


def _check_kind(path: Path, mode: int, what: str) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for test, name in _KINDS if test(mode)), "no regular file")
        raise InputError(f"{path}: is {kind}; expected {what}, a regular file")


def check_regular(path: Path, what: str, most: int | None = None) -> None:
    """Check for a regular file at a path, for libraries with their own ``open``.

    Args:
        path: the file.
        what: it is, for errors: ``"a flight log"``.
        most: largest size in bytes; None for any.

    Raises:
        InputError: the file does not exist, is of another kind, or is larger.
    """
    with reading(path, what):
        status = path.stat()
    _check_kind(path, status.st_mode, what)
    if most is not None and status.st_size > most:
        raise InputError(
            f"{path}: more than {most} bytes ({status.st_size}); expected {what}, no larger"
        )


def open_regular(path: Path, what: str) -> BinaryIO:
    """Open a regular file for reading bytes; other kinds are refused at once.

    Raises:
        InputError: the file cannot be opened, or is a folder, a pipe or a device.
    """
    check_regular(path, what)  # opening a device may already do something
    with reading(path, what):
        # a pipe may have taken the file's place meanwhile: nobody waits for its writer
        file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb")
    try:
        _check_kind(path, os.fstat(file.fileno()).st_mode, what)
    except InputError:
        file.close()
        raise
    return file


def read_bytes(path: Path, what: str, most: int) -> bytes:
    """Return the bytes of a regular file, at most ``most``.

    Raises:
        InputError: the file cannot be read, is no regular file, or is larger.
    """
    with open_regular(path, what) as file, reading(path, what):
        # a file with too large a stated size is not read; one without a size may still hold more
        large = os.fstat(file.fileno()).st_size > most
        data = b"" if large else file.read(most + 1)
    if large or len(data) > most:
        raise InputError(f"{path}: more than {most} bytes; expected {what}, no larger")
    return data


def read_json(path: Path, what: str) -> Any:
    """Return the value in a JSON file.

    Raises:
        InputError: the file cannot be read, is larger than ``FileLimits.json_text``, or is not
            JSON.
    """
    data = read_bytes(path, what, LIMITS.json_text)
    if not data.strip():
        raise InputError(f"{path}: empty file; expected {what}")
    with reading(path, what):
        return json.loads(data.decode("utf-8"))


def check_archive(path: Path, data: BinaryIO, most: int, what: str, packed: bool = True) -> None:
    """Check the unpacked size of an archive's members: at most ``most`` bytes in all.

    Args:
        path: the file, for errors.
        data: its bytes as a file, left at its beginning.
        most: bytes.
        what: it is, for errors: ``"a checkpoint"``.
        packed: members may be packed.

    Raises:
        InputError: no archive, or a larger unpacked size.
    """
    with reading(path, what):
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
