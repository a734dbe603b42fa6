"""Writing a file whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

from .errors import InputError


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path`` that takes its place once the block has ended without
    an error.

    Whoever reads ``path`` sees the old file or the whole new one, never a part. What a killed
    process has left beside it goes.

    Raises:
        InputError: the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error
    finally:
        with suppress(OSError):  # it took its place, or was never there
            temporary.unlink()


def _sweep(path: Path) -> None:
    """Remove the temporary files of ``path`` whose processes are gone."""
    with suppress(OSError):
        for left in path.parent.glob(f".{escape(path.name)}.*.tmp"):
            number = left.name.removesuffix(".tmp").rpartition(".")[2]
            if number.isdigit() and not _lives(int(number)):
                left.unlink()


def _lives(pid: int) -> bool:
    if os.name == "nt":  # where asking would end the process
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # someone else's
        return True
    return True
