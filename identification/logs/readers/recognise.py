"""Which reader a log needs, told from what is in it: the first bytes of a file, or the columns of
a table. A file's name decides nothing but how a table is packed.
"""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from ....runtime.errors import InputError
from ....runtime.regular_files import open_regular
from ..table import SUFFIXES
from . import READERS, Reader

_HEAD = 4096  # bytes of a file that are looked at
_LISTED = 8  # entries of a folder, or columns of a table, that a message lists
_GZIP = b"\x1f\x8b"
_BAG_FOLDER = ("metadata.yaml", ".db3", ".mcap")  # one of these is in a ROS 2 bag's folder


def reader_by_content(path: Path) -> Reader | None:
    """Return the reader of a file or folder by its first bytes; None where no reader knows them.

    Raises:
        InputError: it is a folder, but no ROS 2 bag's.
    """
    if os.path.isdir(path):  # False for a name that is too long
        return _folder(path)
    try:
        head = _head(path)
    except InputError:
        return None  # whoever reads it says what is wrong
    for reader in READERS.values():
        if reader.begins and head.startswith(reader.begins):
            return reader
    return None


def unknown_content(path: Path) -> InputError:
    """Return the error for a file that no reader knows and that is no table by its name.

    Raises:
        InputError: it cannot be read at all.
    """
    head = _head(path)
    if head.startswith(_GZIP):
        return InputError(
            f"{path}: is packed (gzip); expected a table, .csv.gz by name, or the log unpacked"
        )
    looked_for = ", ".join(reader.what for reader in READERS.values() if reader.begins)
    return InputError(
        f"{path}: unknown kind of file: it begins with {_shown(head)}; expected {looked_for}, "
        f"or a table, with a name that ends in {', '.join(SUFFIXES)}"
    )


def _head(path: Path) -> bytes:
    with open_regular(path, "a flight log") as file:
        return file.read(_HEAD)


def reader_by_columns(path: Path, header: Sequence[str]) -> Reader | None:
    """Return the reader whose columns a table has; None where it has those of none.

    Raises:
        InputError: it has those of several.
    """
    there = set(header)
    found = [r for r in READERS.values() if r.signature and there.issuperset(r.signature)]
    if len(found) > 1:
        raise InputError(
            f"{path}: its columns are those of {' and of '.join(r.what for r in found)}; expected "
            f"one: choose by --reader {' or --reader '.join(r.name for r in found)}"
        )
    return found[0] if found else None


def looked_for_columns() -> str:
    """Return the words for the tables that are recognised, each with a column that tells it."""
    return ", ".join(f"{r.name} ({r.signature[0]} ...)" for r in READERS.values() if r.signature)


def _folder(path: Path) -> Reader:
    """Return the reader of a folder.

    Raises:
        InputError: it is no ROS 2 bag's.
    """
    try:
        names = sorted(entry.name for entry in path.iterdir())
    except OSError as error:
        raise InputError(f"{path}: cannot be read as a folder: {error.strerror}") from error
    if any(name.lower().endswith(_BAG_FOLDER) for name in names):
        return READERS["rosbag"]
    raise InputError(
        f"{path}: is a folder; expected a file, or the folder of a ROS 2 bag, which has one of "
        f"{', '.join(_BAG_FOLDER)}; found {_some(names)}"
    )


def _some(names: Iterable[str]) -> str:
    names = list(names)
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return (", ".join(names[:_LISTED]) + more) if names else "nothing in it"


def _shown(head: bytes) -> str:
    """Return the first bytes in words."""
    if not head:
        return "nothing (it is empty)"
    start = head[:16]
    if all(32 <= byte < 127 or byte in b"\t\r\n" for byte in start):
        return repr(start.decode("ascii"))
    return " ".join(f"{byte:02x}" for byte in start[:8])
