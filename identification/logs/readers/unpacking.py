"""What is packed in a ROS bag, unpacked up to a limit: a few kilobytes may unpack to any size."""

import bz2
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from ....runtime.errors import InputError

LARGEST = 2**28  # bytes of a chunk; recorders make chunks of some megabytes
_METADATA = 1_000_000  # bytes
_WHOLE = re.compile(rb"compression_mode:\s*['\"]?(file|message)", re.IGNORECASE)


def _at_most(make: Callable[[], Any]) -> Callable[..., bytes]:
    """Return the decompression of ``make()``'s kind, which refuses what unpacks to more than
    ``LARGEST`` bytes.
    """

    def unpack(data: bytes, *_: object) -> bytes:
        machine = make()
        out: bytes = machine.decompress(data, max_length=LARGEST)
        if not machine.eof:
            raise ValueError(f"a chunk unpacks to more than {LARGEST} bytes, or ends too soon")
        return out

    return unpack


@contextmanager
def limited_unpacking() -> Iterator[None]:
    """Have rosbags unpack no chunk to more than ``LARGEST`` bytes while the block lasts."""
    import lz4.frame
    from rosbags.rosbag1 import reader
    from rosbags.rosbag2 import storage_mcap

    lz4_at_most = _at_most(lz4.frame.LZ4FrameDecompressor)
    with (
        patch.dict(
            reader.decompressors, {"bz2": _at_most(bz2.BZ2Decompressor), "lz4": lz4_at_most}
        ),
        patch.dict(
            storage_mcap.DECOMPRESSORS,
            {"zstd": _at_most(storage_mcap.zstd.ZstdDecompressor), "lz4": lz4_at_most},
        ),
    ):
        yield


def refuse_packed_files(path: Path) -> None:
    """Refuse a ROS 2 bag whose files or messages are packed one by one: what they unpack to cannot
    be limited.

    Raises:
        InputError: it is one.
    """
    metadata = path / "metadata.yaml" if path.is_dir() else path.with_name("metadata.yaml")
    try:
        with metadata.open("rb") as file:
            found = _WHOLE.search(file.read(_METADATA))
    except OSError:
        return  # the reader says what is missing
    if found:
        mode = found.group(1).decode().lower()
        raise InputError(
            f"{metadata}: compression_mode {mode}: expected a bag that is not packed, or by chunks "
            f"(MCAP); "
            "`ros2 bag convert` makes one"
        )
