"""Writing a file whole or not at all, whatever ends the process or the machine.

The new file is on the disk before it takes the old one's place, and the folder's entry before the
writer goes on. Without the first a file may be empty after a loss of power, without the second the
old one may be back.
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
    """Give a temporary path beside ``path``, renamed to ``path`` once the block has ended without
    an error.

    Readers of ``path`` see the old file or the whole new one, never a part. After a loss of power,
    too, where the file system honours ``fsync``. Temporary files of killed processes go.

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
        with suppress(OSError):  # renamed, or never there
            temporary.unlink()


def _hidden(path: Path) -> str:
    """Return how the names of a path's temporary files begin: like its own, where there is room for
    more.
    """
    name = os.fsencode(path.name)
    if len(name) <= _LONGEST_NAME:
        return f".{path.name}"
    return f".{hashlib.blake2b(name, digest_size=16).hexdigest()}"


def _make_folder(folder: Path) -> None:
    """Make a folder and the missing ones above, and have them kept."""
    missing = [above for above in (folder, *folder.parents) if not above.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for above in missing:
        _keep(above.parent)


def _keep(path: Path) -> None:
    """Have the disk keep a file or the names in a folder, if possible.

    Raises:
        OSError: the disk cannot keep the file.
    """
    # a descriptor for reading keeps the writes of others, too
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # file systems without fsync, for a folder above all
        if not path.is_dir() and error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS):
            raise
    finally:
        os.close(descriptor)


def _sweep(path: Path) -> None:
    """Remove the temporary files of ``path`` left by processes now gone."""
    with suppress(OSError):
        for temporary in path.parent.glob(f"{escape(_hidden(path))}.*.tmp"):
            number = temporary.name.removesuffix(".tmp").rpartition(".")[2]
            if number.isdigit() and not _lives(int(number)):
                temporary.unlink()


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # someone else's
        return True
    return True
