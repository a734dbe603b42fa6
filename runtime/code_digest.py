"""A digest of code: a result of other code is not comparable, and not reused."""

import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent


@cache
def code_digest(
    rooms: Sequence[str], files: Iterable[str] = (), without: Sequence[str] = ()
) -> str:
    """Return a digest (16 hexadecimal digits) of the package's code.

    Args:
        rooms: folders of the package, taken with all that lies in them.
        files: more files.
        without: folders that are left out of the rooms.

    All paths are below the package's folder, with ``/``; give tuples.
    """
    found = {_ROOT / name for name in files}
    for room in rooms:
        for path in (_ROOT / room).rglob("*"):
            name = path.relative_to(_ROOT).as_posix()
            if path.suffix in (".py", ".yaml", ".xml") and not name.startswith(
                tuple(f"{folder}/" for folder in without)
            ):
                found.add(path)
    digest = hashlib.sha256()
    for path in sorted(found):
        digest.update(path.relative_to(_ROOT).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
