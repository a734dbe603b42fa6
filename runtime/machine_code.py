"""Where machine code is kept: in a folder whose name is a digest of all sources it comes from.

Numba keeps a function's machine code until the function's own file changes. The code holds the
functions it calls as well, and constants of other modules.
"""

import hashlib
import inspect
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import config

from .code_digest import code_digest
from .compile_notice import notice

_ROOT = Path(__file__).resolve().parent.parent
# all rooms with compiled functions, and all that those import
ROOMS = ("runtime", "dynamics", "estimator", "controllers", "envs", "identification", "paper")
_PREFIX = "windwrench-"
_STARTED = time.time_ns()
# ours, since then and before their import: the digest is of what was before
_edited: list[Path] = []
_KEPT = 8  # folders of machine code, those that were used last; one takes up to 30 MB


@contextmanager
def code_folder(function: Callable[..., Any]) -> Iterator[bool]:
    """Have Numba keep the machine code of ``function`` beside code of the same sources. Yields
    whether there is a place for it.
    """
    folder = _folder_for(inspect.getfile(function))
    before = config.CACHE_DIR
    if folder is not None:
        config.CACHE_DIR = folder
    try:
        yield folder is not None
    finally:
        config.CACHE_DIR = before


def _folder_for(file: str) -> str | None:
    """Return the folder for machine code of a file's functions, or None where none can be kept."""
    is_ours = _is_ours(file)
    if _edited or not os.path.isfile(file):  # a prompt and a notebook have no file
        return None
    return _prepared(code_digest(ROOMS) if is_ours else _digest_beside(Path(file).parent))


@cache
def _is_ours(file: str) -> bool:
    path = Path(file).resolve()
    is_ours = any(path.is_relative_to(_ROOT / room) for room in ROOMS)
    if is_ours and path.stat().st_ctime_ns > _STARTED:
        _edited.append(path)
    return is_ours


def _digest_beside(folder: Path) -> str:
    """Return a digest of the package and the Python files of a folder, a user's own."""
    digest = hashlib.sha256(code_digest(ROOMS).encode())
    for path in sorted(folder.glob("*.py")):
        with suppress(OSError):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _prepared(digest: str) -> str | None:
    """Return a folder that can be written, and remove those not used for longest."""
    parent = _parent()
    if parent is None:
        return None
    folder = parent / f"{_PREFIX}{digest}"
    with suppress(OSError):
        folder.mkdir(exist_ok=True)
        os.utime(folder)  # its last use
        others = [path for path in parent.glob(f"{_PREFIX}*") if path != folder]
        used = {path: path.stat().st_mtime for path in others}
        for path in sorted(used, key=lambda path: used[path], reverse=True)[_KEPT - 1 :]:
            shutil.rmtree(path, ignore_errors=True)
    return str(folder)


@cache
def _parent() -> Path | None:
    """Return the first of some folders that can be written: the user's choice, beside the sources,
    the user's cache, a temporary one.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    chosen = [os.path.abspath(config.CACHE_DIR)] if config.CACHE_DIR else []
    for path in map(Path, (*chosen, _ROOT / "__pycache__", f"{home}/windwrench")):
        if path.is_absolute() and _is_writable(path):
            return path
    with suppress(OSError):  # no temporary folder either
        path = Path(tempfile.gettempdir(), f"windwrench-{os.getuid()}")
        if _is_writable(path) and _is_private(path):
            return path
    notice.is_kept = False
    return None


def _is_writable(path: Path) -> bool:
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=path).close()
    except OSError:
        return False
    return True


def _is_private(path: Path) -> bool:
    """Return whether nobody else can have put machine code there: all users may write beside it."""
    found = path.lstat()
    mine = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    return mine and not found.st_mode & 0o022
