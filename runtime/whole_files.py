"""Writing a file whole or not at all, whatever ends the process or the machine.

The new file is on the disk before it takes the old one's place, and the folder says so before the
writer goes on: without the first a file may be empty after a loss of power, without the second it
may be the old one again.
"""

import errno
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

from .errors import InputError

_LONGEST_NAME = 220  # bytes; file systems allow 255, temporary names need some more


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path`` that takes its place once the block has ended without
    an error.

    Whoever reads ``path`` sees the old file or the whole new one, never a part, and so does whoever
    looks after a loss of power, where the file system keeps what it is told to keep (``fsync``).
    What a killed process has left beside it goes.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        temporary = path.with_name(f"{_hidden(path)}.{os.getpid()}.tmp")
    except ValueError as error:  # a path without a name
        raise InputError(f"{path}: cannot be written: {error}") from error
    try:
        _make_folder(path.parent)
        _sweep(path)
        yield temporary
        _keep(temporary)
        os.replace(temporary, path)
        _keep(path.parent)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error
    finally:
        with suppress(OSError):  # it took its place, or was never there
            temporary.unlink()


def _hidden(path: Path) -> str:
    """Return how the names of a path's temporary files begin: like its own, where that leaves room
    for more.
    """
    name = os.fsencode(path.name)
    if len(name) <= _LONGEST_NAME:
        return f".{path.name}"
    return f".{hashlib.blake2b(name, digest_size=16).hexdigest()}"


def _make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing, and have them kept."""
    missing = [above for above in (folder, *folder.parents) if not above.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for above in missing:
        _keep(above.parent)


def _keep(path: Path) -> None:
    """Have the disk keep a file or the names in a folder, where it can do that.

    Raises:
        OSError: the disk cannot keep the file.
    """
    # the descriptor needs no right to write for what others have written
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # file systems that know no fsync, of a folder above all
        if not path.is_dir() and error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS):
            raise
    finally:
        os.close(descriptor)


def _sweep(path: Path) -> None:
    """Remove the temporary files of ``path`` whose processes are gone."""
    with suppress(OSError):
        for left in path.parent.glob(f"{escape(_hidden(path))}.*.tmp"):
            number = left.name.removesuffix(".tmp").rpartition(".")[2]
            if number.isdigit() and not _lives(int(number)):
                left.unlink()


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # someone else's
        return True
    return True
