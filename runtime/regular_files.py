"""Reading files that a user names: regular ones alone, and no more of them than is expected.

A pipe without a writer, or a device such as /dev/zero, would never end.
"""

import json
import os
import stat
from pathlib import Path
from typing import Any, BinaryIO

from .errors import InputError
from .file_limits import LIMITS

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def _check_mode(path: Path, mode: int, what: str) -> None:
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
    try:
        found = path.stat()
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as {what}: {_reason(error)}") from error
    _check_mode(path, found.st_mode, what)
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
    try:
        # of a pipe that took its place meanwhile, nobody waits for the writer
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as {what}: {_reason(error)}") from error
    file = os.fdopen(descriptor, "rb")
    try:
        _check_mode(path, os.fstat(descriptor).st_mode, what)
    except BaseException:
        file.close()
        raise
    return file


def read_bytes(path: Path, what: str, most: int) -> bytes:
    """Return the bytes of a regular file that has at most ``most`` of them.

    Raises:
        InputError: it cannot be read, is no regular file, or is larger.
    """
    with open_regular(path, what) as file:
        try:
            # what states too large a size is not read; what states none may still hold more
            large = os.fstat(file.fileno()).st_size > most
            data = b"" if large else file.read(most + 1)
        except OSError as error:
            raise InputError(f"{path}: cannot be read as {what}: {_reason(error)}") from error
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
    try:
        return json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read as {what}: {error}") from error


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
