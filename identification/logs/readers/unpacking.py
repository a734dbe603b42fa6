"""What is packed in a ROS bag, unpacked up to a limit: a few kilobytes may unpack to any size."""

import bz2
import os
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import count
from pathlib import Path
from typing import Any
from unittest.mock import patch

from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS
from ....runtime.regular_files import check_regular

LARGEST = LIMITS.bag_chunk
_METADATA = 1_000_000  # bytes
_TABLES = 100  # a bag has four or five
_COMPUTED = re.compile(r"\bAS\s*\(|\bVIRTUAL\b", re.IGNORECASE)
_LISTED = re.compile(r"^\s*-\s*['\"]?(.+\.(?:db3|mcap))['\"]?\s*$", re.MULTILINE)
_WHOLE = re.compile(r"compression_mode:\s*['\"]?(file|message)", re.IGNORECASE)


def _at_most(make: Callable[[], Any], spent: list[int]) -> Callable[..., bytes]:
    """Return the decompression of ``make()``'s kind, which refuses what unpacks to more than
    ``LARGEST`` bytes, or to more than a bag may with all its chunks, of which ``spent`` keeps the
    count: an index may name the same chunk over and over.
    """

    def unpack(data: bytes, *_: object) -> bytes:
        machine = make()
        out: bytes = machine.decompress(data, max_length=LARGEST)
        if not machine.eof:
            raise ValueError(f"a chunk unpacks to more than {LARGEST} bytes, or ends too soon")
        spent.append(spent.pop() + len(out))
        if spent[0] > LIMITS.bag_unpacked:
            raise ValueError(
                f"its chunks unpack to more than {LIMITS.bag_unpacked} bytes; copy the topics of "
                f"pose and rotors to a bag of their own"
            )
        return out

    return unpack


@contextmanager
def limited_unpacking() -> Iterator[None]:
    """Have rosbags unpack no chunk to more than ``LARGEST`` bytes, and no more of them and of their
    index than ``FileLimits`` allows, while the block lasts.
    """
    import lz4.frame
    from rosbags.rosbag1 import reader
    from rosbags.rosbag2 import storage_mcap

    spent = [0]
    entries = count()

    class Entry(reader.IndexData):  # type: ignore[misc]
        """An entry of the index, counted."""

        __slots__ = ()

        def __new__(cls, *values: int) -> Any:
            if next(entries) >= LIMITS.bag_index:
                raise ValueError(f"its index has more than {LIMITS.bag_index} entries")
            return super().__new__(cls, *values)

    lz4_at_most = _at_most(lz4.frame.LZ4FrameDecompressor, spent)
    with (
        patch.object(reader, "IndexData", Entry),
        patch.dict(
            reader.decompressors, {"bz2": _at_most(bz2.BZ2Decompressor, spent), "lz4": lz4_at_most}
        ),
        patch.dict(
            storage_mcap.DECOMPRESSORS,
            {"zstd": _at_most(storage_mcap.zstd.ZstdDecompressor, spent), "lz4": lz4_at_most},
        ),
    ):
        yield


def check_bag_files(path: Path) -> None:
    """Check the files of a ROS 2 bag, a file or a folder, before a library opens them by name.

    Raises:
        InputError: one is no regular file, or a database that computes what it holds; or the files
            or messages are packed one by one, so that what they unpack to cannot be limited.
    """
    is_folder = os.path.isdir(path)
    folder = path if is_folder else path.parent
    metadata = folder / "metadata.yaml"
    files = [file for file in folder.iterdir() if not file.is_dir()] if is_folder else [path]
    text = ""
    if metadata.exists():
        check_regular(metadata, "the metadata of a ROS 2 bag", _METADATA)
        text = metadata.read_bytes().decode("utf-8", "replace")
    if is_folder:
        files += [path / name for name in _LISTED.findall(text) if (path / name).exists()]
    for file in files:
        check_regular(file, "a file of a ROS 2 bag")
        if file.suffix.lower() == ".db3":
            _check_database(file)
    if found := _WHOLE.search(text):
        raise InputError(
            f"{metadata}: compression_mode {found.group(1).lower()}: expected a bag that is not "
            "packed, or by chunks (MCAP); `ros2 bag convert` makes one"
        )


def _check_database(path: Path) -> None:
    """Raise InputError where a view or a computed column stands for a bag's tables: a few bytes of
    SQL may give any number of rows of any size.
    """
    try:
        uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as database:
            query = "SELECT name, type, sql FROM sqlite_master WHERE type IN ('table', 'view')"
            found = database.execute(query).fetchmany(_TABLES)
    except sqlite3.Error:
        return  # the reader says what is wrong with it
    for name, kind, sql in found:
        if kind == "view" or _COMPUTED.search(sql or "") or len(found) == _TABLES:
            raise InputError(
                f"{path}: its {kind} {name!r} is computed; expected a ROS 2 bag, whose tables hold "
                f"what was recorded"
            )
