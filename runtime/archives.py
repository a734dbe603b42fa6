"""Zip archives from strangers: counted by their list of contents before anything is unpacked.

Python's reader unpacks no more of a member than the list claims, so the claims are a bound.
"""

import zipfile
from pathlib import Path
from typing import BinaryIO

from .errors import InputError

_BEGINS = b"PK\x03\x04"  # a member's header; other readers look here for what kind of file it is


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
    try:
        if data.read(len(_BEGINS)) != _BEGINS:
            raise ValueError("no zip archive" if data.tell() else "empty file")
        with zipfile.ZipFile(data) as archive:
            claimed = sum(member.file_size for member in archive.infolist())
            if not packed and any(member.compress_type for member in archive.infolist()):
                raise ValueError("its members are packed")
        data.seek(0)
    except Exception as error:  # whatever a parser makes of bytes that are no archive
        raise InputError(f"{path}: cannot be read as {what}: {error}") from error
    if claimed > most:
        raise InputError(
            f"{path}: unpacks to {claimed} bytes; expected {what}, at most {most} bytes"
        )
